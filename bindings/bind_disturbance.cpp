#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/sim/loop.hpp"

#include <nanobind/stl/vector.h>

namespace fracgyro::bindings {

void bind_disturbance(nb::module_& m) {
    m.def("philox", &philox, nb::arg("key"), nb::arg("counter"), "One block of Philox4x32-10.");
    m.def(
        "spectral_power",
        [](const std::vector<double>& frequencies, const std::vector<double>& densities) {
            return Tones::power(frequencies, densities);
        },
        nb::arg("frequencies"), nb::arg("densities"), "Integral of a spectrum as vibration has it.");
    m.def(
        "disturbance",
        [](const Setup& s, std::int64_t first, std::size_t count, std::uint32_t stream) {
            DisturbanceParams params = s.disturbance;
            params.stream = stream;
            if (stream != 0) {
                params.terms.clear();
            }
            auto values = std::make_unique<Vec2<double>[]>(count);
            Disturbance(params, s.common.step).fill(first, {values.get(), count});
            auto out = std::make_unique<double[]>(2 * count);
            for (std::size_t i = 0; i < count; ++i) {
                out[2 * i] = values[i].x();
                out[2 * i + 1] = values[i].y();
            }
            return owned<double, 2>(std::move(out), {count, 2});
        },
        nb::arg("setup"), nb::arg("first"), nb::arg("count"), nb::arg("stream") = 0,
        "d at the steps first, first + 1, …; of another stream than 0 without the terms.");
}

}  // namespace fracgyro::bindings
