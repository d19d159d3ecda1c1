// Adaptive super-twisting control: a continuous force that holds s = ė + λ e at zero against any disturbance whose rate
// of change is bounded.
//
// Use it when chattering must be small, the mismatch changes slowly and no rate estimate is needed.
//
//        u = (D̂ + 2Ω̂) v + K̂ q + r̈ - λ ė - k₁ |s|^½ sign(s) + w        dw/dt = -k₂ sign(s)
//
//    with q, v and r̈ moved along the reference to the held point (feedforward.hpp). For a mismatch that changes at
//    most at the rate L: k₂ > L and k₁ ≈ 1.5 √L. The estimates follow the laws (44) and compete with w for the same
//    signal: Ω̂z may wander far from Ωz. w is frozen at the force limit if it would wind up, and never grows beyond the
//    limit.
//
// Source: Levant 1993; for a gyroscope, doi 10.1371/journal.pone.0189457.
#pragma once

#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

struct SuperTwistingParams {
    double surface_gain = 30.0;     // λ
    double twisting_gain = 20.0;    // k₁
    double integral_gain = 300.0;   // k₂
    AdaptationParams adaptation{};  // the bounds are not used

    static constexpr auto fields() {
        using P = SuperTwistingParams;
        return Fields{
            surface_gain_field(&P::surface_gain),
            field("twisting_gain", &P::twisting_gain, "q0^0.5*omega0^1.5", above_0,
                  "k1, > 0: of |s|^(1/2) sign(s); about 1.5 times the root of the mismatch's largest rate of change."),
            field("integral_gain", &P::integral_gain, "q0*omega0^3", above_0,
                  "k2, > 0: of the integral of sign(s); above the mismatch's largest rate of change."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct SuperTwistingReport : SlidingReport<T> {
    Vec2<T> integral{};  // w

    static constexpr auto fields() {
        using R = SuperTwistingReport;
        return joined(SlidingReport<T>::fields(), Fields{channel("twisting_integral", &R::integral, "m*omega0^2*q0",
                                                                 "integral w of the super-twisting law")});
    }
};

template <Scalar T>
struct SuperTwisting {
    using Value = T;
    using Params = SuperTwistingParams;
    using Report = SuperTwistingReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T surface_gain{}, twisting_gain{}, integral_step{};
    };
    struct State {
        typename Base::State base{};
        Vec2<T> integral{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.base = Base::prepare(p.adaptation, common),
                .surface_gain = T(p.surface_gain),
                .twisting_gain = T(p.twisting_gain),
                .integral_step = T(common.step * p.integral_gain)};
    }

    static Report report(const State& state, const Coefficients& c) {
        return {{Base::report(state.base, c.base)}, state.integral};
    }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.base.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        Base::start_over(state.base, keep_estimates);
        state.integral = {};
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> motion = Base::begin(state.base, c.base, signals, measured, missing);
        const Sample<T>& e = signals.error;
        const ReferencePoint<T> held = Reference<T>::held(state.base.reference, c.base.reference);
        const Vec2<T> s = signals.report.surface = e.derivative + c.surface_gain * e.value;
        const Vec2<T> equivalent =
            plant_force<T>(signals.report, moved(motion, signals.reference, held), held.acceleration) -
            c.surface_gain * e.derivative;
        const Vec2<T> twist = with_sign_of(s, square_root(absolute(s)));
        const Vec2<T> wanted = equivalent - c.twisting_gain * twist + state.integral;
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, s);
        if (missing == nullptr) {
            Base::learn(state.base, c.base, motion, active * s);
            state.integral = state.integral - (active * c.integral_step) * sign(s);
            if (c.base.saturation.limited) {
                state.integral = Saturation<T>::within(c.base.saturation, state.integral);
            }
        }
        return signals;
    }

private:
    static Vec2<T> sign(const Vec2<T>& a) {
        const auto one = [](T x) { return if_less(T(0.0), x, T(1.0), if_less(x, T(0.0), T(-1.0), T(0.0))); };
        return {one(a.x()), one(a.y())};
    }
};

}  // namespace fracgyro
