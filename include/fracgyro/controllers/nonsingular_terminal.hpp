// Adaptive nonsingular terminal sliding mode control: the error reaches zero in finite time, without negative powers in
// the force.
//
// Use it when you compare terminal surfaces, or need one without a singularity at zero error.
//
//        s = e + a sig(e, γ₁) + b sig(ė, γ₂)        1 < γ₂ < 2, γ₁ > γ₂
//        u = (D̂ + 2Ω̂) v + K̂ q + r̈ - sig(ė, 2 - γ₂) (1 + a γ₁ |e|^(γ₁-1))/(b γ₂) - k s - k_s reach(s)
//        sig(z, p) = |z|^p sign(z)
//        reach(s) = sig(s, ρ) for ρ > 0, sat(s/δ) for ρ = 0
//
//    on each axis; q, v and r̈ of the force are moved along the reference to the held point (feedforward.hpp). a = 0 is
//    the nonsingular terminal surface, a > 0 the nonsingular fast terminal one. ρ between 0 and 1 is the power reaching
//    law of the continuous variants, ρ = 0 the boundary layer.
//
//    No power in the force is negative, so nothing is singular; but ds/du = b γ₂ |ė|^(γ₂-1) vanishes with ė, and there
//    the force has no authority over s. The estimates follow the laws (44) with (ds/du) s instead of s.
//
// Source: Feng, Yu and Man 2002, doi 10.1016/S0005-1098(02)00147-4; fast: Yang and Yang 2011, cited from memory; for
// gyroscopes doi 10.1155/2019/6840639 (abstract read).
#pragma once

#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

struct NonsingularTerminalParams {
    double position_gain = 1.0;            // a
    double velocity_gain = 0.01;           // b
    double position_exponent = 2.0;        // γ₁
    double velocity_exponent = 5.0 / 3.0;  // γ₂
    double reaching_gain = 2000.0;         // k
    double switching_gain = 100.0;         // k_s
    double reaching_exponent = 0.5;        // ρ
    double layer_thickness = 0.01;         // δ
    AdaptationParams adaptation{};         // the bounds are not used

    static constexpr auto fields() {
        using P = NonsingularTerminalParams;
        constexpr Range between_1_and_2{.low = 1.0, .high = 2.0, .strict = true};
        return Fields{
            field("nonsingular_position_gain", &P::position_gain, "q0^(1-gamma1)", at_least_0,
                  "a, unit q0^(1-gamma1): of |e|^gamma1 in s. 0.0: off, the plain nonsingular surface."),
            field("nonsingular_velocity_gain", &P::velocity_gain, "q0^(1-gamma2)/omega0^gamma2", above_0,
                  "b, unit q0^(1-gamma2)/omega0^gamma2, > 0: of |de/dt|^gamma2 in s."),
            field("position_exponent", &P::position_exponent, "1", Range{.low = 1.0, .high = 3.0, .strict = true},
                  "gamma1, strictly between 1 and 3, no unit; above gamma2."),
            field("velocity_exponent", &P::velocity_exponent, "1", between_1_and_2,
                  "gamma2, strictly between 1 and 2, no unit. Towards 1.0: a linear surface."),
            field("reaching_gain", &P::reaching_gain, "omega0^2", at_least_0,
                  "k, unit omega0^2: u contains -k s. 0.0: off."),
            field("switching_gain", &P::switching_gain, "m*omega0^2*q0^(1-rho)", at_least_0,
                  "k_s: u contains -k_s reach(s). 0.0: off."),
            field("reaching_exponent", &P::reaching_exponent, "1", Range{.low = 0.0, .high = 1.0},
                  "rho, 0 to 1, no unit: reach(s) = |s|^rho sign(s). 0.0: off, a boundary layer of nonsingular_layer."),
            field(
                "nonsingular_layer", &P::layer_thickness, "q0", above_0,
                "delta, unit q0, > 0: with reaching_exponent 0.0 reach(s) = s/delta within +-1. Towards 0.0: sign(s)."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct NonsingularTerminalReport : PlantReport<T> {
    Vec2<T> sliding{};  // s, a length; a rate on other surfaces

    static constexpr auto fields() {
        using R = NonsingularTerminalReport;
        return joined(
            Fields{momentary(channel("nonsingular_surface", &R::sliding, "q0", "nonsingular terminal surface s"))},
            PlantReport<T>::fields());
    }
};

template <Scalar T>
struct NonsingularTerminal {
    using Value = T;
    using Params = NonsingularTerminalParams;
    using Report = NonsingularTerminalReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T position_gain{}, velocity_gain{};    // a, b
        T position_power{}, velocity_power{};  // γ₁ - 1, less 1 if it is at least 1; γ₂ - 1
        T position_slope{}, inverse_slope{};   // a γ₁, 1/(b γ₂)
        T velocity_slope{};                    // b γ₂
        T reaching_gain{}, switching_gain{}, reaching_exponent{}, inverse_layer{};
        bool steep = false, layered = false;  // γ₁ >= 2, ρ = 0
    };
    struct State {
        typename Base::State base{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const bool steep = p.position_exponent >= 2.0;
        const double slope = p.velocity_gain * p.velocity_exponent;
        return {.base = Base::prepare(p.adaptation, common),
                .position_gain = T(p.position_gain),
                .velocity_gain = T(p.velocity_gain),
                .position_power = T(p.position_exponent - (steep ? 2.0 : 1.0)),
                .velocity_power = T(p.velocity_exponent - 1.0),
                .position_slope = T(p.position_gain * p.position_exponent),
                .inverse_slope = T(1.0 / slope),
                .velocity_slope = T(slope),
                .reaching_gain = T(p.reaching_gain),
                .switching_gain = T(p.switching_gain),
                .reaching_exponent = T(p.reaching_exponent),
                .inverse_layer = T(1.0 / p.layer_thickness),
                .steep = steep,
                .layered = !(p.reaching_exponent > 0.0)};
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

        const Vec2<T> size = absolute(e.value), speed = absolute(e.derivative);
        Vec2<T> steepness = raised(size, c.position_power);  // |e|^(γ₁-1)
        if (c.steep) {
            steepness = size * steepness;
        }
        const Vec2<T> authority = raised(speed, c.velocity_power);  // |ė|^(γ₂-1)
        const Vec2<T> s =
            e.value + c.position_gain * (steepness * e.value) + c.velocity_gain * (authority * e.derivative);
        signals.report.sliding = s;

        const Vec2<T> one{T(1.0), T(1.0)};
        const Vec2<T> slow = with_sign_of(e.derivative, raised(speed, T(1.0) - c.velocity_power));  // sig(ė, 2-γ₂)
        const Vec2<T> drift = c.inverse_slope * (slow * (one + c.position_slope * steepness));
        const Vec2<T> wanted =
            plant_force<T>(signals.report, moved(motion, signals.reference, held), held.acceleration) - drift -
            c.reaching_gain * s - c.switching_gain * reach(c, s);
        const Vec2<T> weighted = c.velocity_slope * (authority * s);
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, weighted);
        if (missing == nullptr) {
            Base::learn(state.base, c.base, motion, active * weighted);
        }
        return signals;
    }

private:
    static Vec2<T> reach(const Coefficients& c, const Vec2<T>& s) {
        return c.layered ? clamp(c.inverse_layer * s, T(-1.0), T(1.0))
                         : with_sign_of(s, raised(absolute(s), c.reaching_exponent));
    }
};

}  // namespace fracgyro
