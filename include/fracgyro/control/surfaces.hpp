// 3  Sliding surfaces, one type each. A surface turns the error into s and into the part of ds/dt that does not
//    contain the plant, which the equivalent control cancels.
//
//        s     = ė + first(e) + terminal(e)
//        ds/dt = ë + drift(e, ė)
//
//    linear                     first = λ1 e                               terminal = 0
//    fast terminal        (15)  first = λ1 e                               terminal = λ2 |e|^c sign(e)
//    fractional           [52]  first = λ1 D^(α-1) e                       terminal = 0
//    fractional fast terminal (16)  first = λ1 D^(α-1) e                   terminal = λ2 |e|^c sign(e)
//
//    Their drifts are λ1 ė or λ1 D^α e, and λ2 c |e|^(c-1) ė (eq. (17)). To λ1 e, linear_term.hpp adds terms.
//
//    To add a surface: a type with Coefficients, State, prepare(), evaluate() and sound() as below, advance() if it has
//    memory to update after the force is sent, and one line in registry.hpp.
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/datasheet.hpp"
#include "fracgyro/control/linear_term.hpp"
#include "fracgyro/core/fractional.hpp"

namespace fracgyro {

struct SurfaceParams {
    Vec2<double> fractional_gain{10.0, 10.0};  // λ1 > 0, also the gain of the integer-order first term
    Vec2<double> terminal_gain{0.5, 0.5};      // λ2 > 0
    double terminal_exponent = 0.5;            // c in (0, 1)
    double singularity_floor = 1e-6;           // |e| below which |e|^(c-1) no longer grows
    bool riemann_liouville = true;             // which D^α: d/dt of D^(α-1) e is the Riemann-Liouville one
    LinearTermParams linear{};
    ExponentialSum kernel{};

    static constexpr std::string_view derivatives[] = {"caputo", "riemann_liouville"};
    static constexpr auto fields() {
        using P = SurfaceParams;
        return Fields{
            Inner{"controller", &P::kernel},
            field("fractional_gain", &P::fractional_gain, "omega0^(2-alpha)", above_0,
                  "lambda1 [x, y], unit omega0^(2-alpha), > 0: decay of e on the surface. Towards 0.0: off."),
            field("terminal_gain", &P::terminal_gain, "q0^(1-c)*omega0", above_0,
                  "lambda2 [x, y], unit q0^(1-c) omega0, > 0: finite-time pull near e = 0. kind fractional, linear: "
                  "off."),
            field("terminal_exponent", &P::terminal_exponent, "1", strictly_between_0_and_1,
                  "c, strictly between 0 and 1, no unit: |e|^c sign(e). Towards 1.0: a linear term."),
            field("singularity_floor", &P::singularity_floor, "q0", above_0,
                  "Unit q0, > 0: floor of |e| in |e|^(c-1). Towards 0.0: off; below 1e-9 rounding rules."),
            choice("derivative", &P::riemann_liouville, derivatives,
                   "D^alpha of (18): caputo as printed; riemann_liouville cancels exactly. order 1.0: no difference."),
            Inner{"controller", &P::linear},
        };
    }
};

// Share χ of the measured position in the error that the fractional operator differentiates, if the positions are
// noisy: the gain of the stationary Kalman filter for a position whose velocity is measured, λ = h σ_v/σ_q. The
// velocity noise of an observer is what one sample adds. Exact or filtered positions: 1, the given ones. λ >= h/10, so
// that an offset of ē, as faulty velocities leave it, decays within ten units of time.
inline double position_share(const Datasheet& assumed, const Common& common) {
    if (common.filter.on()) {
        return 1.0;
    }
    const double forgets = exponential(-common.observer_bandwidth * common.step);
    const double observed = 1.5 * (1.0 - forgets * forgets) * (1.0 - forgets) * assumed.position_noise;
    const double travel = common.observer_bandwidth > 0.0 ? observed : common.step * assumed.velocity_noise;
    if (!(assumed.position_noise > 0.0)) {
        return 1.0;
    }
    const double ratio = maximum(travel / assumed.position_noise, 0.1 * common.step);
    return ratio < 1e8 ? 2.0 * ratio / (square_root(ratio * ratio + 4.0) + ratio) : 1.0;
}

// λ1 D^(α-1) e, with room for `Capacity` exponentials.
//
// The operator's interpolant differentiates positions: their noise σ enters as σ/h, however well the velocity is
// measured. If positions are noisy, the operator is given the smoother error
//     ē = (1-χ) (ē_past + h/2 (ė_past + ė)) + χ e,
// almost a line through the measured rates, in which positions only prevent a drift.
template <Scalar T, std::size_t Capacity = ExponentialSum::capacity>
struct FractionalTerm {
    using Operator = Fractional<T, Capacity>;
    struct Coefficients {
        Vec2<T> gain{};
        bool smooths = false;  // χ < 1
        T share{}, half_step{};
        typename Operator::Coefficients fractional{};
    };
    using State = typename Operator::State;

    static Coefficients prepare(const SurfaceParams& p, double step, double position_share) {
        return {.gain = cast<T>(p.fractional_gain),
                .smooths = position_share < 1.0,
                .share = T(position_share),
                .half_step = T(0.5 * step),
                .fractional = Operator::prepare(p.kernel, step, p.riemann_liouville)};
    }
    static bool sound(const State& state, const Coefficients& c) { return Operator::sound(state, c.fractional); }
    static SurfacePoint<T> evaluate(State& state, const Coefficients& c, const Sample<T>& error) {
        const FractionalOutput<T> d = Operator::evaluate(state, c.fractional, smoothed(state, c, error));
        return {.s = c.gain * d.integral, .drift = c.gain * d.derivative};
    }
    static void advance(State& state, const Coefficients& c, const Sample<T>& error) {
        Operator::advance(state, c.fractional, smoothed(state, c, error));
    }

private:
    static Sample<T> smoothed(const State& state, const Coefficients& c, const Sample<T>& error) {
        const Sample<T>& past = state.past;
        if (!c.smooths || !state.started) {
            return error;
        }
        const Vec2<T> moved = past.value + c.half_step * (past.derivative + error.derivative);
        return {.value = moved + c.share * (error.value - moved), .derivative = error.derivative};
    }
};

// λ2 |e|^c sign(e)
template <Scalar T>
struct TerminalTerm {
    struct Coefficients {
        Vec2<T> gain{};
        T exponent{}, floor{}, floored_slope{};  // floored_slope = floor^(c-1)
        bool square_root = false;                // c = ½, by far the fastest
    };

    static Coefficients prepare(const SurfaceParams& p, double /*step*/) {
        return {.gain = cast<T>(p.terminal_gain),
                .exponent = T(p.terminal_exponent),
                .floor = T(p.singularity_floor),
                .floored_slope = T(power(p.singularity_floor, p.terminal_exponent) / p.singularity_floor),
                .square_root = p.terminal_exponent == 0.5};
    }
    static SurfacePoint<T> evaluate(const Coefficients& c, const Sample<T>& error) {
        const Vec2<T> size = absolute(error.value);
        Vec2<T> root;
        if (c.square_root) {
            root = square_root(size);
        } else {
            root = {power(size.x(), c.exponent), power(size.y(), c.exponent)};
        }
        // |e|^(c-1) = |e|^c / |e|, with the division in parallel with the root instead of after it.
        const Vec2<T> slope = if_less({c.floor, c.floor}, size, root * reciprocal(maximum(size, c.floor)),
                                      {c.floored_slope, c.floored_slope});
        return {.s = with_sign_of(error.value, c.gain * root),
                .drift = (c.exponent * (c.gain * error.derivative)) * slope};
    }
};

namespace detail {
template <class First, std::size_t Capacity>
struct SizedTerm {
    using Type = First;
    static constexpr bool has_memory = false;
};
template <Scalar T, std::size_t Most, std::size_t Capacity>
struct SizedTerm<FractionalTerm<T, Most>, Capacity> {
    using Type = FractionalTerm<T, Capacity>;
    static constexpr bool has_memory = true;
};
}  // namespace detail

// ė + First, and the terminal term if it has one.
template <Scalar T, class First, bool with_terminal>
struct Surface {
    struct Coefficients {
        typename First::Coefficients first{};
        typename TerminalTerm<T>::Coefficients terminal{};
    };
    using State = typename First::State;
    static constexpr bool has_memory = detail::SizedTerm<First, 2>::has_memory;
    // Room for `Capacity` exponentials.
    template <std::size_t Capacity>
    using Sized = Surface<T, typename detail::SizedTerm<First, Capacity>::Type, with_terminal>;

    static Coefficients prepare(const SurfaceParams& p, double step, double position_share) {
        return {.first = First::prepare(p, step, position_share), .terminal = TerminalTerm<T>::prepare(p, step)};
    }
    static bool sound(const State& state, const Coefficients& c) { return First::sound(state, c.first); }
    static SurfacePoint<T> evaluate(State& state, const Coefficients& c, const Sample<T>& error,
                                    const SurfaceInput<T>& input = {}) {
        SurfacePoint<T> point;
        if constexpr (has_memory) {
            point = First::evaluate(state, c.first, error);
        } else {
            point = First::evaluate(state, c.first, error, input);
        }
        point.s = error.derivative + point.s;
        if constexpr (with_terminal) {
            const SurfacePoint<T> more = TerminalTerm<T>::evaluate(c.terminal, error);
            point = {.s = point.s + more.s, .drift = point.drift + more.drift};
        }
        return point;
    }
    // Moves the memory to the next sample, after the force is sent.
    static void advance(State& state, const Coefficients& c, const Sample<T>& error, const SurfaceInput<T>& input = {},
                        const Vec2<T>& excess = {}) {
        if constexpr (has_memory) {
            First::advance(state, c.first, error);
        } else {
            First::advance(state, c.first, error, input, excess);
        }
    }
};

// Sliding mode control on a linear surface: once s is zero, the error decays exponentially.
//
// Use it when you want adaptive sliding mode control with the fewest gains, operations and bytes.
//
//        s = ė + λ₁ e        drift = λ₁ ė
template <Scalar T>
using LinearSurface = Surface<T, LinearTerm<T>, false>;
// Fast terminal sliding mode control: the paper's controller with α = 1, which needs no fractional memory.
//
// Use it when the error should reach zero in finite time with little memory.
//
//        s = ė + λ₁ e + λ₂ |e|^c sign(e)        drift = λ₁ ė + λ₂ c |e|^(c-1) ė
template <Scalar T>
using FastTerminalSurface = Surface<T, LinearTerm<T>, true>;
// Fractional sliding mode control: the paper's controller without its terminal term, as in the paper's reference [52].
//
// Use it when you study the fractional order without the terminal term, or want no singularity at zero error.
//
//        s = ė + λ₁ D^(α-1) e        drift = λ₁ D^α e
template <Scalar T>
using FractionalSurface = Surface<T, FractionalTerm<T>, false>;
// Fractional fast terminal sliding mode control: the paper's controller, whose surface has a fractional derivative of
// the error and a term that reaches zero in finite time.
//
// Use it when you reproduce the paper, or track with noisy sensors, with `adaptation.kind` joint.
//
//        s = ė + λ₁ D^(α-1) e + λ₂ |e|^c sign(e)        drift = λ₁ D^α e + λ₂ c |e|^(c-1) ė
template <Scalar T>
using FractionalFastTerminalSurface = Surface<T, FractionalTerm<T>, true>;

}  // namespace fracgyro
