#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/disturbance.hpp"

namespace fracgyro::bindings {

void bind_disturbance(nb::module_& m) {
    nb::enum_<DisturbanceKind>(m, "DisturbanceKind")
        .value("none", DisturbanceKind::none)
        .value("noise", DisturbanceKind::noise)
        .value("sine", DisturbanceKind::sine);
    auto params = nb::class_<DisturbanceParams>(m, "DisturbanceParams")
                      .def(nb::init<>())
                      .def(nb::init<const DisturbanceParams&>())
                      .def_rw("kind", &DisturbanceParams::kind)
                      .def_rw("standard_deviation", &DisturbanceParams::standard_deviation)
                      .def_rw("hold", &DisturbanceParams::hold)
                      .def_rw("seed", &DisturbanceParams::seed)
                      .def_rw("stream", &DisturbanceParams::stream);
    def_vec2(params, "amplitude", &DisturbanceParams::amplitude);
    def_vec2(params, "frequency", &DisturbanceParams::frequency);
    def_vec2(params, "phase", &DisturbanceParams::phase);

    m.def("philox", &philox, nb::arg("key"), nb::arg("counter"), "One block of Philox4x32-10.");
    m.def(
        "disturbance",
        [](const DisturbanceParams& p, double step, std::int64_t first, std::size_t count) {
            auto values = std::make_unique<Vec2<double>[]>(count);
            Disturbance(p, step).fill(first, {values.get(), count});
            auto out = std::make_unique<double[]>(2 * count);
            for (std::size_t i = 0; i < count; ++i) {
                out[2 * i] = values[i].x;
                out[2 * i + 1] = values[i].y;
            }
            return owned<double, 2>(std::move(out), {count, 2});
        },
        nb::arg("params"), nb::arg("step"), nb::arg("first"), nb::arg("count"), "d at the steps first, first + 1, ….");
}

}  // namespace fracgyro::bindings
