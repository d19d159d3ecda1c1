#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/plant/imperfections.hpp"

#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

void bind_device(nb::module_& m) {
    nb::class_<Profile>(m, "Profile")
        .def(nb::init<>())
        .def_rw("times", &Profile::times)
        .def_rw("values", &Profile::values);

    nb::enum_<AngularRateKind>(m, "AngularRateKind")
        .value("constant", AngularRateKind::constant)
        .value("staircase", AngularRateKind::staircase)
        .value("sine", AngularRateKind::sine)
        .value("chirp", AngularRateKind::chirp)
        .value("noise", AngularRateKind::noise)
        .value("table", AngularRateKind::table);
    nb::class_<AngularRateParams>(m, "AngularRateParams")
        .def(nb::init<>())
        .def_rw("kind", &AngularRateParams::kind)
        .def_rw("amplitude", &AngularRateParams::amplitude)
        .def_rw("start", &AngularRateParams::start)
        .def_rw("hold", &AngularRateParams::hold)
        .def_rw("levels", &AngularRateParams::levels)
        .def_rw("frequency", &AngularRateParams::frequency)
        .def_rw("final_frequency", &AngularRateParams::final_frequency)
        .def_rw("seed", &AngularRateParams::seed)
        .def_rw("table", &AngularRateParams::table)
        .def_rw("inertial", &AngularRateParams::inertial);

    auto quantizer = nb::class_<Quantizer>(m, "Quantizer")
                         .def(nb::init<>())
                         .def_rw("bits", &Quantizer::bits)
                         .def("__call__", [](const Quantizer& q, const Array2& a) { return to_array(q(to_vec2(a))); });
    def_vec2(quantizer, "range", &Quantizer::range);
    auto axes =
        nb::class_<AxesParams>(m, "AxesParams").def(nb::init<>()).def_rw("misalignment", &AxesParams::misalignment);
    def_vec2(axes, "gain_error", &AxesParams::gain_error);
    auto device = nb::class_<ImperfectionParams>(m, "ImperfectionParams")
                      .def(nb::init<>())
                      .def_rw("position_noise", &ImperfectionParams::position_noise)
                      .def_rw("velocity_noise", &ImperfectionParams::velocity_noise)
                      .def_rw("position_flicker", &ImperfectionParams::position_flicker)
                      .def_rw("velocity_flicker", &ImperfectionParams::velocity_flicker)
                      .def_rw("position", &ImperfectionParams::position)
                      .def_rw("velocity", &ImperfectionParams::velocity)
                      .def_rw("actuator", &ImperfectionParams::actuator)
                      .def_rw("pickoff", &ImperfectionParams::pickoff)
                      .def_rw("force", &ImperfectionParams::force)
                      .def_rw("delay", &ImperfectionParams::delay)
                      .def_rw("stiffness_drift", &ImperfectionParams::stiffness_drift)
                      .def_rw("damping_drift", &ImperfectionParams::damping_drift)
                      .def_rw("temperature", &ImperfectionParams::temperature)
                      .def_rw("bias_instability", &ImperfectionParams::bias_instability)
                      .def_rw("rate_random_walk", &ImperfectionParams::rate_random_walk);
    def_vec2(device, "cubic_stiffness", &ImperfectionParams::cubic_stiffness);
}

}  // namespace fracgyro::bindings
