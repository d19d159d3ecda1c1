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
// History, all older than h: k(t) = Σ w_j exp(-s_j t) to the tolerance of the mode design. One state per mode and axis,
//     E_j(t_n) = e(0) exp(-s_j t_n) + ∫ exp(-s_j (t_n-τ)) ė(τ) dτ over [0, t_n],   r_j = exp(-s_j h),
//     E_j(t_n) = r_j E_j(t_{n-1}) + A_j v₀ + B_j v₁ + C_j κ    exactly, for the Hermite interpolant,
// the memory of ė with e(0) as the jump that it is from rest. It serves both operators, as ∫ exp(-s(t-τ)) e dτ = (e - E)/s:
//     derivative history at t_{n+1}:  Σ w_j r_j E_j(t_n)     Riemann-Liouville; less e(0) Σ w_j exp(-s_j t_{n+1}): Caputo
//     integral history at t_{n+1}:    Σ (w_j r_j/s_j) (e(t_n) - E_j(t_n)).
// What is stored is g_j = E_j - B_j v_n - C_j κ_n, whose recursion needs only the sample before,
//     g_j(n) = r_j g_j(n-1) + (A_j + r_j B_j) v_{n-1} + r_j C_j κ_{n-1},
// so the sum over the modes runs beside the control law instead of ahead of it.
//
// The Riemann-Liouville derivative of the jump, e(0) t^(-α)/Γ(1-α), falls steeply at first. The force that answers it is
// held for a step, so its mean over the coming step is taken: exp(-s t) becomes μ exp(-s t), μ = ∫ exp(-s x h) dx over [0, 1].
//
// α = 1 and α = 0 use no modes and are exact: D^1 e = ė, I^0 e = e; D^0 e = e (eq. (7)), I^1 e the Hermite quadrature.
#pragma once

#include "math.hpp"

#include <array>

namespace fracgyro {

// Σ weights·exp(-rates·t) ≈ t^(-order)/Γ(1-order) on [step, longest time]; designed in python/fracgyro/modes.py.
struct Modes {
    static constexpr std::size_t capacity = 64;
    std::size_t count = 0;  // 0 when order is 0 or 1
    double order = 1.0;
    double gamma = 1.0;  // Γ(2-order)
    std::array<double, capacity> rates{}, weights{};
};

// A signal at one sample.
template <Scalar T>
struct Sample {
    Vec2<T> value{}, rate{};
};

template <Scalar T>
struct FractionalOutput {
    Vec2<T> integral{}, derivative{};
};

template <Scalar T>
struct TwoModes {
    struct PerMode {
        T first{}, second{};
    };
    struct Memory {
        Vec2<T> first{}, second{};
        friend constexpr Memory operator+(const Memory& a, const Memory& b) {
            return {a.first + b.first, a.second + b.second};
        }
    };
    using Input = Vec2<T>;  // the same for both modes
    static Input input(const Vec2<T>& a) { return a; }
    static Memory scaled(const PerMode& c, const Memory& m) { return {c.first * m.first, c.second * m.second}; }
    static Memory scaled(const PerMode& c, const Input& a) { return {c.first * a, c.second * a}; }
    static Vec2<T> sum(const Memory& m) { return m.first + m.second; }
    static void set(PerMode& c, std::size_t mode, double value) { (mode == 0 ? c.first : c.second) = T(value); }
};
template <Scalar T>
    requires std::floating_point<T>
struct TwoModes<T> {
    using Memory = typename PackOf<T, 4>::Type;
    using PerMode = Memory;
    using Input = Memory;
    static Input input(const Vec2<T>& a) { return Input{a.x, a.y, a.x, a.y}; }
    static Memory scaled(const PerMode& c, const Memory& m) { return c * m; }
    static Vec2<T> sum(const Memory& m) { return {m[0] + m[2], m[1] + m[3]}; }
    static void set(PerMode& c, std::size_t mode, double value) { c[2 * mode] = c[2 * mode + 1] = T(value); }
};

// Capacity: room for modes; a multiple of 4.
template <Scalar T, std::size_t Capacity = Modes::capacity>
struct Fractional {
    static_assert(Capacity % 4 == 0);
    // Two modes at a time, which fixes the order of all additions. For a built-in number their memory, x, y of one and x, y
    // of the next, is one register, and so is a coefficient of both; any other number stands alone.
    using Two = TwoModes<T>;
    using Memory = typename Two::Memory;
    using PerMode = typename Two::PerMode;
    using Quad = typename PackOf<T, 4>::Type;  // four modes
    template <class Packed, std::size_t Modes>
    using All = std::array<Packed, Capacity / Modes>;

    // One output is  value·e + difference·(e - e_past) + rate·ė  of the newest sample, plus what was known before it came:
    // past_value·e_past + past_rate·ė_past + past_bump·κ_past + Σ over the modes.
    struct Weights {
        T value{}, difference{}, rate{}, past_value{}, past_rate{}, past_bump{};
    };

    struct Coefficients {
        T inverse_step{};
        T carry{};       // 1 for α = 0, where the integral continues the previous one; else 0
        T onset_mean{};  // mean of t^(-α)/Γ(1-α) over the first hold, where it is singular; 0 for Caputo
        T start_value{}, start_rate{}, start_integral{};  // outputs at t = 0: non-zero only for α = 0 or 1
        Weights integral{}, derivative{};
        std::size_t pairs = 0, quads = 0;  // packs in use; padded with zero weights
        // Of two modes. The states carry their output weight w r, so that the derivative is their plain sum.
        struct Pair {
            PerMode decay{};         // r - 1
            PerMode from_rate{};     // w r (A + r B)
            PerMode from_bump{};     // w r r C
            PerMode inverse_rate{};  // 1/s: from derivative to integral
        };
        All<Pair, 2> pair{};
        All<PerMode, 2> initial_value{}, initial_rate{};  // w r and w r B: g at the first sample
        // What the jump e(0) adds to the derivative beyond E: w r (μ - 1), for Caputo -w r.
        All<Quad, 4> initial_onset{}, onset_decay{};
        std::array<T, Capacity / 4> onset_life{};  // steps after which this quad and the later ones are past
    };

    struct State {
        std::int64_t steps = 0;  // samples seen
        std::size_t onset_quads = 0;
        Vec2<T> initial_value{};
        Sample<T> past{};
        Vec2<T> past_bump{};
        FractionalOutput<T> last{}, known{};  // the last outputs; what is known of the next ones
        All<Memory, 2> memory{};              // w r g
        All<Quad, 4> onset{};
    };

    static Coefficients prepare(const Modes& modes, double step, bool riemann_liouville);

    // The outputs at the next sample; then on to the one after. Samples come at multiples of the step of `c`.
    static FractionalOutput<T> update(State& state, const Coefficients& c, const Sample<T>& now) {
        const FractionalOutput<T> output = evaluate(state, c, now);
        advance(state, c, now);
        return output;
    }

    // The first half of `update`: all that the control law waits for.
    static FractionalOutput<T> evaluate(State& state, const Coefficients& c, const Sample<T>& now) {
        if (state.steps == 0) {
            state.last = {.integral = c.start_integral * now.value,
                          .derivative = (c.start_value + c.onset_mean) * now.value + c.start_rate * now.rate};
            return state.last;
        }
        const Vec2<T> difference = now.value - state.past.value;
        const auto output = [&](const Weights& w, const Vec2<T>& known) {
            return (w.difference * difference + w.rate * now.rate) + (w.value * now.value + known);
        };
        state.last = {.integral = output(c.integral, state.known.integral),
                      .derivative = output(c.derivative, state.known.derivative)};
        return state.last;
    }

    // The second half: moves the modes to the sample before the next one, from what was known a sample ago, and sums
    // them for its outputs.
    static void advance(State& state, const Coefficients& c, const Sample<T>& now) {
        Memory derivative{}, integral{};
        const auto add = [&](std::size_t j, const Memory& moved) {
            state.memory[j] = moved;
            derivative = derivative + moved;
            integral = integral + Two::scaled(c.pair[j].inverse_rate, moved);
        };
        Vec2<T> newest{};  // κ of the interval that ends now; there is none before the first sample
        if (state.steps == 0) {
            state.initial_value = now.value;
            const auto value = Two::input(now.value), rate = Two::input(-now.rate);
            for (std::size_t j = 0; j < c.pairs; ++j) {
                add(j, Two::scaled(c.initial_value[j], value) + Two::scaled(c.initial_rate[j], rate));
            }
            state.onset_quads = c.quads;
            state.onset = c.initial_onset;
        } else {
            const Vec2<T> trace{T(vanishing), T(vanishing)};
            const auto rate = Two::input(state.past.rate + trace), bump = Two::input(state.past_bump);
            for (std::size_t j = 0; j < c.pairs; ++j) {
                // The increment is formed first: r itself would round to 1 for slow modes in single precision.
                const Memory& g = state.memory[j];
                const auto& [decay, from_rate, from_bump, inverse_rate] = c.pair[j];
                const Memory gain = Two::scaled(from_rate, rate) + Two::scaled(from_bump, bump);
                add(j, g + (Two::scaled(decay, g) + gain));
            }
            newest = c.inverse_step * (now.value - state.past.value) - T(0.5) * (now.rate + state.past.rate);
        }
        const auto known = [&](const Weights& w) {
            return w.past_value * now.value + w.past_rate * now.rate + w.past_bump * newest;
        };
        state.known.derivative = known(c.derivative) + Two::sum(derivative);
        state.known.integral = known(c.integral) - Two::sum(integral) + c.carry * state.last.integral;
        if (state.onset_quads > 0) {
            state.known.derivative = state.known.derivative + onset(state, c) * state.initial_value;
        }
        ++state.steps;
        state.past = now;
        state.past_bump = newest;
    }

private:
    // Less than the rounding of any number that matters. Without it, what decays for ever would become subnormal, which slows
    // processors down.
    static constexpr double vanishing = std::same_as<detail::Built<T>, float> ? 1e-24 : 1e-290;

    static T onset(State& state, const Coefficients& c) {
        Quad sum{}, trace{};
        for (std::size_t k = 0; k < 4; ++k) {
            trace[k] = T(vanishing);
        }
        for (std::size_t j = 0; j < state.onset_quads; ++j) {
            sum = sum + state.onset[j];
            state.onset[j] = state.onset[j] + (c.onset_decay[j] * state.onset[j] + trace);
        }
        while (state.onset_quads > 0 &&
               always_less(c.onset_life[state.onset_quads - 1], T(static_cast<double>(state.steps)))) {
            --state.onset_quads;
        }
        return (sum[0] + sum[2]) + (sum[1] + sum[3]);
    }
};

// All in double, whatever T: coefficients are derived once.
template <Scalar T, std::size_t Capacity>
typename Fractional<T, Capacity>::Coefficients Fractional<T, Capacity>::prepare(const Modes& modes, double step,
                                                                                bool riemann_liouville) {
    Coefficients c;
    c.inverse_step = T(1.0 / step);
    if (modes.order == 1.0) {
        c.start_rate = c.start_integral = c.integral.value = c.derivative.rate = T(1.0);
        return c;
    }
    const double nu = 1.0 - modes.order;
    const double scale = power(step, nu) / modes.gamma;
    const bool integer_order = modes.order == 0.0;
    // Sums over the modes of what one unit of rate or bump leaves in E, times the output weights.
    double rate_to_derivative = 0.0, bump_to_derivative = 0.0, rate_to_integral = 0.0, bump_to_integral = 0.0;
    double value_to_integral = 0.0;
    for (std::size_t i = 0; i < modes.count; ++i) {
        const double s = modes.rates[i];
        const double z = s * step;
        // Moments μ_k = ∫ x^k exp(-z x) dx over [0, 1]: by series where the recurrence would cancel.
        double moments[3] = {};
        if (z < 1.0) {
            for (int power = 0; power < 3; ++power) {
                double term = 1.0;
                for (int n = 0; n < 24; ++n) {
                    moments[power] += term / (power + 1 + n);
                    term *= -z / (n + 1);
                }
            }
        } else {
            const double end = exponential(-z);
            moments[0] = (1.0 - end) / z;
            moments[1] = (moments[0] - end) / z;
            moments[2] = (2.0 * moments[1] - end) / z;
        }
        const double decay = -z * moments[0];  // r - 1
        const double r = 1.0 + decay;
        const double a = step * moments[1];
        const double b = step * (moments[0] - moments[1]);
        const double bump = 6.0 * step * (moments[1] - moments[2]);
        const double to_derivative = modes.weights[i] * r;
        const double to_integral = to_derivative / s;
        Two::set(c.pair[i / 2].decay, i % 2, decay);
        Two::set(c.pair[i / 2].from_rate, i % 2, to_derivative * (a + r * b));
        Two::set(c.pair[i / 2].from_bump, i % 2, to_derivative * (r * bump));
        Two::set(c.pair[i / 2].inverse_rate, i % 2, 1.0 / s);
        Two::set(c.initial_value[i / 2], i % 2, to_derivative);
        Two::set(c.initial_rate[i / 2], i % 2, to_derivative * b);
        c.onset_decay[i / 4][i % 4] = T(decay);
        c.initial_onset[i / 4][i % 4] = T(to_derivative * (riemann_liouville ? moments[0] - 1.0 : -1.0));
        // Until exp(-s t) is 2^-60, below rounding.
        for (std::size_t j = 0; j <= i / 4; ++j) {
            c.onset_life[j] = maximum(c.onset_life[j], T(41.6 / z));
        }
        rate_to_derivative += to_derivative * b;
        bump_to_derivative += to_derivative * bump;
        rate_to_integral += to_integral * b;
        bump_to_integral += to_integral * bump;
        value_to_integral += to_integral;
    }
    c.pairs = (modes.count + 1) / 2;
    c.quads = (modes.count + 3) / 4;
    // The weight of κ is spread over the differences that make it up.
    const auto weights = [&](double rate, double bump, double past_value, double past_rate, double past_bump) {
        return Weights{.value = T(0.0),
                       .difference = T(bump / step),
                       .rate = T(rate - 0.5 * bump),
                       .past_value = T(past_value),
                       .past_rate = T(past_rate - 0.5 * bump),
                       .past_bump = T(past_bump)};
    };
    c.integral = weights(scale * step / ((nu + 1.0) * (nu + 2.0)), 6.0 * scale * step / ((nu + 2.0) * (nu + 3.0)),
                         scale + value_to_integral, scale * step / (nu + 2.0) - rate_to_integral, -bump_to_integral);
    if (integer_order) {
        c.carry = c.start_value = c.derivative.value = T(1.0);
        return c;
    }
    c.derivative = weights(scale / (nu + 1.0), 6.0 * nu * scale / ((nu + 1.0) * (nu + 2.0)), 0.0,
                           nu * scale / (nu + 1.0) + rate_to_derivative, bump_to_derivative);
    c.onset_mean = T(riemann_liouville ? scale / step : 0.0);
    return c;
}

}  // namespace fracgyro
