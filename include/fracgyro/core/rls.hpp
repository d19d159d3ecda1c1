// Recursive least squares in fixed memory: the x that minimizes the sum of squares of the residuals r = y + row·x and
// of x itself, weighted by the prior.
//
//    P = (1/prior + Σ rowᵀ row)⁻¹ is kept as U diag(d) Uᵀ with U unit upper triangular (Bierman 1977, ch. V): d stays
//    positive in any precision, whereas P itself would lose its definiteness in single precision. No square roots.
//
//        f = Uᵀ rowᵀ,   g_j = d_j f_j,   α_j = α_(j-1) + f_j g_j from α_0 = 1 to α = 1 + row P rowᵀ
//        d_j  <- d_j α_(j-1)/α_j
//        U_ij <- U_ij - k_i f_j/α_(j-1),   k_i <- k_i + U_ij g_j with the old U_ij, for i < j;   k_j = g_j
//        x    <- x - (k/α) r
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>

namespace fracgyro {

template <Scalar T, std::size_t Count>
struct RecursiveLeastSquares {
    using Row = std::array<T, Count>;

    // Variance of every parameter about 0 before the first row, for noise of variance 1 in y. Practically
    // uninformative: one row of size 0.01 weighs as much.
    static constexpr double prior = 1e4;

    struct State {
        Row value{};                                      // x
        Row d_factor = filled(T(prior));                  // d
        std::array<T, Count*(Count - 1) / 2> u_factor{};  // U above its diagonal, column by column
    };

    // Adds one row and its residual, found with x as it is. Returns 1/α, the share of the residual that remains
    // afterwards. The expected square of residual/√α is the variance of the noise.
    static T update(State& state, const Row& row, T residual) {
        Row gain{};
        T alpha = T(1.0), inverse = T(1.0);
        std::size_t column = 0;
        for (std::size_t j = 0; j < Count; column += j++) {
            T f = row[j];
            for (std::size_t i = 0; i < j; ++i) {
                f = f + state.u_factor[column + i] * row[i];
            }
            const T g = state.d_factor[j] * f;
            const T slope = -(f * inverse);
            for (std::size_t i = 0; i < j; ++i) {
                T& u = state.u_factor[column + i];
                const T old = u;
                u = old + slope * gain[i];
                gain[i] = gain[i] + old * g;
            }
            gain[j] = g;
            const T before = alpha;
            alpha = before + f * g;
            inverse = T(1.0) / alpha;
            state.d_factor[j] = state.d_factor[j] * (before * inverse);
        }
        const T move = inverse * residual;
        for (std::size_t j = 0; j < Count; ++j) {
            state.value[j] = state.value[j] - move * gain[j];
        }
        return inverse;
    }

    // P_ii; times the variance of the noise it is the variance of x_i.
    static T variance(const State& state, std::size_t i) {
        T sum = state.d_factor[i];
        for (std::size_t j = i + 1; j < Count; ++j) {
            const T u = state.u_factor[j * (j - 1) / 2 + i];
            sum = sum + u * u * state.d_factor[j];
        }
        return sum;
    }

    // Multiplies every variance by this factor: all parameters are forgotten evenly.
    static void inflate(State& state, T factor) {
        for (T& d : state.d_factor) {
            d = factor * d;
        }
    }
    // Adds `variance` to P_00 only, when x_0 has moved. The first column of U is the first one of the identity.
    static void inflate_first(State& state, T variance) { state.d_factor[0] = state.d_factor[0] + variance; }

private:
    static constexpr Row filled(T a) {
        Row row{};
        row.fill(a);
        return row;
    }
};

}  // namespace fracgyro
