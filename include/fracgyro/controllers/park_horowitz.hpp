// Adaptive control of Park and Horowitz: a damper on the error with adaptive estimates of the plant, without a sliding
// surface.
//
// Use it when both axes are driven at resonance. Off resonance it does not follow the reference.
//
//        u = (D̂ + 2Ω̂) v + K̂ q - K_m q - γ ė
//        ë + γ ė + K_m e = -Φᵀθ̃
//
//    for a sinusoidal reference, r̈ = -K_m r; q and v of the force are moved along the reference to the held point
//    (feedforward.hpp). The estimates follow the laws (44) with ė instead of s. Only K_m restores the position: off
//    resonance, where K_m is far below K, no γ makes the error small.
//
// Source: Park and Horowitz 2003, doi 10.1109/JMEMS.2002.807468; its structure is cited from memory and from the
// nomenclature of Sensors 2016, 16, 321.
#pragma once

#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

struct ParkHorowitzParams {
    double velocity_gain = 10.0;    // γ
    AdaptationParams adaptation{};  // the bounds are not used

    static constexpr auto fields() {
        using P = ParkHorowitzParams;
        return Fields{
            field("velocity_gain", &P::velocity_gain, "omega0", above_0,
                  "gamma, unit omega0, > 0: damping of the error, u contains -gamma de/dt."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct ParkHorowitz {
    using Value = T;
    using Params = ParkHorowitzParams;
    using Report = PlantReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T velocity_gain{};
    };
    struct State {
        typename Base::State base{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.base = Base::prepare(p.adaptation, common), .velocity_gain = T(p.velocity_gain)};
    }

    static Report report(const State& state, const Coefficients& c) { return Base::report(state.base, c.base); }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.base.reference.steps; }
    static void start_over(State& state, bool keep_estimates) { Base::start_over(state.base, keep_estimates); }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> motion = Base::begin(state.base, c.base, signals, measured, missing);
        const Sample<T>& e = signals.error;
        const ReferencePoint<T> held = Reference<T>::held(state.base.reference, c.base.reference);
        const Motion<T> there = moved(motion, signals.reference, held);
        // -K_m q: the acceleration of a motion at the reference's frequency.
        const Vec2<T> resonance = c.base.reference.curvature * there.position;
        const Vec2<T> wanted = plant_force<T>(signals.report, there, resonance) - c.velocity_gain * e.derivative;
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, e.derivative);
        if (missing == nullptr) {
            Base::learn(state.base, c.base, motion, active * e.derivative);
        }
        return signals;
    }
};

}  // namespace fracgyro
