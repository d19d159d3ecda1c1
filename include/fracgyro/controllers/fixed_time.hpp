// Adaptive fixed-time sliding mode control: without noise and with unlimited force, the error reaches zero within a
// time that does not depend on its start.
//
// Use it when you study fixed-time convergence; a force limit or noise removes the advantage.
//
//        s = ė + a sig(e, μ) + b sig(e, ν)        sig(z, p) = |z|^p sign(z)
//        u = (D̂ + 2Ω̂) v + K̂ q + r̈ - (a μ |e|^(μ-1) + b ν |e|^(ν-1)) ė - k₁ sig(s, ½) - k₂ sig(s, 3/2)
//
//    on each axis with μ < 1 < ν, so that a and k₁ act near zero, b and k₂ far from it; q, v and r̈ of the force are
//    moved along the reference to the held point (feedforward.hpp). The time is at most
//
//        1/(a (1 - μ)) + 1/(b (ν - 1)) + π/(k₁ k₂)^½
//
//    Explicitly, a step h of the last two terms diverges from √|s| = 2/(h k₂) on and cycles about zero. Held, it is
//    implicit in √|s|: the force (z² - |s|) sign(s)/h brings |s| to z² with z + ½ h (k₁ + k₂ z²) = √|s|, or to zero if
//    no such z > 0 exists. The estimates follow the laws (44).
//
// Source: after Polyakov 2012, doi 10.1109/TAC.2011.2179869 (from memory); docs/decisions/0053.
#pragma once

#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

enum class Reaching { explicit_step, held };

struct FixedTimeParams {
    double near_gain = 20.0, far_gain = 20.0;          // a, b
    double near_exponent = 0.8, far_exponent = 1.5;    // μ, ν
    double near_reaching = 5.0, far_reaching = 300.0;  // k₁, k₂
    Reaching reaching = Reaching::held;
    double singularity_floor = 1e-4;  // |e| below which |e|^(μ-1) no longer grows
    AdaptationParams adaptation{};    // the bounds are not used

    static constexpr std::string_view reachings[] = {"explicit", "held"};
    static constexpr auto fields() {
        using P = FixedTimeParams;
        return Fields{
            field("near_gain", &P::near_gain, "q0^(1-mu)*omega0", above_0,
                  "a, unit q0^(1-mu) omega0, > 0: of |e|^mu in s, which brings e to zero in finite time."),
            field("far_gain", &P::far_gain, "q0^(1-nu)*omega0", above_0,
                  "b, unit q0^(1-nu) omega0, > 0: of |e|^nu in s, which brings any e near zero in a fixed time."),
            field("near_exponent", &P::near_exponent, "1", strictly_between_0_and_1,
                  "mu, strictly between 0 and 1, no unit. Towards 1.0: a linear term."),
            field("far_exponent", &P::far_exponent, "1", Range{.low = 1.0, .high = 2.0, .strict = true},
                  "nu, strictly between 1 and 2, no unit. Towards 1.0: a linear term."),
            field("near_reaching", &P::near_reaching, "q0^0.5*omega0^1.5", above_0,
                  "k1, unit q0^0.5 omega0^1.5, > 0: u contains -k1 |s|^(1/2) sign(s)."),
            field("far_reaching", &P::far_reaching, "omega0^0.5/q0^0.5", above_0,
                  "k2, unit omega0^0.5/q0^0.5, > 0: u contains -k2 |s|^(3/2) sign(s)."),
            choice("reaching", &P::reaching, reachings,
                   "explicit: the terms k1 and k2 at the sample, as published; held: what they do in a step, which "
                   "never overshoots."),
            field("near_floor", &P::singularity_floor, "q0", above_0,
                  "Unit q0, > 0: floor of |e| in |e|^(mu-1). Towards 0.0: off."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct FixedTime {
    using Value = T;
    using Params = FixedTimeParams;
    using Report = SlidingReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T near_gain{}, far_gain{}, near_exponent{}, far_power{};  // a, b, μ, ν - 1
        T near_slope{}, far_slope{}, floor{}, floored{};          // a μ, b ν, of |e|, floor^(μ-1)
        T near_reaching{}, far_reaching{};                        // k₁, k₂; held: times h/2
        T inverse_step{};
        bool held = true;
    };
    struct State {
        typename Base::State base{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const bool held = p.reaching == Reaching::held;
        const double share = held ? 0.5 * common.step : 1.0;
        return {.base = Base::prepare(p.adaptation, common),
                .near_gain = T(p.near_gain),
                .far_gain = T(p.far_gain),
                .near_exponent = T(p.near_exponent),
                .far_power = T(p.far_exponent - 1.0),
                .near_slope = T(p.near_gain * p.near_exponent),
                .far_slope = T(p.far_gain * p.far_exponent),
                .floor = T(p.singularity_floor),
                .floored = T(power(p.singularity_floor, p.near_exponent) / p.singularity_floor),
                .near_reaching = T(share * p.near_reaching),
                .far_reaching = T(share * p.far_reaching),
                .inverse_step = T(1.0 / common.step),
                .held = held};
    }

    static Report report(const State& state, const Coefficients& c) { return {Base::report(state.base, c.base), {}}; }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.base.reference.steps; }
    static void start_over(State& state, bool keep_estimates) { Base::start_over(state.base, keep_estimates); }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> motion = Base::begin(state.base, c.base, signals, measured, missing);
        const Sample<T>& e = signals.error;
        const ReferencePoint<T> held = Reference<T>::held(state.base.reference, c.base.reference);

        const Vec2<T> size = absolute(e.value);
        const Vec2<T> near = raised(size, c.near_exponent), far = raised(size, c.far_power);  // |e|^μ, |e|^(ν-1)
        const Vec2<T> s = signals.report.surface =
            e.derivative + with_sign_of(e.value, c.near_gain * near) + c.far_gain * (far * e.value);
        const Vec2<T> steep =
            if_less({c.floor, c.floor}, size, near * reciprocal(maximum(size, c.floor)), {c.floored, c.floored});
        const Vec2<T> drift = (c.near_slope * steep + c.far_slope * far) * e.derivative;
        const Vec2<T> wanted =
            plant_force<T>(signals.report, moved(motion, signals.reference, held), held.acceleration) - drift -
            with_sign_of(s, reach(c, absolute(s)));
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, s);
        if (missing == nullptr) {
            Base::learn(state.base, c.base, motion, active * s);
        }
        return signals;
    }

private:
    // The mean over the coming step of the terms that reduce |s|.
    static Vec2<T> reach(const Coefficients& c, const Vec2<T>& size) {
        const Vec2<T> root = square_root(size), one{T(1.0), T(1.0)};
        if (!c.held) {
            return c.near_reaching * root + c.far_reaching * (size * root);
        }
        const Vec2<T> above = maximum(root - c.near_reaching * one, T(0.0));
        const Vec2<T> left =
            T(2.0) * (above * reciprocal(one + square_root(one + (T(4.0) * c.far_reaching) * above)));  // z
        return c.inverse_step * (size - left * left);
    }
};

}  // namespace fracgyro
