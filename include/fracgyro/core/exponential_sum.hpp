// The kernel of a fractional operator as a sum of exponentials.
#pragma once

#include "fracgyro/core/fields.hpp"

#include <array>

namespace fracgyro {

// Σ weights·exp(-poles·t) ≈ t^(-order)/Γ(1-order) on [step, longest time]; designed by kernel_design.hpp.
struct ExponentialSum {
    static constexpr std::size_t capacity = 64;
    std::size_t count = 0;  // 0 when order is 0 or 1
    double order = 1.0;
    double gamma = 1.0;  // Γ(2-order)
    double error = 0.0;  // maximum relative error of the sum; 0: unknown
    std::array<double, capacity> poles{}, weights{};

    static constexpr auto fields() {
        using S = ExponentialSum;
        return Fields{
            settable(Settable::beforehand,
                     field("order", &S::order, "1", {.low = 0.0, .high = 1.0},
                           "alpha, 0 to 1, no unit: order of D^alpha e. 1.0: off, the integer surface.")),
            settable(Settable::never, field("order_gamma", &S::gamma, "1", any_number, "Gamma(2 - alpha).")),
            settable(Settable::never, field("kernel_terms", &S::count, "1", at_least_0, "Exponentials in use.")),
            settable(Settable::never,
                     field("kernel_error", &S::error, "1", at_least_0, "Their largest relative error.")),
        };
    }
};

// Pads an ExponentialSum to `count` exponentials with weight 0: the sum is the same.
inline void fill_up(ExponentialSum& kernel, std::size_t count) {
    for (; kernel.count < count; ++kernel.count) {
        kernel.poles[kernel.count] = kernel.poles[kernel.count - 1];
        kernel.weights[kernel.count] = 0.0;
    }
}

}  // namespace fracgyro
