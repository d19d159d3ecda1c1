#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/device.hpp"

#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

void bind_device(nb::module_& m) {
    nb::class_<Profile>(m, "Profile")
        .def(nb::init<>())
        .def_rw("times", &Profile::times)
        .def_rw("values", &Profile::values);

    nb::enum_<RateKind>(m, "RateKind")
        .value("constant", RateKind::constant)
        .value("staircase", RateKind::staircase)
        .value("sine", RateKind::sine)
        .value("chirp", RateKind::chirp)
        .value("noise", RateKind::noise)
        .value("table", RateKind::table);
    nb::class_<RateParams>(m, "RateParams")
        .def(nb::init<>())
        .def_rw("kind", &RateParams::kind)
        .def_rw("amplitude", &RateParams::amplitude)
        .def_rw("start", &RateParams::start)
        .def_rw("hold", &RateParams::hold)
        .def_rw("levels", &RateParams::levels)
        .def_rw("frequency", &RateParams::frequency)
        .def_rw("final_frequency", &RateParams::final_frequency)
        .def_rw("seed", &RateParams::seed)
        .def_rw("table", &RateParams::table)
        .def_rw("inertial", &RateParams::inertial);

    nb::class_<Quantiser>(m, "Quantiser")
        .def(nb::init<>())
        .def_rw("range", &Quantiser::range)
        .def_rw("bits", &Quantiser::bits)
        .def("__call__", [](const Quantiser& q, double a) { return q(a); });
    auto device = nb::class_<DeviceParams>(m, "DeviceParams")
                      .def(nb::init<>())
                      .def_rw("position_noise", &DeviceParams::position_noise)
                      .def_rw("velocity_noise", &DeviceParams::velocity_noise)
                      .def_rw("position", &DeviceParams::position)
                      .def_rw("velocity", &DeviceParams::velocity)
                      .def_rw("actuator", &DeviceParams::actuator)
                      .def_rw("delay", &DeviceParams::delay)
                      .def_rw("stiffness_drift", &DeviceParams::stiffness_drift)
                      .def_rw("temperature", &DeviceParams::temperature);
    def_vec2(device, "cubic_stiffness", &DeviceParams::cubic_stiffness);
}

}  // namespace fracgyro::bindings
