// Base of the controllers whose estimates follow the laws (44), with or without a small memory of their own.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/estimation/gradient.hpp"

namespace fracgyro {

template <Scalar T>
struct Adaptive {
    using Laws = GradientAdaptation<T>;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Laws::Coefficients adaptation{};
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Laws::State adaptation{};
    };

    static Coefficients prepare(const AdaptationParams& p, const Common& common) {
        return {.reference = Reference<T>::prepare(common.reference, common.step),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .adaptation = Laws::prepare(p.without_bounds(), common.nominal, common.step)};
    }

    static PlantReport<T> report(const State& state, const Coefficients& c) {
        const Estimates<T> e = Laws::estimates(state.adaptation, c.adaptation);
        return {.damping = e.damping, .stiffness = e.stiffness, .rate = e.rate};
    }

    static void start_over(State& state, bool keep_estimates) {
        if (!keep_estimates) {
            state.adaptation = {};
        }
    }

    // Updates the reference and the error of this step; returns the motion, which follows from the error if no sample
    // was measured.
    template <class Signals>
    static Motion<T> begin(State& state, const Coefficients& c, Signals& signals, const Motion<T>& measured,
                           const Sample<T>* missing) {
        const ReferencePoint<T>& r = signals.reference = Reference<T>::update(state.reference, c.reference);
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        return {.position = r.position + e.value, .velocity = r.velocity + e.derivative};
    }

    // `learned_from` replaces s in the laws; it is 0 if the force limit stops them from learning.
    static void learn(State& state, const Coefficients& c, const Motion<T>& motion, const Vec2<T>& learned_from) {
        Laws::update(state.adaptation, c.adaptation, motion, learned_from, norms_of(motion, learned_from));
    }
};

}  // namespace fracgyro
