#include "arrays.hpp"
#include "bindings.hpp"
#include "run_setup.hpp"

#include "fracgyro/sim/settings.hpp"
#include "fracgyro/sim/user_plant.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

// Times and values.
using Points = std::pair<std::vector<double>, std::vector<double>>;

void bind_loop(nb::module_& m) {
    m.def(
        "plant_map",
        [](const Setup& s) {
            const auto columns = Gyroscope<double>::prepare(s.plant, s.common.step).map;
            std::array<std::array<double, 6>, 4> rows{};
            for (std::size_t i = 0; i < 4; ++i) {
                for (std::size_t j = 0; j < 6; ++j) {
                    rows[i][j] = columns[j][i];
                }
            }
            return rows;
        },
        nb::arg("setup"), "Rows x, y, vx, vy after one step; columns x, y, vx, vy, force x, force y before it.");

    nb::class_<Setup>(m, "Setup")
        .def_prop_ro("kind", [](const Setup& s) { return s.controller.index(); })
        .def_ro("steps", &Setup::steps)
        .def_prop_ro("has_memory", [](const Setup& s) { return has_memory(s.controller); })
        .def_prop_rw(
            "kernel",
            [](const Setup& s) {
                const ExponentialSum* const kernel = kernel_of(s.controller);
                return kernel == nullptr ? ExponentialSum{} : *kernel;
            },
            [](Setup& s, const ExponentialSum& designed) {
                if (ExponentialSum* const kernel = kernel_of(s.controller)) {
                    *kernel = designed;
                }
            })
        .def_prop_rw(
            "observer_bandwidth", [](const Setup& s) { return s.common.observer_bandwidth; },
            [](Setup& s, double bandwidth) { s.common.observer_bandwidth = bandwidth; })
        .def_prop_rw(
            "seed", [](const Setup& s) { return s.disturbance.seed; },
            [](Setup& s, std::uint64_t seed) { s.disturbance.seed = seed; });
    nb::class_<RunSetup, Setup>(m, "DeviceSetup")
        .def(
            "__init__",
            [](RunSetup* setup, std::size_t kind, const std::vector<double>& settings) {
                if (kind >= controller_kinds.size()) {
                    throw nb::value_error("no controller is of that kind");
                }
                new (setup) RunSetup{};
                setup->controller = params_of_kind(kind);
                if (settings.size() != setting_count(*setup)) {
                    throw nb::value_error("there must be one number for each field of the kind");
                }
                take_settings(*setup, settings.data());
            },
            nb::arg("kind"), nb::arg("settings"), "The kind's place in controller_kinds; numbers in its fields' order.")
        .def(nb::init<const RunSetup&>())
        .def(
            "set_device",
            [](RunSetup& s, const std::vector<double>& settings, const Points& rate, const Points& temperature,
               std::uint64_t seed) {
                if (settings.size() != device_setting_count()) {
                    throw nb::value_error("there must be one number for each of device_fields");
                }
                take_device_settings(s, settings.data());
                s.rate.table = {rate.first, rate.second};
                s.device.temperature = {temperature.first, temperature.second};
                s.rate.seed = seed;
            },
            nb::arg("settings"), nb::arg("rate"), nb::arg("temperature"), nb::arg("seed"),
            "Numbers of the rate and the device in the order of device_fields; times, in steps, and values of the rate "
            "and of the change of temperature; the seed of the rate.")
        .def(
            "set_plant",
            [](RunSetup& s, std::size_t kind, const std::vector<double>& values) {
                if (kind >= plant_count || values.size() != own_number_count(kind)) {
                    throw nb::value_error("there must be one number for each of fields_of_plant");
                }
                s.set_model(make_plant(kind, s.plant, s.common.step, values));
            },
            nb::arg("kind"), nb::arg("values"), "Its place in plant_kinds, its own numbers as in fields_of_plant.")
        .def(
            "set_user_plant",
            [](RunSetup& s, std::shared_ptr<UserPlant> plant, const Units& units) {
                plant->begin(units, s);
                s.set_model(std::move(plant));
            },
            nb::arg("plant"), nb::arg("units"));
}

}  // namespace fracgyro::bindings
