// Linear-quadratic control on a joint Kalman filter: one filter estimates motion, damping, stiffness and angular rate,
// and the feedback on its estimate is optimal.
//
// Use it when the sensors are noisy and their noise and delay are known, for tracking and for the rate.
//
//        u = (D̂ + 2Ω̂) ṙ + K̂ r + r̈ - ω² e - √2 ω ė
//
//    with the feedforward at the held point (reference.hpp), and e and ė as estimated by the filter of joint.hpp. The
//    feedback is optimal for ë = u with the weights ω⁴ of e² and 1 of u²: far below ω the plant's own forces on e are
//    negligible.
//
// Source: textbook; the filter: docs/decisions/0024.
#pragma once

#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/shared_fields.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/estimation/joint.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

struct LqgParams {
    double natural_frequency = 200.0;  // ω
    AdaptationParams adaptation{};     // only forgetting is used
    Datasheet datasheet{};

    static constexpr auto fields() {
        using P = LqgParams;
        return std::tuple{
            loop_frequency_field(&P::natural_frequency),
            Inner{"adaptation", &P::adaptation,
                  std::tuple_cat(AdaptationParams::forgetting_fields(),
                                 std::tuple{AdaptationParams::covariance_field()})},
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
    static constexpr bool measures_velocity = velocity_measured, estimates_motion = true;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Filter::Coefficients filter{};
        T position_gain{}, velocity_gain{};
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Filter::State filter{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.reference = Reference<T>::prepare(common.reference, common.step, p.datasheet.delay),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .filter = Filter::Coefficients::prepare(p.adaptation, p.datasheet, common),
                .position_gain = T(p.natural_frequency * p.natural_frequency),
                .velocity_gain = T(1.41421356237309504880 * p.natural_frequency)};
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
    static void start_over(State& state, bool keep_estimates) { Filter::start_over(state.filter, keep_estimates); }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        if (missing == nullptr) {
            Filter::correct(state.filter, c.filter, measured, r);
        }
        const Sample<T>& e = state.filter.error;
        signals.error = missing != nullptr ? *missing : velocity_measured ? tracking_error(measured, r) : e;
        const typename Feedforward<T>::Coefficients known{signals.report.damping, signals.report.stiffness,
                                                          T(2.0) * signals.report.rate};
        const Vec2<T> wanted = Feedforward<T>::force(known, Reference<T>::held(state.reference, c.reference)) -
                               c.position_gain * e.value - c.velocity_gain * e.derivative;
        Saturation<T>::apply(signals, c.saturation, wanted, e.value);
        const Vec2<T>& acts = missing == nullptr ? signals.force : state.filter.force;
        Filter::predict(state.filter, c.filter, r, acts, missing == nullptr);
        return signals;
    }
};

template <Scalar T>
using Lqg = LqgOf<T, true>;
template <Scalar T>
struct FromPositions<Lqg<T>> {
    using Type = LqgOf<T, false>;
};

}  // namespace fracgyro
