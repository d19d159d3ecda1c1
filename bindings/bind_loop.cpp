#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/sim/device_loop.hpp"
#include "fracgyro/sim/settings.hpp"

#include <nanobind/stl/pair.h>
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
            [](Setup& s, std::uint64_t seed) { s.disturbance.seed = seed; })
        .def(
            "set_terms", [](Setup& s, const std::vector<double>& numbers) { take_terms(s.disturbance, numbers); },
            nb::arg("numbers"), "The terms of the disturbance, as take_terms in settings.hpp reads them.");
    nb::class_<DeviceSetup, Setup>(m, "DeviceSetup")
        .def(
            "__init__",
            [](DeviceSetup* setup, std::size_t kind, const std::vector<double>& settings) {
                if (kind >= controller_kinds.size()) {
                    throw nb::value_error("no controller is of that kind");
                }
                new (setup) DeviceSetup{};
                setup->controller = params_of_kind(kind);
                if (settings.size() != setting_count(*setup)) {
                    throw nb::value_error("there must be one number for each field of the kind");
                }
                take_settings(*setup, settings.data());
            },
            nb::arg("kind"), nb::arg("settings"), "The kind's place in controller_kinds; numbers in its fields' order.")
        .def(nb::init<const DeviceSetup&>())
        .def(
            "set_device",
            [](DeviceSetup& s, const std::vector<double>& settings, const Points& rate, const Points& temperature,
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
            "and of the change of temperature; the seed of the rate.");
}

}  // namespace fracgyro::bindings
