#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/device_loop.hpp"

#include <nanobind/stl/string_view.h>

namespace fracgyro::bindings {

void bind_loop(nb::module_& m) {
    auto plant = nb::class_<PlantParams>(m, "PlantParams")
                     .def(nb::init<>())
                     .def_rw("rate", &PlantParams::rate)
                     .def_prop_rw(
                         "initial_position", [](const PlantParams& p) { return to_array(p.initial.position); },
                         [](PlantParams& p, const Array2& a) { p.initial.position = to_vec2(a); })
                     .def_prop_rw(
                         "initial_velocity", [](const PlantParams& p) { return to_array(p.initial.velocity); },
                         [](PlantParams& p, const Array2& a) { p.initial.velocity = to_vec2(a); });
    def_sym2(plant, "damping", &PlantParams::damping);
    def_sym2(plant, "stiffness", &PlantParams::stiffness);
    def_sym2(plant, "damping_deviation", &PlantParams::damping_deviation);
    def_sym2(plant, "stiffness_deviation", &PlantParams::stiffness_deviation);

    m.def(
        "plant_map",
        [](const PlantParams& p, double step) {
            const auto columns = Plant<double>::prepare(p, step).map;
            std::array<std::array<double, 6>, 4> rows{};
            for (std::size_t i = 0; i < 4; ++i) {
                for (std::size_t j = 0; j < 6; ++j) {
                    rows[i][j] = columns[j][i];
                }
            }
            return rows;
        },
        nb::arg("params"), nb::arg("step"),
        "Rows x, y, vx, vy after one step; columns x, y, vx, vy, force x, force y before it.");

    nb::class_<Setup>(m, "Setup")
        .def(nb::init<>())
        .def(nb::init<const Setup&>())
        .def_prop_rw(
            "kind", [](const Setup& s) { return s.kind; },
            [](Setup& s, std::string_view kind) {
                const auto* const listed = std::find(controller_kinds.begin(), controller_kinds.end(), kind);
                if (listed == controller_kinds.end()) {
                    throw nb::value_error("there is no controller of that kind");
                }
                s.kind = *listed;  // Python's string does not last
            })
        .def_rw("controller", &Setup::controller)
        .def_rw("plant", &Setup::plant)
        .def_rw("disturbance", &Setup::disturbance)
        .def_rw("steps", &Setup::steps);
    nb::class_<DeviceSetup, Setup>(m, "DeviceSetup")
        .def(nb::init<>())
        .def(nb::init<const DeviceSetup&>())
        .def_rw("rate", &DeviceSetup::rate)
        .def_rw("device", &DeviceSetup::device);
}

}  // namespace fracgyro::bindings
