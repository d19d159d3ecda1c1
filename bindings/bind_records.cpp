// Sums over long records, which NumPy would take several passes for.
#include "arrays.hpp"
#include "bindings.hpp"

#include "fracgyro/sim/cpu_dispatch.hpp"

#include <array>

namespace fracgyro::bindings {

namespace {

using Doubles = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// Sum of the squares of s[i + 2m] - 2 s[i + m] + s[i] over the first `count` i. The eight parts fill a register, in an
// order that is the same on every processor.
FRACGYRO_FOR_EACH_PROCESSOR
double sum_of_squares(const double* s, std::size_t m, std::size_t count) {
    std::array<double, 8> parts{};
    std::size_t i = 0;
    for (; i + parts.size() <= count; i += parts.size()) {
        for (std::size_t k = 0; k < parts.size(); ++k) {
            const double difference = (s[i + k + 2 * m] - s[i + k + m]) - (s[i + k + m] - s[i + k]);
            parts[k] += difference * difference;
        }
    }
    for (; i < count; ++i) {
        const double difference = (s[i + 2 * m] - s[i + m]) - (s[i + m] - s[i]);
        parts[0] += difference * difference;
    }
    double sum = 0.0;
    for (const double part : parts) {
        sum += part;
    }
    return sum;
}

double second_differences(const Doubles& sums, std::size_t m) {
    if (m == 0 || sums.shape(0) < 2 || m > (sums.shape(0) - 1) / 2) {
        throw nb::value_error("m must be from 1 to half of the intervals");
    }
    const nb::gil_scoped_release unlocked;
    return sum_of_squares(sums.data(), m, sums.shape(0) - 2 * m);
}

}  // namespace

void bind_records(nb::module_& m) {
    m.def("second_differences", &second_differences, nb::arg("sums"), nb::arg("m"),
          "Sum of the squares of sums[i + 2m] - 2 sums[i + m] + sums[i] over all i.");
}

}  // namespace fracgyro::bindings
