// Plausibility of samples: the decision which to accept.
//
//    A sample is rejected if it is not finite, beyond any motion or, with `checked`, one to which the plant cannot have
//    moved under the force that acted. With (q₀, v₀) the last sample, (q₁, v₁) this one and 1-norms over both axes:
//
//        ‖q₁ - q₀ - h/2 (v₀ + v₁)‖ <= τ h ‖v₁‖ + 4 Q + 2 h V
//        ‖v₁ - v₀ - h u + h/2 K̂ (q₀ + q₁)‖ <= h (τ ‖K̂‖ ‖q₁‖ + ‖D̂ + 2Ω̂‖ ‖v₁‖ + 2 F) + 4 V + 2 h ‖K̂‖ Q
//
//    Q, V, F: maximum errors of the sensors and maximum disturbance, per axis; τ: relative deviation of the plant and
//    of the sensors' scales from nominal. Damping and the Coriolis force are bounded instead of computed. With
//    positions only, v₀ is their last difference, and the second difference is checked against the force.
//
//    The plant is predicted instead of a rejected sample, together with the error that this may have. After `patience`
//    of them in a row, or if one contradicts a few, no sample is accepted until four times as many agree with each
//    other.
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/signals.hpp"

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "fracgyro must see NaN and infinity: compile without -ffast-math and -ffinite-math-only"
#endif

namespace fracgyro {

template <Scalar T, bool measures_velocity>
struct Plausibility {
    // In reference lengths, and reference lengths per unit of time; the sum over both axes. A tracked reference is of
    // order 1.
    static constexpr double largest_motion = 1e6;
    // Samples needed before the one to check.
    static constexpr std::uint32_t needed = measures_velocity ? 1 : 2;

    struct Coefficients {
        Sym2<T> half_stiffness{};  // h/2 K̂
        T step{}, half_step{}, inverse_step{};
        T position_limit{}, position_per_velocity{};
        T velocity_limit{}, velocity_per_position{}, velocity_per_velocity{};
        bool checked = false;
        std::uint32_t patience = 0, agreeing = 0;
    };
    struct State {
        Motion<T> motion{};                    // the last sample, or its prediction
        T position_slack{}, velocity_slack{};  // additional error that it may have
        Kept<T, std::uint32_t> chain = 0;      // consecutive samples that agree, up to the number needed
        Kept<T, std::uint32_t> refused = 0;    // consecutive rejections
        Kept<T, bool> settled =
            false;  // enough samples agree, and none was rejected since: the counts above follow from it
        Kept<T, bool> doubted = false;  // no sample is accepted for now
    };
    enum class Answer { accepted, missed, none };  // none: without a last sample to continue from

    static Coefficients prepare(const GuardParams& g, const PlantModel<double>& nominal, double h) {
        const double stiffness = norm1(nominal.stiffness);
        // The error of the trapezoid rule counts as a deviation of the plant.
        const double tolerance = g.plant_tolerance + stiffness * h * h / 12.0;
        const double left_out = norm1(nominal.damping) + 2.0 * absolute(nominal.rate);
        const Sym2<double> half = (0.5 * h) * nominal.stiffness;
        const double sensed = measures_velocity ? 4.0 * g.velocity_tolerance : 8.0 * g.position_tolerance / h;
        const auto patience = static_cast<std::uint32_t>(g.patience);
        return {.half_stiffness = cast<T>(half),
                .step = T(h),
                .half_step = T(0.5 * h),
                .inverse_step = T(1.0 / h),
                .position_limit = T(4.0 * g.position_tolerance + 2.0 * h * g.velocity_tolerance),
                .position_per_velocity = T(h * tolerance),
                .velocity_limit = T(2.0 * h * g.force_tolerance + sensed + 2.0 * h * stiffness * g.position_tolerance),
                .velocity_per_position = T(h * tolerance * stiffness),
                .velocity_per_velocity = T(h * left_out),
                .checked = g.checked,
                .patience = patience,
                .agreeing = maximum(4 * patience, needed + 1)};
    }

    // `force`: acted since the last sample. `going`: a last accepted sample exists. `status` states the reason for a
    // rejection.
    static Answer judge(State& state, const Coefficients& c, const Motion<T>& measured, const Vec2<T>& force,
                        bool going, Status& status) {
        status = problem(state, c, measured, force);
        return status == Status::ok ? take(state, c, measured, force, status)
                                    : refuse(state, c, measured, force, going, status);
    }

private:
    static T sum(const Vec2<T>& a) { return absolute(a.x()) + absolute(a.y()); }
    static double norm1(const Sym2<double>& a) {
        return absolute(a.xy()) + maximum(absolute(a.xx()), absolute(a.yy()));
    }

    static Status problem(const State& state, const Coefficients& c, const Motion<T>& measured, const Vec2<T>& force) {
        const T position = sum(measured.position);
        T size = position, velocity{};
        if constexpr (measures_velocity) {
            velocity = sum(measured.velocity);
            size = size + velocity;
        }
        if (!(size < T(largest_motion))) {  // also true for NaN
            return size < T(std::numeric_limits<double>::infinity()) ? Status::out_of_range : Status::not_finite;
        }
        if (!c.checked || (!state.settled && state.chain < needed)) {
            return Status::ok;
        }
        const Motion<T>& last = state.motion;
        Vec2<T> missed;
        if constexpr (measures_velocity) {
            const Vec2<T> moved = measured.position - last.position;
            missed = moved - c.half_step * (last.velocity + measured.velocity);
            T limit = c.position_limit + c.position_per_velocity * velocity;
            if (!state.settled) {
                limit = limit + state.position_slack;
            }
            if (limit < sum(missed)) {
                return Status::implausible;
            }
            missed = (measured.velocity - last.velocity) - c.step * force +
                     c.half_stiffness * (last.position + measured.position);
        } else {
            missed = c.inverse_step * (measured.position - predicted(state, c, force).position);
            velocity = sum(last.velocity);
        }
        T limit = c.velocity_limit + c.velocity_per_position * position + c.velocity_per_velocity * velocity;
        if (!state.settled) {
            limit = limit + state.velocity_slack;
        }
        return limit < sum(missed) ? Status::implausible : Status::ok;
    }

    static Answer take(State& state, const Coefficients& c, const Motion<T>& measured, const Vec2<T>& force,
                       Status& status) {
        if (c.checked) {
            remember(state, c, measured, force);
        }
        if (!state.settled) {
            state.chain = minimum(state.chain + 1, c.agreeing);
            // After a gap the slack stays for one more sample: with positions only, one difference reaches back.
            const bool gap = 0 < state.refused;
            state.refused = 0;
            if (!gap) {
                state.position_slack = state.velocity_slack = T(0.0);
            }
            if (state.doubted && c.checked && state.chain < c.agreeing) {
                status = Status::lost;
                return Answer::none;
            }
            state.doubted = false;
            state.settled = !gap && state.chain == c.agreeing;
        }
        return Answer::accepted;
    }

    static Answer refuse(State& state, const Coefficients& c, const Motion<T>& measured, const Vec2<T>& force,
                         bool going, Status& status) {
        const bool implausible = status == Status::implausible;
        state.settled = false;
        if (going && !(implausible && state.chain < c.agreeing)) {
            ++state.refused;
            if (c.patience == 0 || state.refused < c.patience) {
                predict(state, c, force);
                return Answer::missed;
            }
        }
        state.position_slack = state.velocity_slack = T(0.0);
        state.refused = state.chain = 0;
        if (implausible) {  // the next sample is checked against it
            remember(state, c, measured, force);
            state.chain = 1;
        }
        return Answer::none;
    }

    static void remember(State& state, const Coefficients& c, const Motion<T>& measured, const Vec2<T>& force) {
        if constexpr (measures_velocity) {
            state.motion = measured;
        } else {
            const Vec2<T> mean = c.inverse_step * (measured.position - state.motion.position);
            state.motion.velocity = mean + (c.half_step * force - c.half_stiffness * measured.position);
            state.motion.position = measured.position;
        }
    }

    // Nominal motion of the plant at the next sample.
    static Motion<T> predicted(const State& state, const Coefficients& c, const Vec2<T>& force) {
        const Motion<T>& last = state.motion;
        const Vec2<T> half_way = last.position + c.half_step * last.velocity;
        const Vec2<T> velocity = last.velocity + (c.step * force - T(2.0) * (c.half_stiffness * half_way));
        return {.position = last.position + c.half_step * (last.velocity + velocity), .velocity = velocity};
    }
    // Predicts a sample instead of measuring it.
    static void predict(State& state, const Coefficients& c, const Vec2<T>& force) {
        if (!c.checked) {
            return;
        }
        state.motion = predicted(state, c, force);
        const T position = sum(state.motion.position), velocity = sum(state.motion.velocity);
        state.velocity_slack = state.velocity_slack + c.velocity_limit + c.velocity_per_position * position +
                               c.velocity_per_velocity * velocity;
        state.position_slack = state.position_slack + c.position_limit + c.position_per_velocity * velocity +
                               c.step * state.velocity_slack;
    }
};

}  // namespace fracgyro
