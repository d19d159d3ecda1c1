// LQG on a joint Kalman filter: one filter estimates motion, damping, stiffness and angular rate, and the feedback has
// the least error for a given smoothness of the force.
//
// Use it when noise and delay of the sensors are known, for tracking and the rate.
//
//        u = u_r + u_f        u_r = (D̂ + 2Ω̂) ṙ + K̂ r + r̈
//
//    with the feedforward u_r at the held point (reference.hpp), and u_f the feedback of smooth_feedback.hpp on e and ė
//    as estimated by the filter of joint.hpp.
//
// Source: textbook; the filter: docs/decisions/0024; the feedback: docs/decisions/0049.
#pragma once

#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/control/smooth_feedback.hpp"
#include "fracgyro/estimation/joint.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

struct LqgParams {
    SmoothFeedbackParams feedback{};
    AdaptationParams adaptation{};  // only forgetting is used
    Datasheet datasheet{};

    static constexpr auto fields() {
        using P = LqgParams;
        return Fields{
            Inner{"controller", &P::feedback},
            Inner{"adaptation", &P::adaptation,
                  joined(AdaptationParams::forgetting_fields(), Fields{AdaptationParams::covariance_field()})},
            Inner{"datasheet", &P::datasheet},
        };
    }
};

template <Scalar T, bool velocity_measured>
struct LqgOf {
    using Value = T;
    using Params = LqgParams;
    using Report = LearnedPlantReport<T>;
    using Filter = JointFilter<T, velocity_measured>;
    using Feedback = SmoothFeedback<T>;
    static constexpr bool measures_velocity = velocity_measured, estimates_motion = true;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Filter::Coefficients filter{};
        typename Feedback::Coefficients feedback{};
        T offset{};  // velocity at a sample over the change of the held force there
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Filter::State filter{};
        typename Feedback::Forces past{};
        Vec2<T> along{};  // u_r, the last one
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.reference = Reference<T>::prepare(common.reference, common.step, p.datasheet.delay),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .filter = Filter::Coefficients::prepare(p.adaptation, p.datasheet, common),
                .feedback = Feedback::prepare(p.feedback, common, p.datasheet.delay),
                .offset = T(-common.step / 12.0)};
    }

    static Report report(const State& state, const Coefficients& c) {
        const PlantModel<T> found = Filter::plant(state.filter, c.filter);
        return {{found.damping, found.stiffness, found.rate},
                Filter::rate_deviation(state.filter, c.filter),
                Filter::trusted(state.filter, c.filter),
                Filter::refused(state.filter)};
    }
    static bool sound(const State& state, const Coefficients& c) { return Filter::sound(state.filter, c.filter); }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        Filter::start_over(state.filter, keep_estimates);
        state.past = {};
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        const bool first = !state.filter.started;
        if (missing == nullptr) {
            Filter::correct(state.filter, c.filter, measured, r);
        }
        Sample<T> e = state.filter.error;
        signals.error = missing != nullptr ? *missing : velocity_measured ? tracking_error(measured, r) : e;
        const typename Feedforward<T>::Coefficients plant{signals.report.damping, signals.report.stiffness,
                                                          T(2.0) * signals.report.rate};
        const Vec2<T> along = Feedforward<T>::force(plant, Reference<T>::held(state.reference, c.reference));
        if (!first) {
            e.derivative = e.derivative - c.offset * (along - state.along);
        }
        state.along = along;
        const Vec2<T> follows = Feedback::force(c.feedback, e, state.past);
        Saturation<T>::apply(signals, c.saturation, along + follows, e.value);
        const Vec2<T>& acts = missing == nullptr ? signals.force : state.filter.force;
        Feedback::remember(c.feedback, state.past, acts - along);
        Filter::predict(state.filter, c.filter, r, acts, missing == nullptr);
        return signals;
    }
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        Filter::acted(state.filter, c.filter, force);
    }
};

template <Scalar T>
using Lqg = LqgOf<T, true>;
template <Scalar T>
struct FromPositions<Lqg<T>> {
    using Type = LqgOf<T, false>;
};

}  // namespace fracgyro
