// A factored covariance: P = U diag(d) Uᵀ with U unit upper triangular (Bierman, "Factorization methods for discrete
// sequential estimation", 1977). d stays positive in any precision, whereas P itself would lose its definiteness in
// single precision. No square roots.
#pragma once

#include "fracgyro/core/unrolled.hpp"

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
        T left = variance;
        for (std::size_t j = i; j > 0; --j) {
            T* const u = &state.u_factor[column(j)];
            const T before = state.d_factor[j], own = a[j];
            const T weight = left * own;
            const T d = maximum(before + weight * own, T(vanishing));
            const T share = weight / d;
            for (std::size_t k = 0; k < j; ++k) {
                share_out(a[k], u[k], own, share);
            }
            left = left * (before / d);
            state.d_factor[j] = d;
        }
        state.d_factor[0] = state.d_factor[0] + left * (a[0] * a[0]);
    }
    // The same in parts: columns i to 1, then the first. `share` is 1 for i and 0 for those before.
    struct Added {
        Vector share{};
        T left{};
    };
    template <std::size_t j>
    static void add_column(State& state, Added& added) {
        T* const u = &state.u_factor[column(j)];
        const T before = state.d_factor[j], own = added.share[j];
        const T weight = added.left * own;
        const T d = maximum(before + weight * own, T(vanishing));
        const T share = weight / d;
        unrolled<0, j>([&](std::size_t k) { share_out(added.share[k], u[k], own, share); });
        added.left = added.left * (before / d);
        state.d_factor[j] = d;
    }
    static void add_first(State& state, const Added& added) {
        state.d_factor[0] = state.d_factor[0] + added.left * (added.share[0] * added.share[0]);
    }

    // The same measurement in parts, for a filter that divides its work among steps: begin, absorb each column in turn
    // with its f, finish. Columns and rows known to the compiler, integral constants, have no loop.
    struct Running {
        Gain found{};
        T inverse{};       // 1/α
        T own{}, slope{};  // g_j, -f_j/α_(j-1)
    };
    static void begin(Running& running, T noise) {
        running = {.found = {.variance = noise}, .inverse = T(1.0) / noise};
    }
    static void open_column(const State& state, Running& running, std::size_t j, T f) {
        running.own = state.d_factor[j] * f;
        running.slope = -(f * running.inverse);
    }
    static void absorb_row(State& state, Running& running, std::size_t j, std::size_t k) {
        absorb(running.found.move[k], state.u_factor[column(j) + k], running.own, running.slope);
    }
    static void close_column(State& state, Running& running, std::size_t j, T f) {
        running.found.move[j] = running.own;
        const T before = running.found.variance;
        running.found.variance = before + f * running.own;
        running.inverse = T(1.0) / running.found.variance;
        state.d_factor[j] = state.d_factor[j] * (before * running.inverse);
    }
    static void finish(Running& running) {
        for (T& k : running.found.move) {
            k = running.inverse * k;
        }
    }

private:
    static void share_out(T& a, T& u, T own, T share) {
        a = a - own * u;
        u = u + share * a;
    }
    static void absorb(T& gain, T& u, T own, T slope) {
        const T old = u;
        u = old + slope * gain;
        gain = gain + old * own;
    }

    // f(j, column j of U); 0 below `first`. In variables of its own: a compiler for microcontrollers keeps these in
    // registers, and not those of `Running`.
    template <class F>
    static Gain measured(State& state, T noise, std::size_t first, F&& row) {
        Gain found{};
        Vector& gain = found.move;
        T variance = noise, inverse = T(1.0) / noise;
        for (std::size_t j = first; j < Count; ++j) {
            T* const u = &state.u_factor[column(j)];
            const T f = row(j, u);
            const T own = state.d_factor[j] * f;
            const T slope = -(f * inverse);
            for (std::size_t k = 0; k < j; ++k) {
                absorb(gain[k], u[k], own, slope);
            }
            gain[j] = own;
            const T before = variance;
            variance = before + f * own;
            inverse = T(1.0) / variance;
            state.d_factor[j] = state.d_factor[j] * (before * inverse);
        }
        for (T& k : gain) {
            k = inverse * k;
        }
        found.variance = variance;
        return found;
    }
};

}  // namespace fracgyro
