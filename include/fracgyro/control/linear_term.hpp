// λ₁ e, and what published laws add to it; each is off by default, and without any it is λ₁ e bit for bit.
//
//    coupling c_z      adds -c_z e to the force: backstepping with z₁ = e, z₂ = s
//    integral λᵢ       adds λᵢ ∫e to s
//    start rate a      adds -s(0) e^(-a t) to s from the first measured sample on: the start is on the surface
//    filter τ          dynamic surface: s = v - α̂, where α̂ follows α = ṙ - λ₁ e - λᵢ ∫e with the lag τ, and the force
//                      has dα̂/dt = (α - α̂)/τ, so that it needs no acceleration of the reference
//
//    Lag and decay are exact for a sampled α. ∫e rests while the excess force opposes e, and without a sample.
//
// Source: docs/decisions/0053.
#pragma once

#include "fracgyro/control/error.hpp"
#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/saved.hpp"

namespace fracgyro {

struct LinearTermParams {
    double coupling = 0.0;    // c_z
    double integral = 0.0;    // λᵢ
    double start_rate = 0.0;  // a
    double filter = 0.0;      // τ

    static constexpr auto fields() {
        using P = LinearTermParams;
        return Fields{
            field("coupling", &P::coupling, "omega0^2", at_least_0,
                  "c_z, unit omega0^2: the force has -c_z e more, as backstepping has. kind fractional, "
                  "fractional_fast_terminal, or 0.0: off."),
            field("error_integral", &P::integral, "omega0^2", at_least_0,
                  "lambda_i, unit omega0^2: s has lambda_i times the integral of e more. kind fractional, "
                  "fractional_fast_terminal, or 0.0: off."),
            field("start_rate", &P::start_rate, "omega0", at_least_0,
                  "a, unit omega0: s has -s(0) exp(-a t) more, so that the start is on the surface. kind fractional, "
                  "fractional_fast_terminal, or 0.0: off."),
            field("surface_filter", &P::filter, "1/omega0", at_least_0,
                  "tau, unit 1/omega0: dynamic surface, lag of the velocity that e asks for, whose derivative replaces "
                  "that of the reference. kind fractional, fractional_fast_terminal, or 0.0: off."),
        };
    }
    bool any() const { return coupling > 0.0 || integral > 0.0 || start_rate > 0.0 || filter > 0.0; }
};

template <Scalar T>
struct SurfacePoint {
    Vec2<T> s{}, drift{};
};

// Inputs of a surface next to the error.
template <Scalar T>
struct SurfaceInput {
    ReferencePoint<T> reference{};
    bool measured = true;
};

template <Scalar T>
struct LinearTerm {
    struct Coefficients {
        Vec2<T> gain{};
        bool extended = false, counts_start = false, filtered = false;
        T coupling{}, integral_gain{}, step{};
        T forgets{}, start_gain{};  // e^(-a h), (1 - e^(-a h))/h
        T follows{}, rate{};        // 1 - e^(-h/τ), the same over h
    };
    struct State {
        Vec2<T> integral{};  // ∫e
        Vec2<T> start{};     // s(0) e^(-a t)
        Vec2<T> asked{};     // α̂
        Kept<T, bool> started = false;
    };

    // `Params`: SurfaceParams.
    template <class Params>
    static Coefficients prepare(const Params& p, double step, double /*position_share*/) {
        const LinearTermParams& more = p.linear;
        const double forgets = exponential(-more.start_rate * step);
        const double follows = more.filter > 0.0 ? 1.0 - exponential(-step / more.filter) : 0.0;
        return {.gain = cast<T>(p.fractional_gain),
                .extended = more.any(),
                .counts_start = more.start_rate > 0.0,
                .filtered = more.filter > 0.0,
                .coupling = T(more.coupling),
                .integral_gain = T(more.integral),
                .step = T(step),
                .forgets = T(forgets),
                .start_gain = T((1.0 - forgets) / step),
                .follows = T(follows),
                .rate = T(follows / step)};
    }
    static bool sound(const State& state, const Coefficients&) { return fracgyro::sound(state.started); }

    static SurfacePoint<T> evaluate(State& state, const Coefficients& c, const Sample<T>& error,
                                    const SurfaceInput<T>& input) {
        SurfacePoint<T> point{.s = c.gain * error.value, .drift = c.gain * error.derivative};
        if (!c.extended) {
            return point;
        }
        point = {.s = point.s + c.integral_gain * state.integral, .drift = point.drift + c.integral_gain * error.value};
        const Vec2<T> asks = input.reference.velocity - point.s;
        if (!state.started) {
            state.asked = asks;
            state.start = c.counts_start ? error.derivative + point.s : Vec2<T>{};
            state.started = input.measured;
        }
        if (c.filtered) {
            const Vec2<T> lag = asks - state.asked;
            point = {.s = point.s + lag, .drift = input.reference.acceleration - c.rate * lag};
        }
        return {.s = point.s - state.start,
                .drift = point.drift + c.start_gain * state.start + c.coupling * error.value};
    }
    // `excess`: the part of the force that the limit removed.
    static void advance(State& state, const Coefficients& c, const Sample<T>& error, const SurfaceInput<T>& input,
                        const Vec2<T>& excess) {
        if (!c.extended) {
            return;
        }
        const Vec2<T> asks = input.reference.velocity - (c.gain * error.value + c.integral_gain * state.integral);
        state.asked = state.asked + c.follows * (asks - state.asked);
        state.start = c.forgets * state.start;
        if (input.measured) {
            const T grows = if_less(dot(excess, error.value), T(0.0), T(0.0), c.step);
            state.integral = state.integral + grows * error.value;
        }
    }
};

}  // namespace fracgyro
