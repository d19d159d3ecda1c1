// Adaptive control without a sliding surface (Park and Horowitz 2003, doi 10.1109/JMEMS.2002.807468; its structure is
// cited from memory and from the nomenclature of Sensors 2016, 16, 321). For a sinusoidal reference, r̈ = -K_m r,
//
//        u = (D̂ + 2Ω̂) v + K̂ q - K_m q - γ ė,      so that  ë + γ ė + K_m e = -Φᵀθ̃
//
//    and the estimates follow the laws (44) with ė in the place of s. Only K_m brings the position back: off
//    resonance, where K_m is far below K, no γ makes the error small. The method is designed for operation at
//    resonance.
#pragma once

#include "fracgyro/control/gradient.hpp"
#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/reference.hpp"

namespace fracgyro {

struct ParkHorowitzParams {
    double velocity_gain = 10.0;    // γ
    AdaptationParams adaptation{};  // of which the bounds are not used

    static constexpr auto fields() {
        using P = ParkHorowitzParams;
        return std::tuple{
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
    using Laws = GradientAdaptation<T>;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Laws::Coefficients adaptation{};
        T velocity_gain{};
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Laws::State adaptation{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.reference = Reference<T>::prepare(common.reference, common.step),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .adaptation = Laws::prepare(p.adaptation.without_bounds(), common.nominal, common.step),
                .velocity_gain = T(p.velocity_gain)};
    }

    static Report report(const State& state, const Coefficients& c) {
        const Estimates<T> e = Laws::estimates(state.adaptation, c.adaptation);
        return {.damping = e.damping, .stiffness = e.stiffness, .rate = e.rate};
    }
    static bool sound(const State&, const Coefficients&) { return true; }  // all of it is numbers
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        if (!keep_estimates) {
            state.adaptation = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        const Motion<T> motion{.position = r.position + e.value, .velocity = r.velocity + e.derivative};
        // -K_m q: what a motion of the reference's frequency is accelerated by.
        const Vec2<T> resonance = c.reference.curvature * motion.position;
        const Vec2<T> wanted = plant_force<T>(signals.report, motion, resonance) - c.velocity_gain * e.derivative;
        const T active = Saturation<T>::apply(signals, c.saturation, wanted, e.derivative);
        if (missing == nullptr) {
            const Vec2<T> learnt_from = active * e.derivative;
            Laws::update(state.adaptation, c.adaptation, motion, learnt_from, norms_of(motion, learnt_from));
        }
        return signals;
    }
};

}  // namespace fracgyro
