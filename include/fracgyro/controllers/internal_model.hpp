// Internal model: a constant Kalman filter estimates the motion and the sinusoidal forces that the nominal plant lacks.
//
// Use it when only tracking counts, the reference is a sum of sines, and a step must take little time.
//
//        u = u_r - w + u_f        w = w_0 + w_1 + w_2
//
//    with u_r the held force that keeps the nominal plant on the reference at every sample, and u_f the feedback of
//    smooth_feedback.hpp on the estimated e and ė. On each axis w is the sum of a constant and of an oscillator at each
//    frequency of the reference, at most four; a reference that is not a sum of sines has the constant only. All gains
//    are constant. It does not adapt D, K or Ωz, and reports no rate.
//
// Source: textbook; docs/decisions/0047.
#pragma once

#include "fracgyro/control/saturation.hpp"
#include "fracgyro/controllers/internal_model_design.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

template <Scalar T, bool velocity_measured>
struct InternalModelOf {
    using Value = T;
    using Params = InternalModelParams;
    using Report = EmptyReport;
    using Design = InternalModelDesign;
    using Feedback = SmoothFeedback<T>;
    static constexpr bool measures_velocity = velocity_measured;
    static constexpr std::size_t sensors = velocity_measured ? 2 : 1;  // positions, velocities

    using Gain = FilterGain<T, sensors>;
    struct Oscillator {
        SineCosine<T> turn{}, ahead{};  // by a step, by the delay
        Gain cosine{}, sine{};
        T ripple{};  // velocity at the samples over its sine
    };
    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        std::array<Matrix2<T>, 3> feedforward{};  // for r, ṙ, r̈
        Matrix2<T> ripple{};                      // ė between the held forces u_r, of ṙ
        std::array<Matrix2<T>, 4> map{};          // F: e of e, e of ė, ė of e, ė of ė
        std::array<Vec2<T>, 2> push{};            // G
        Gain position{}, velocity{}, constant{};  // gains of the filter
        std::array<Oscillator, Design::max_frequencies> oscillators{};
        typename Feedback::Coefficients feedback{};
        std::int32_t frequencies = 0, delay = 0;
        bool accelerates = false;  // r̈ has a force of its own
    };
    struct State {
        typename Reference<T>::State reference{};
        Sample<T> error{};  // z, predicted
        Vec2<T> constant{};
        std::array<Vec2<T>, Design::max_frequencies> cosine{}, sine{};
        typename Feedback::Forces past{};
        Vec2<T> force{};  // the acting force
        Kept<T, bool> started = false;
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const Design found = Design::prepare(p, common, velocity_measured);
        const auto of_columns = [](const Design::Columns& a) { return Matrix2<T>{cast<T>(a[0]), cast<T>(a[1])}; };
        const auto gain = [&](std::size_t state) { return Gain::prepare(found.filter, state); };
        Coefficients c{.reference = Reference<T>::prepare(common.reference, common.step),
                       .saturation = Saturation<T>::prepare(common.force_limit),
                       .position = gain(0),
                       .velocity = gain(1),
                       .constant = gain(2),
                       .feedback = Feedback::prepare(p.feedback, common, p.datasheet.delay),
                       .frequencies = static_cast<std::int32_t>(found.count),
                       .delay = static_cast<std::int32_t>(p.datasheet.delay)};
        const double h = common.step;
        for (std::size_t i = 0; i < 3; ++i) {
            c.feedforward[i] = of_columns(found.feedforward[i]);
        }
        for (const Vec2<double>& column : found.feedforward[2]) {
            c.accelerates = c.accelerates || squared_norm(column) > 0.0;
        }
        c.ripple = of_columns(found.ripple);
        const Matrix<6> map = held_plant::without_units(found.map, h);
        const auto block = [&](std::size_t row, std::size_t column) { return held_plant::block<T>(map, row, column); };
        c.map = {block(0, 0), block(0, 2), block(2, 0), block(2, 2)};
        c.push = {Vec2<T>{T(map[0][4]), T(map[1][5])}, Vec2<T>{T(map[2][4]), T(map[3][5])}};
        for (std::size_t i = 0; i < found.count; ++i) {
            const double angle = found.frequencies[i] * h, late = static_cast<double>(p.datasheet.delay) * angle;
            const auto turn = sine_cosine<double>(phase_of(angle)), ahead = sine_cosine<double>(phase_of(late));
            c.oscillators[i] = {.turn = {T(turn.sine), T(turn.cosine)},
                                .ahead = {T(ahead.sine), T(ahead.cosine)},
                                .cosine = gain(3 + 2 * i),
                                .sine = gain(4 + 2 * i),
                                .ripple = T(found.ripple_of(i))};
        }
        return c;
    }

    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State& state, const Coefficients&) { return fracgyro::sound(state.started); }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        State fresh{.reference = state.reference};
        if (keep_estimates) {
            fresh.constant = state.constant;
            fresh.cosine = state.cosine;
            fresh.sine = state.sine;
        }
        state = fresh;
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference)};
        const ReferencePoint<T>& r = signals.reference;
        Sample<T>& z = state.error;
        if (missing == nullptr) {
            correct(state, c, measured, r);
        }
        signals.error = missing != nullptr ? *missing : velocity_measured ? tracking_error(measured, r) : z;

        Vec2<T> follows = Feedback::force(c.feedback, z, state.past);
        Vec2<T> known = c.feedforward[0] * r.position + c.feedforward[1] * r.velocity - state.constant;
        if (c.accelerates) {
            known = known + c.feedforward[2] * r.acceleration;
        }
        for (std::size_t i = 0; i < static_cast<std::size_t>(c.frequencies); ++i) {
            const SineCosine<T>& ahead = c.oscillators[i].ahead;
            known =
                known - (c.delay == 0 ? state.cosine[i] : ahead.cosine * state.cosine[i] + ahead.sine * state.sine[i]);
        }
        Saturation<T>::apply(signals, c.saturation, known + follows, z.value);
        if (missing == nullptr) {
            state.force = signals.force;
            follows = follows - signals.excess;
        } else {
            follows = state.force - known;  // the force that is held
        }
        predict(state, c, follows);
        return signals;
    }

private:
    static void correct(State& state, const Coefficients& c, const Motion<T>& measured, const ReferencePoint<T>& r) {
        Sample<T>& z = state.error;
        Sample<T> seen = tracking_error(measured, r);
        if constexpr (velocity_measured) {
            seen.derivative = seen.derivative - c.ripple * r.velocity;
            for (std::size_t i = 0; i < static_cast<std::size_t>(c.frequencies); ++i) {
                seen.derivative = seen.derivative - c.oscillators[i].ripple * state.sine[i];
            }
        }
        if (!state.started) {
            state.started = true;
            z = {.value = seen.value, .derivative = velocity_measured ? seen.derivative : -r.velocity};  // at rest
            return;
        }
        const Sample<T> miss{.value = seen.value - z.value, .derivative = seen.derivative - z.derivative};
        z.value = z.value + c.position.times(miss.value, miss.derivative);
        z.derivative = z.derivative + c.velocity.times(miss.value, miss.derivative);
        state.constant = state.constant + c.constant.times(miss.value, miss.derivative);
        for (std::size_t i = 0; i < static_cast<std::size_t>(c.frequencies); ++i) {
            state.cosine[i] = state.cosine[i] + c.oscillators[i].cosine.times(miss.value, miss.derivative);
            state.sine[i] = state.sine[i] + c.oscillators[i].sine.times(miss.value, miss.derivative);
        }
    }

    // The coming sample; `follows` acts after the delay.
    static void predict(State& state, const Coefficients& c, const Vec2<T>& follows) {
        Feedback::remember(c.feedback, state.past, follows);
        const Vec2<T> acts = state.past[static_cast<std::size_t>(c.delay)];
        const Sample<T> z = state.error;
        state.error = {.value = c.map[0] * z.value + c.map[1] * z.derivative + c.push[0] * acts,
                       .derivative = c.map[2] * z.value + c.map[3] * z.derivative + c.push[1] * acts};
        for (std::size_t i = 0; i < static_cast<std::size_t>(c.frequencies); ++i) {
            const SineCosine<T>& turn = c.oscillators[i].turn;
            const Vec2<T> cosine = state.cosine[i];
            state.cosine[i] = turn.cosine * cosine + turn.sine * state.sine[i];
            state.sine[i] = turn.cosine * state.sine[i] - turn.sine * cosine;
        }
    }
};

template <Scalar T>
using InternalModel = InternalModelOf<T, true>;
template <Scalar T>
struct FromPositions<InternalModel<T>> {
    using Type = InternalModelOf<T, false>;
};

}  // namespace fracgyro
