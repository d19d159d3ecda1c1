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
//     E_j(t_n) = ∫ exp(-s_j (t_n-τ)) ė(τ) dτ over [0, t_n],   r_j = exp(-s_j h),
//     E_j(t_n) = r_j E_j(t_{n-1}) + A_j v₀ + B_j v₁ + C_j κ    exactly, for the Hermite interpolant,
// serves both operators, because ∫ exp(-s(t-τ)) e dτ = (e(t) - e(0) exp(-s t) - E(t))/s:
//     derivative history at t_{n+1}:  Σ w_j r_j E_j(t_n)
//     integral history at t_{n+1}:    Σ (w_j r_j/s_j) (e(t_n) - e(0) exp(-s_j t_n) - E_j(t_n)).
// What is stored is g_j = E_j - B_j v_n - C_j κ_n, whose recursion needs only the sample before,
//     g_j(n) = r_j g_j(n-1) + (A_j + r_j B_j) v_{n-1} + r_j C_j κ_{n-1},
// so the sum over the modes runs beside the control law instead of ahead of it.
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

// Capacity: room for modes; a multiple of 4.
template <Scalar T, std::size_t Capacity = Modes::capacity>
struct Fractional {
    // Modes go through vector registers in packs of four numbers, which fixes the order of all additions.
    using Pack = typename PackOf<T, 4>::Type;
    using Pairs = std::array<Pack, Capacity / 2>;
    using Quads = std::array<Pack, Capacity / 4>;
    static_assert(Capacity % 4 == 0);

    // One output is  value·e + difference·(e - e_past) + rate·ė  of the newest sample, plus what was known before it came:
    // past_value·e_past + past_rate·ė_past + past_bump·κ_past + Σ over the modes.
    struct Weights {
        T value{}, difference{}, rate{}, past_value{}, past_rate{}, past_bump{};
    };

    struct Coefficients {
        T inverse_step{};
        T vanished{};    // see `onset`
        T carry{};       // 1 for α = 0, where the integral continues the previous one; else 0
        T onset_mean{};  // mean of t^(-α)/Γ(1-α) over the first hold, where it is singular; 0 for Caputo
        T start_value{}, start_rate{}, start_integral{};  // outputs at t = 0: non-zero only for α = 0 or 1
        Weights integral{}, derivative{};
        std::size_t pairs = 0,
                    quads = 0;  // packs of two modes by two axes, and of four modes; padded with zero weights
        // Per mode and axis; the states carry their output weight w r, so that the derivative is their plain sum.
        Pairs decay{};         // r - 1
        Pairs from_rate{};     // w r (A + r B)
        Pairs from_bump{};     // w r r C
        Pairs at_start{};      // w r B
        Pairs inverse_rate{};  // 1/s: from derivative to integral
        // Per mode, for what e(0) leaves behind.
        Quads onset_decay{};          // r - 1
        Quads at_onset{};             // w r
        Quads onset_to_derivative{};  // mean of exp(-s t) over the next hold, over exp(-s h); 0 for Caputo
        Quads onset_to_integral{};    // 1/s
    };

    struct State {
        bool started = false;
        Vec2<T> initial_value{};
        Sample<T> past{};
        Vec2<T> past_bump{};
        FractionalOutput<T> last{}, known{};  // the last outputs; what is known of the next ones
        Pairs memory{};                       // w r g: lanes x, y of one mode, x, y of the next
        // w r exp(-s t), with 1e-30·h added every step: left to decay into subnormal numbers it would slow the processor
        // down.
        Quads onset{};
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
        const Vec2<T> difference = now.value - state.past.value;
        const auto output = [&](const Weights& w, const Vec2<T>& known) {
            return (w.difference * difference + w.rate * now.rate) + (w.value * now.value + known);
        };
        state.last = {.integral = output(c.integral, state.known.integral),
                      .derivative = output(c.derivative, state.known.derivative)};
        if (!state.started) {
            state.last = {.integral = c.start_integral * now.value,
                          .derivative = (c.start_value + c.onset_mean) * now.value + c.start_rate * now.rate};
        }
        return state.last;
    }

    // The second half: moves the modes to the sample before the next one, from what was known a sample ago, and sums
    // them for its outputs.
    static void advance(State& state, const Coefficients& c, const Sample<T>& now) {
        const bool first = !state.started;
        if (first) {
            state.started = true;
            state.initial_value = now.value;
            state.past = {.value = now.value, .rate = -now.rate};
        }
        Pack rate{}, bump{};
        twice(rate, state.past.rate);
        twice(bump, state.past_bump);
        Pack derivative{}, integral{}, onset_derivative{}, onset_integral{};
        for (std::size_t j = 0; j < c.pairs; ++j) {
            // The increment is formed first: r itself would round to 1 for slow modes in single precision.
            const Pack g = state.memory[j];
            const Pack moved =
                first ? c.at_start[j] * rate : g + (c.decay[j] * g + (c.from_rate[j] * rate + c.from_bump[j] * bump));
            state.memory[j] = moved;
            derivative = derivative + moved;
            integral = integral + c.inverse_rate[j] * moved;
        }
        for (std::size_t j = 0; j < c.quads; ++j) {
            const Pack e = state.onset[j];
            const Pack moved = first ? c.at_onset[j] : e + (c.onset_decay[j] * e + c.vanished);
            state.onset[j] = moved;
            onset_derivative = onset_derivative + c.onset_to_derivative[j] * moved;
            onset_integral = onset_integral + c.onset_to_integral[j] * moved;
        }
        // κ of the interval that ends now; there is none before the first sample.
        const Vec2<T> newest =
            first ? Vec2<T>{} : c.inverse_step * (now.value - state.past.value) - T(0.5) * (now.rate + state.past.rate);
        const auto known = [&](const Weights& w) {
            return w.past_value * now.value + w.past_rate * now.rate + w.past_bump * newest;
        };
        state.known.derivative = known(c.derivative) +
                                 Vec2<T>{derivative[0] + derivative[2], derivative[1] + derivative[3]} +
                                 total(onset_derivative) * state.initial_value;
        state.known.integral = known(c.integral) - Vec2<T>{integral[0] + integral[2], integral[1] + integral[3]} -
                               total(onset_integral) * state.initial_value + c.carry * state.last.integral;
        state.past = now;
        state.past_bump = newest;
    }

private:
    static T total(const Pack& p) { return (p[0] + p[2]) + (p[1] + p[3]); }
    static void twice(Pack& p, const Vec2<T>& a) {
        p[0] = p[2] = a.x;
        p[1] = p[3] = a.y;
    }
};

// All in double, whatever T: coefficients are derived once.
template <Scalar T, std::size_t Capacity>
typename Fractional<T, Capacity>::Coefficients Fractional<T, Capacity>::prepare(const Modes& modes, double step,
                                                                                bool riemann_liouville) {
    Coefficients c;
    c.inverse_step = T(1.0 / step);
    c.vanished = T(1e-30 * step);
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
        const auto set = [](Pack& pack, std::size_t lane, double value) { pack[lane] = T(value); };
        for (const std::size_t lane : {2 * (i % 2), 2 * (i % 2) + 1}) {
            set(c.decay[i / 2], lane, decay);
            set(c.from_rate[i / 2], lane, to_derivative * (a + r * b));
            set(c.from_bump[i / 2], lane, to_derivative * (r * bump));
            set(c.at_start[i / 2], lane, to_derivative * b);
            set(c.inverse_rate[i / 2], lane, 1.0 / s);
        }
        set(c.onset_decay[i / 4], i % 4, decay);
        set(c.at_onset[i / 4], i % 4, to_derivative);
        set(c.onset_to_derivative[i / 4], i % 4, riemann_liouville ? moments[0] : 0.0);
        set(c.onset_to_integral[i / 4], i % 4, 1.0 / s);
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
