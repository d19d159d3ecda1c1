// The fractional operator: I^(1-α) of a signal and of its rate, in fixed memory, one sample at a time.
//
// Both the value e and the rate ė are measured, so between two samples the signal is its cubic Hermite interpolant.
// With ν = 1-α, kernel k(t) = t^(ν-1)/Γ(ν) and t_n = n h this file computes
//
//     integral    I^ν e (t_n)  = D^(α-1) e                 the term of the surface, eq. (16)
//     derivative  I^ν ė (t_n)  = Caputo D^α e, eq. (7)     the term of the control law, eq. (18)
//
// Local part, the last interval, with the true kernel. x in [0, 1] counts steps back from t_n; on the interval
//     ė = v₀ x + v₁ (1-x) + 6 κ x (1-x),     κ = (e₁-e₀)/h - (v₀+v₁)/2,
// and all integrals of x^(ν-1) times a polynomial are elementary: with S = h^ν/Γ(1+ν)
//     ∫ k ė = S [ ν/(ν+1) v₀ + 1/(ν+1) v₁ + 6ν/((ν+1)(ν+2)) κ ]
//     ∫ k e = S e₀ + S h [ v₀/(ν+2) + v₁/((ν+1)(ν+2)) + 6 κ/((ν+2)(ν+3)) ]        (by parts)
//
// History, all older than h: k(t) = Σ w_j exp(-s_j t) to the tolerance of the kernel design. With one state per
// exponential and axis,
//     E_j(t_n) = e(0) exp(-s_j t_n) + ∫ exp(-s_j (t_n-τ)) ė(τ) dτ over [0, t_n],   r_j = exp(-s_j h),
//     E_j(t_n) = r_j E_j(t_{n-1}) + A_j v₀ + B_j v₁ + C_j κ    exactly, for the Hermite interpolant,
// the memory of ė with e(0) as the jump that it is from rest. It serves both operators, as
// ∫ exp(-s(t-τ)) e dτ = (e - E)/s:
//     derivative history at t_{n+1}:  Σ w_j r_j E_j(t_n)   Riemann-Liouville; less e(0) Σ w_j exp(-s_j t_{n+1}): Caputo
//     integral history at t_{n+1}:    Σ (w_j r_j/s_j) (e(t_n) - E_j(t_n)).
// The stored state is g_j = (E_j - B_j v_n - C_j κ_n)/(A_j + r_j B_j), whose recursion needs only the sample before,
//     g_j(n) = r_j g_j(n-1) + v_{n-1} + ρ_j κ_{n-1},     ρ_j = r_j C_j/(A_j + r_j B_j),
// so the sum over the exponentials runs alongside the control law instead of ahead of it.
//
// The Riemann-Liouville derivative of the jump, e(0) t^(-α)/Γ(1-α), falls steeply at first. The force that responds to
// it is held for a step, so its mean over the coming step is used: exp(-s t) becomes μ exp(-s t), μ = ∫ exp(-s x h) dx
// over [0, 1].
//
// α = 1 and α = 0 use no exponentials and are exact: D^1 e = ė, I^0 e = e; D^0 e = e (eq. (7)), I^1 e the Hermite
// quadrature.
#pragma once

#include "fracgyro/core/exponential_sum.hpp"
#include "fracgyro/core/linear.hpp"
#include "fracgyro/core/moments.hpp"
#include "fracgyro/core/saved.hpp"

#include <array>

namespace fracgyro {

template <Scalar T>
struct FractionalOutput {
    Vec2<T> integral{}, derivative{};
};

// Two exponentials at a time, x and y of each: for a built-in number all four in one register if the processor has such
// registers, else each on its own.
template <Scalar T>
struct TwoTerms {
    static constexpr std::size_t terms = 2, axes = 2;  // handled one by one
    using Memory = std::array<T, 4>;
    using PerTerm = std::array<T, 2>;
    using Part = T;
    static Memory both(const Vec2<T>& a) { return {a.x(), a.y(), a.x(), a.y()}; }
    static T& part(Memory& m, std::size_t term, std::size_t axis) { return m[2 * term + axis]; }
    static const T& part(const PerTerm& c, std::size_t term) { return c[term]; }
    static T& part(PerTerm& c, std::size_t term) { return c[term]; }
    static void set(PerTerm& c, std::size_t term, double value) { c[term] = T(value); }
    static T sum(const PerTerm& c) { return c[0] + c[1]; }
};
template <Scalar T>
    requires(std::floating_point<T> && FRACGYRO_PACKS)
struct TwoTerms<T> {
    static constexpr std::size_t terms = 1, axes = 1;
    using Memory = typename PackOf<T, 4>::Type;
    using PerTerm = Memory;
    using Part = Memory;
    static Memory both(const Vec2<T>& a) { return Memory{a.x(), a.y(), a.x(), a.y()}; }
    static Memory& part(Memory& m, std::size_t /*term*/, std::size_t /*axis*/) { return m; }
    static const Memory& part(const PerTerm& c, std::size_t /*term*/) { return c; }
    static Memory& part(PerTerm& c, std::size_t /*term*/) { return c; }
    static void set(PerTerm& c, std::size_t term, double value) { c[2 * term] = c[2 * term + 1] = T(value); }
    static T sum(const PerTerm& c) { return c[0] + c[2]; }
};

// Capacity: room for exponentials; even.
template <Scalar T, std::size_t Capacity = ExponentialSum::capacity>
struct Fractional {
    static_assert(Capacity % 2 == 0);
    // Two exponentials at a time, which fixes the order of all additions. For a built-in number their memory, x, y of
    // one and x, y of the next, is one register, and so is a coefficient of both; any other number is separate.
    using Two = TwoTerms<T>;
    using Memory = typename Two::Memory;
    using PerTerm = typename Two::PerTerm;
    using Part = typename Two::Part;
    template <class OfTwo>
    using All = std::array<OfTwo, Capacity / 2>;

    // One output is  difference·(e - e_past) + rate·ė  of the newest sample, plus the part known before that sample:
    // past_derivative·ė_past + past_bump·κ_past + Σ over the exponentials.
    struct Weights {
        T difference{}, rate{}, past_derivative{}, past_bump{};
    };

    struct Coefficients {
        T inverse_step{};
        T onset_mean{};  // mean of t^(-α)/Γ(1-α) over the first hold, where it is singular; 0 for Caputo
        Weights integral{}, derivative{};
        T integral_past_value{};  // weight of e_past
        // Without exponentials, α = 0 or 1: shares of e and ė themselves, and of the previous integral, which the
        // integral of α = 0 continues.
        T integral_value{}, derivative_value{}, derivative_rate{}, carry{};
        std::size_t pairs = 0;  // in use; padded with zero weights
        // Two exponentials.
        struct Pair {
            PerTerm decay{};          // r - 1
            PerTerm from_bump{};      // ρ
            PerTerm to_derivative{};  // w r (A + r B)
            PerTerm to_integral{};    // w r (A + r B)/s
        };
        All<Pair> pair{};
        All<PerTerm> initial_value{}, initial_rate{};  // 1/(A + r B) and B/(A + r B): g at the first sample
        // Contribution of the jump e(0) to the derivative beyond E: w r (μ - 1), for Caputo -w r.
        All<PerTerm> initial_onset{};
        All<T> onset_life{};  // steps after which this pair and the later ones have decayed
    };

    struct State {
        Kept<T, bool> started = false;
        Kept<T, std::size_t> onset_pairs = 0;
        T onset_age{};  // samples seen while any are left
        Vec2<T> initial_value{};
        Sample<T> past{};
        Vec2<T> past_bump{};
        FractionalOutput<T> known{};  // known part of the next sample's output
        Vec2<T> integral{};           // the last one, for α = 0
        All<Memory> memory{};         // g
        All<PerTerm> onset{};
    };

    static Coefficients prepare(const ExponentialSum& kernel, double step, bool riemann_liouville);

    static bool sound(const State& state, const Coefficients& c) {
        return fracgyro::sound(state.started) && state.onset_pairs <= c.pairs;
    }

    // Returns the outputs at the next sample, then advances. Samples are at multiples of the step of `c`.
    static FractionalOutput<T> update(State& state, const Coefficients& c, const Sample<T>& now) {
        const FractionalOutput<T> output = evaluate(state, c, now);
        advance(state, c, now);
        return output;
    }

    // The first half of `update`: only the part needed by the control law.
    static FractionalOutput<T> evaluate(State& state, const Coefficients& c, const Sample<T>& now) {
        if (!state.started) {
            return {.integral = c.integral_value * now.value,
                    .derivative = (c.derivative_value + c.onset_mean) * now.value + c.derivative_rate * now.derivative};
        }
        const Vec2<T> difference = now.value - state.past.value;
        const auto output = [&](const Weights& w, const Vec2<T>& known) {
            return (w.difference * difference + w.rate * now.derivative) + known;
        };
        const Vec2<T> integral = output(c.integral, state.known.integral);
        if (c.pairs == 0) {
            state.integral = integral + c.integral_value * now.value;
            return {.integral = state.integral,
                    .derivative = c.derivative_value * now.value + c.derivative_rate * now.derivative};
        }
        return {.integral = integral, .derivative = output(c.derivative, state.known.derivative)};
    }

    // The second half: moves the exponentials to the sample before the next one, from values known a sample ago, and
    // sums them for its outputs.
    static void advance(State& state, const Coefficients& c, const Sample<T>& now) {
        Memory derivative{}, integral{};
        // Calls next(pair, term, its coefficients, a, b, g), which returns the new g, for all memory, and sums it.
        const auto move = [&](Memory a, Memory b, auto&& next) {
            for (std::size_t j = 0; j < c.pairs; ++j) {
#pragma GCC unroll 2
                for (std::size_t m = 0; m < Two::terms; ++m) {
                    // Copies: the compiler cannot know that storing memory does not change coefficients.
                    const Part decay = Two::part(c.pair[j].decay, m), from_bump = Two::part(c.pair[j].from_bump, m);
                    const Part to_derivative = Two::part(c.pair[j].to_derivative, m);
                    const Part to_integral = Two::part(c.pair[j].to_integral, m);
#pragma GCC unroll 2
                    for (std::size_t axis = 0; axis < Two::axes; ++axis) {
                        Part g = Two::part(state.memory[j], m, axis);
                        g = next(j, m, decay, from_bump, Two::part(a, m, axis), Two::part(b, m, axis), g);
                        Two::part(state.memory[j], m, axis) = g;
                        Part& d = Two::part(derivative, m, axis);
                        d = d + to_derivative * g;
                        Part& i = Two::part(integral, m, axis);
                        i = i + to_integral * g;
                    }
                }
            }
        };
        Vec2<T> newest{};  // κ of the interval that ends now; none before the first sample
        if (!state.started) {
            state.initial_value = now.value;
            move(Two::both(now.value), Two::both(-now.derivative),
                 [&](auto j, auto m, const Part&, const Part&, const Part& value, const Part& rate, const Part&) {
                     return Two::part(c.initial_value[j], m) * value + Two::part(c.initial_rate[j], m) * rate;
                 });
            state.onset_pairs = c.pairs;
            state.onset = c.initial_onset;
        } else {
            const Vec2<T> trace{T(detail::vanishing<T>), T(detail::vanishing<T>)};
            move(Two::both(state.past.derivative + trace), Two::both(state.past_bump),
                 [](auto, auto, const Part& decay, const Part& from_bump, const Part& rate, const Part& bump,
                    const Part& g) { return moved(g, decay, from_bump * bump + rate); });
            newest =
                c.inverse_step * (now.value - state.past.value) - T(0.5) * (now.derivative + state.past.derivative);
        }
        const auto known = [&](const Weights& w) { return w.past_derivative * now.derivative + w.past_bump * newest; };
        state.known.derivative = known(c.derivative) + sum(derivative);
        state.known.integral = (known(c.integral) + c.integral_past_value * now.value) - sum(integral);
        if (c.pairs == 0) {
            state.known.integral = state.known.integral + c.carry * state.integral;
        }
        if (state.onset_pairs > 0) {
            state.known.derivative = state.known.derivative + onset(state, c) * state.initial_value;
        }
        state.started = true;
        state.past = now;
        state.past_bump = newest;
    }

private:
    // One step of decay and gain. The increment is formed first: r itself would be rounded, for slow exponentials to 1.
    template <class Packed>
    static Packed moved(const Packed& a, const Packed& decay, const Packed& gain) {
        return a + (decay * a + gain);
    }

    static Vec2<T> sum(const Memory& m) { return {m[0] + m[2], m[1] + m[3]}; }

    static T onset(State& state, const Coefficients& c) {
        const Part trace = Part{} + T(detail::vanishing<T>);
        PerTerm sum{};
        for (std::size_t j = 0; j < state.onset_pairs; ++j) {
#pragma GCC unroll 2
            for (std::size_t m = 0; m < Two::terms; ++m) {
                const Part onset = Two::part(state.onset[j], m), decay = Two::part(c.pair[j].decay, m);
                Part& part = Two::part(sum, m);
                part = part + onset;
                Two::part(state.onset[j], m) = moved(onset, decay, trace);
            }
        }
        const T age = state.onset_age;
        state.onset_age = age + T(1.0);
        while (state.onset_pairs > 0 && always_less(c.onset_life[state.onset_pairs - 1], state.onset_age)) {
            --state.onset_pairs;
        }
        return if_less(c.onset_life[0], age, T(0.0), Two::sum(sum));  // each of several runs ends at its own time
    }
};

// Computed in double, whatever T: coefficients are derived once.
template <Scalar T, std::size_t Capacity>
typename Fractional<T, Capacity>::Coefficients Fractional<T, Capacity>::prepare(const ExponentialSum& kernel,
                                                                                double step, bool riemann_liouville) {
    Coefficients c;
    c.inverse_step = T(1.0 / step);
    if (kernel.order == 1.0) {
        c.integral_value = c.derivative_rate = T(1.0);
        return c;
    }
    const double nu = 1.0 - kernel.order;
    const double scale = power(step, nu) / kernel.gamma;
    const bool integer_order = kernel.order == 0.0;
    // Sums over the exponentials of the effect of one unit of rate or bump on E, times the output weights.
    double rate_to_derivative = 0.0, bump_to_derivative = 0.0, rate_to_integral = 0.0, bump_to_integral = 0.0;
    double value_to_integral = 0.0;
    for (std::size_t i = 0; i < kernel.count; ++i) {
        const double s = kernel.poles[i];
        const double z = s * step;
        const std::array<double, 3> moments = exponential_moments(z);
        const double decay = -z * moments[0];  // r - 1
        const double r = 1.0 + decay;
        const double a = step * moments[1];
        const double b = step * (moments[0] - moments[1]);
        const double bump = 6.0 * step * (moments[1] - moments[2]);
        const double to_derivative = kernel.weights[i] * r;
        const double to_integral = to_derivative / s;
        const double unit = a + r * b;  // unit of the memory
        Two::set(c.pair[i / 2].decay, i % 2, decay);
        Two::set(c.pair[i / 2].from_bump, i % 2, r * bump / unit);
        Two::set(c.pair[i / 2].to_derivative, i % 2, to_derivative * unit);
        Two::set(c.pair[i / 2].to_integral, i % 2, to_integral * unit);
        Two::set(c.initial_value[i / 2], i % 2, 1.0 / unit);
        Two::set(c.initial_rate[i / 2], i % 2, b / unit);
        Two::set(c.initial_onset[i / 2], i % 2, to_derivative * (riemann_liouville ? moments[0] - 1.0 : -1.0));
        // Ends when exp(-s t) is 2^-60, below rounding; and not after the mean differs from the value by less than the
        // sum over the exponentials may differ from the kernel at h, where the kernel is largest. As k is convex, the
        // mean over the hold from t = n h on is at most h/2 |k'(t)| = α/(2 n) k(n h) = α/2 n^(-1-α) k(h) below k(t).
        // This is below error·k(h) from n = (α/(2 error))^(1/(1+α)) on.
        const bool bounded = riemann_liouville && kernel.error > 0.0;
        const double end = bounded ? power(0.5 * kernel.order / kernel.error, 1.0 / (1.0 + kernel.order))
                                   : std::numeric_limits<double>::infinity();
        for (std::size_t j = 0; j <= i / 2; ++j) {
            c.onset_life[j] = maximum(c.onset_life[j], T(minimum(41.6 / z, end)));
        }
        rate_to_derivative += to_derivative * b;
        bump_to_derivative += to_derivative * bump;
        rate_to_integral += to_integral * b;
        bump_to_integral += to_integral * bump;
        value_to_integral += to_integral;
    }
    c.pairs = (kernel.count + 1) / 2;
    // Spreads the weight of κ over its differences.
    const auto weights = [&](double rate, double bump, double past_derivative, double past_bump) {
        return Weights{.difference = T(bump / step),
                       .rate = T(rate - 0.5 * bump),
                       .past_derivative = T(past_derivative - 0.5 * bump),
                       .past_bump = T(past_bump)};
    };
    c.integral = weights(scale * step / ((nu + 1.0) * (nu + 2.0)), 6.0 * scale * step / ((nu + 2.0) * (nu + 3.0)),
                         scale * step / (nu + 2.0) - rate_to_integral, -bump_to_integral);
    c.integral_past_value = T(scale + value_to_integral);
    if (integer_order) {
        c.carry = c.derivative_value = T(1.0);
        return c;
    }
    c.derivative = weights(scale / (nu + 1.0), 6.0 * nu * scale / ((nu + 1.0) * (nu + 2.0)),
                           nu * scale / (nu + 1.0) + rate_to_derivative, bump_to_derivative);
    c.onset_mean = T(riemann_liouville ? scale / step : 0.0);
    return c;
}

}  // namespace fracgyro
