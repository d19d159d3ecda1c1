// Moments of an exponential over one step.
#pragma once

#include "fracgyro/core/elementary.hpp"

#include <array>

namespace fracgyro {

// μ_k = ∫ x^k exp(-z x) dx over [0, 1], k = 0, 1, 2, for z > 0: by series where the recurrence would cancel.
inline std::array<double, 3> exponential_moments(double z) {
    std::array<double, 3> moments{};
    if (z < 1.0) {
        for (std::size_t power = 0; power < 3; ++power) {
            double term = 1.0;
            for (int n = 0; n < 24; ++n) {
                moments[power] += term / (static_cast<double>(power) + 1 + n);
                term *= -z / (n + 1);
            }
        }
    } else {
        const double end = exponential(-z);
        moments[0] = (1.0 - end) / z;
        moments[1] = (moments[0] - end) / z;
        moments[2] = (2.0 * moments[1] - end) / z;
    }
    return moments;
}

}  // namespace fracgyro
