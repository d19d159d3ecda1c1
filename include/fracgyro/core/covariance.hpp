// A factored covariance: P = U diag(d) Uᵀ with U unit upper triangular (Bierman, "Factorization methods for discrete
// sequential estimation", 1977). d stays positive in any precision, whereas P itself would lose its definiteness in
// single precision. No square roots.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>

namespace fracgyro {

template <Scalar T, std::size_t Count>
struct FactoredCovariance {
    using Vector = std::array<T, Count>;

    struct State {
        Vector d_factor{};                                // d
        std::array<T, Count*(Count - 1) / 2> u_factor{};  // U above its diagonal, column by column
    };

    // Divisor instead of 0, which d reaches only after absurdly large numbers.
    static constexpr double vanishing = 1e-30;

    // Start of column j: U_ij is u_factor[column(j) + i], i < j.
    static constexpr std::size_t column(std::size_t j) { return j * (j - 1) / 2; }

    // P_ii
    static T variance(const State& state, std::size_t i) {
        T sum = state.d_factor[i];
        for (std::size_t j = i + 1; j < Count; ++j) {
            const T u = state.u_factor[column(j) + i];
            sum = sum + u * u * state.d_factor[j];
        }
        return sum;
    }

    struct Gain {
        Vector move{};  // change of every component, for a residual of 1
        T variance{};   // variance of the residual
    };

    // Measurement of row·x, on the first components only, with this noise variance, > 0 (ch. V).
    //
    //     f = Uᵀ rowᵀ,   g_j = d_j f_j,   α_j = α_(j-1) + f_j g_j from α = noise to α = noise + row P rowᵀ
    //     d_j  <- d_j α_(j-1)/α_j
    //     U_kj <- U_kj - k_k f_j/α_(j-1),   k_k <- k_k + U_kj g_j with the old U_kj, for k < j;   k_j = g_j
    template <std::size_t Measured>
    static Gain measure(State& state, const std::array<T, Measured>& row, T noise) {
        return measured(state, noise, 0, [&](std::size_t j, const T* u) {
            T f = j < Measured ? row[j] : T(0.0);
            for (std::size_t k = 0; k < j && k < Measured; ++k) {
                f = f + row[k] * u[k];
            }
            return f;
        });
    }
    // Measurement of x_i.
    static Gain measure(State& state, std::size_t i, T noise) {
        return measured(state, noise, i, [&](std::size_t j, const T* u) { return j == i ? T(1.0) : u[i]; });
    }

    // Adds `variance` >= 0 to P_ii only (Agee and Turner; Bierman, ch. III).
    static void add(State& state, std::size_t i, T variance) {
        Vector a{};
        a[i] = T(1.0);
        T c = variance;
        for (std::size_t j = i; j > 0; --j) {
            const std::size_t begin = column(j);
            const T before = state.d_factor[j];
            const T weight = c * a[j];
            const T d = maximum(before + weight * a[j], T(vanishing));
            const T share = weight / d;
            for (std::size_t k = 0; k < j; ++k) {
                T& u = state.u_factor[begin + k];
                a[k] = a[k] - a[j] * u;
                u = u + share * a[k];
            }
            c = c * (before / d);
            state.d_factor[j] = d;
        }
        state.d_factor[0] = state.d_factor[0] + c * (a[0] * a[0]);
    }

private:
    // f(j, column j of U); 0 below `first`.
    template <class F>
    static Gain measured(State& state, T noise, std::size_t first, F&& row) {
        Gain found{};
        Vector& gain = found.move;
        T alpha = noise, inverse = T(1.0) / noise;
        for (std::size_t j = first; j < Count; ++j) {
            T* const u = &state.u_factor[column(j)];
            const T f = row(j, u);
            const T g = state.d_factor[j] * f;
            const T slope = -(f * inverse);
            for (std::size_t k = 0; k < j; ++k) {
                const T old = u[k];
                u[k] = old + slope * gain[k];
                gain[k] = gain[k] + old * g;
            }
            gain[j] = g;
            const T before = alpha;
            alpha = before + f * g;
            inverse = T(1.0) / alpha;
            state.d_factor[j] = state.d_factor[j] * (before * inverse);
        }
        for (T& k : gain) {
            k = inverse * k;
        }
        found.variance = alpha;
        return found;
    }
};

}  // namespace fracgyro
