// U diag(d) Uᵀ as a matrix, for any state with these factors.
#pragma once

#include "scalars.hpp"

namespace fracgyro::testing {

template <std::size_t Count, class State>
std::array<std::array<double, Count>, Count> product_of_factors(const State& state) {
    std::array<std::array<double, Count>, Count> u{}, p{};
    for (std::size_t j = 0; j < Count; ++j) {
        u[j][j] = 1.0;
        for (std::size_t i = 0; i < j; ++i) {
            u[i][j] = number(state.u_factor[j * (j - 1) / 2 + i]);
        }
    }
    for (std::size_t i = 0; i < Count; ++i) {
        for (std::size_t k = 0; k < Count; ++k) {
            for (std::size_t j = 0; j < Count; ++j) {
                p[i][k] += u[i][j] * number(state.d_factor[j]) * u[k][j];
            }
        }
    }
    return p;
}

}  // namespace fracgyro::testing
