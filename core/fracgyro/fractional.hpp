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

// Capacity: room for modes; a multiple of `lanes`.
template <Scalar T, std::size_t Capacity = Modes::capacity>
struct Fractional {
    // Modes are summed in this many interleaved partial sums, which fixes the order of the additions and lets the
    // compiler use vector registers.
    static constexpr std::size_t lanes = 4;
    static_assert(Capacity % lanes == 0);
    using Pack = typename PackOf<T, lanes>::Type;
    using Array = std::array<Pack, Capacity / lanes>;

    // Weights of the newest sample (value, rate, bump κ) and of the one before (past_…) in one output.
    struct Weights {
        T value{}, rate{}, bump{}, past_value{}, past_rate{}, past_bump{};
    };

    struct Coefficients {
        T inverse_step{};
        T vanished{};    // see `onset`
        T carry{};       // 1 for α = 0, where the integral continues the previous one; else 0
        T onset_mean{};  // mean of t^(-α)/Γ(1-α) over the first hold, where it is singular; 0 for Caputo
        T start_value{}, start_rate{}, start_integral{};  // outputs at t = 0: non-zero only for α = 0 or 1
        Weights integral{}, derivative{};
        std::size_t packs = 0;  // modes, rounded up to whole packs; the padding has zero weights
        // Per mode; the states carry their output weight w r, so that the derivative is their plain sum.
        Array decay{};                // r - 1
        Array from_rate{};            // w r (A + r B)
        Array from_bump{};            // w r r C
        Array at_start{};             // w r B
        Array at_onset{};             // w r
        Array inverse_rate{};         // 1/s: from derivative to integral
        Array onset_to_derivative{};  // mean of exp(-s t) over the next hold, over exp(-s h); 0 for Caputo
    };

    struct State {
        bool started = false;
        Vec2<T> initial_value{};
        Sample<T> past{};
        Vec2<T> past_bump{}, past_integral{};
        Vec2<T> derivative_sum{}, integral_sum{};  // Σ over modes, ready for the next sample
        T onset_derivative{}, onset_integral{};    // what e(0) contributes to them, per unit
        Array x{}, y{};                            // w r g
        // w r exp(-s t), with 1e-30·h added every step: left to decay into subnormal numbers it would slow the
        // processor down.
        Array onset{};
    };

    static Coefficients prepare(const Modes& modes, double step, bool riemann_liouville);

    // The outputs at the next sample. Samples come at multiples of the step that `c` was prepared for.
    static FractionalOutput<T> update(State& state, const Coefficients& c, const Sample<T>& now) {
        if (!state.started) {
            return start(state, c, now);
        }
        const Sample<T>& past = state.past;
        const Vec2<T> bump = c.inverse_step * (now.value - past.value) - T(0.5) * (now.rate + past.rate);
        const auto local = [&](const Weights& w) {
            return (w.value * now.value + w.past_value * past.value) + (w.rate * now.rate + w.past_rate * past.rate) +
                   (w.bump * bump + w.past_bump * state.past_bump);
        };
        const FractionalOutput<T> output{
            .integral = local(c.integral) - state.integral_sum - state.onset_integral * state.initial_value +
                        c.carry * state.past_integral,
            .derivative = local(c.derivative) + state.derivative_sum + state.onset_derivative * state.initial_value};
        advance(state, c);
        state.past = now;
        state.past_bump = bump;
        state.past_integral = output.integral;
        return output;
    }

private:
    static FractionalOutput<T> start(State& state, const Coefficients& c, const Sample<T>& now) {
        state.started = true;
        state.initial_value = now.value;
        state.past = now;
        Sums sums{};
        for (std::size_t j = 0; j < c.packs; ++j) {
            for (std::size_t k = 0; k < lanes; ++k) {
                state.x[j][k] = -(c.at_start[j][k] * now.rate.x);
                state.y[j][k] = -(c.at_start[j][k] * now.rate.y);
                state.onset[j][k] = c.at_onset[j][k];
            }
            sums.add(state, c, j);
        }
        sums.finish(state);
        const FractionalOutput<T> output{
            .integral = c.start_integral * now.value,
            .derivative = (c.start_value + c.onset_mean) * now.value + c.start_rate * now.rate};
        state.past_integral = output.integral;
        return output;
    }

    // Moves the modes to the sample before the next one, from what is known already, and sums them for its outputs.
    static void advance(State& state, const Coefficients& c) {
        const Vec2<T> rate = state.past.rate;
        const Vec2<T> bump = state.past_bump;
        Sums sums{};
        for (std::size_t j = 0; j < c.packs; ++j) {
            Pack &x = state.x[j], &y = state.y[j], &onset = state.onset[j];
            // The increment is formed first: r itself would round to 1 for slow modes in single precision.
            x = x + (c.decay[j] * x + (c.from_rate[j] * rate.x + c.from_bump[j] * bump.x));
            y = y + (c.decay[j] * y + (c.from_rate[j] * rate.y + c.from_bump[j] * bump.y));
            onset = onset + (c.decay[j] * onset + c.vanished);
            sums.add(state, c, j);
        }
        sums.finish(state);
    }

    struct Sums {
        Pack dx{}, dy{}, ix{}, iy{}, od{}, oi{};

        void add(const State& state, const Coefficients& c, std::size_t j) {
            dx = dx + state.x[j];
            dy = dy + state.y[j];
            ix = ix + c.inverse_rate[j] * state.x[j];
            iy = iy + c.inverse_rate[j] * state.y[j];
            od = od + c.onset_to_derivative[j] * state.onset[j];
            oi = oi + c.inverse_rate[j] * state.onset[j];
        }
        void finish(State& state) const {
            const auto total = [](const Pack& p) { return (p[0] + p[2]) + (p[1] + p[3]); };
            state.derivative_sum = {total(dx), total(dy)};
            state.integral_sum = {total(ix), total(iy)};
            state.onset_derivative = total(od);
            state.onset_integral = total(oi);
        }
    };
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
        const std::size_t j = i / lanes;
        const std::size_t k = i % lanes;
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
        c.decay[j][k] = T(decay);
        c.from_rate[j][k] = T(to_derivative * (a + r * b));
        c.from_bump[j][k] = T(to_derivative * (r * bump));
        c.at_start[j][k] = T(to_derivative * b);
        c.at_onset[j][k] = T(to_derivative);
        c.inverse_rate[j][k] = T(1.0 / s);
        c.onset_to_derivative[j][k] = T(riemann_liouville ? moments[0] : 0.0);
        rate_to_derivative += to_derivative * b;
        bump_to_derivative += to_derivative * bump;
        rate_to_integral += to_integral * b;
        bump_to_integral += to_integral * bump;
        value_to_integral += to_integral;
    }
    c.packs = (modes.count + lanes - 1) / lanes;
    c.integral = {.value = T(0.0),
                  .rate = T(scale * step / ((nu + 1.0) * (nu + 2.0))),
                  .bump = T(6.0 * scale * step / ((nu + 2.0) * (nu + 3.0))),
                  .past_value = T(scale + value_to_integral),
                  .past_rate = T(scale * step / (nu + 2.0) - rate_to_integral),
                  .past_bump = T(-bump_to_integral)};
    if (integer_order) {
        c.carry = c.start_value = c.derivative.value = T(1.0);
        return c;
    }
    c.derivative = {.value = T(0.0),
                    .rate = T(scale / (nu + 1.0)),
                    .bump = T(6.0 * nu * scale / ((nu + 1.0) * (nu + 2.0))),
                    .past_value = T(0.0),
                    .past_rate = T(nu * scale / (nu + 1.0) + rate_to_derivative),
                    .past_bump = T(bump_to_derivative)};
    c.onset_mean = T(riemann_liouville ? scale / step : 0.0);
    return c;
}

}  // namespace fracgyro
