// Disturbance observer around any controller: estimates the force that the nominal plant lacks from the measured
// velocity, and takes it off the controller's force.
//
// Use it for a law without integral action that meets lasting forces or a plant other than the nominal one.
//
//        u = u_law - d̂        d̂ <- d̂ + (1 - exp(-L h))/h (v - v⁻)
//
//    v⁻ is the velocity to which the nominal plant moves in a step, exactly, under u + d̂. At the force limit d̂ follows
//    the acting force, so that nothing winds up; without a sample it is kept. A law that adapts or integrates has a
//    second integrator on the same error then, and what it learns is the nominal plant. An angular rate is part of what
//    is missing: a law that reads it from the motion no longer sees it, unless it asks for the acting force.
//
// Source: textbook (Ohnishi 1987); docs/decisions/0053.
#pragma once

#include "fracgyro/control/disturbance_observer.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/hardware/trigger.hpp"

namespace fracgyro {

template <Scalar T>
struct Compensation {
    static constexpr bool needs_velocity = true;
    using Value = T;
    using Observed = DisturbanceObserver<T>;

    struct Coefficients {
        typename Observed::Coefficients observer{};
        std::array<Matrix2<T>, 2> map{};  // change of v in a step by q, by v
        Matrix2<T> push{};                // by a force
        typename Saturation<T>::Coefficients saturation{};
    };
    struct State {
        typename Observed::State observer{};
        Vec2<T> sent{};  // the force of the prediction
    };

    static Coefficients prepare(const Common& common) {
        const double h = common.step;
        Matrix<6> map = held_plant::without_units(held_plant::both_axes(common.nominal, h), h);
        map[2][2] -= 1.0;
        map[3][3] -= 1.0;
        const auto block = [&](std::size_t column) { return held_plant::block<T>(map, 2, column); };
        return {.observer = Observed::prepare(common.compensation_bandwidth, h),
                .map = {block(0), block(2)},
                .push = block(4),
                .saturation = Saturation<T>::prepare(common.force_limit)};
    }
    static bool sound(const State& state) { return Observed::sound(state.observer); }
    static void start_over(State& state, bool keep_estimates) {
        Observed::start_over(state.observer, keep_estimates);
        state.sent = {};
    }

    // One step of a controller within it, as in MotionFilter.
    template <class Step>
    static auto step(State& state, const Coefficients& c, const Motion<T>& measured, bool missing, Step&& controller) {
        if (!missing) {
            Observed::correct(state.observer, c.observer, {.derivative = measured.velocity});
        }
        auto signals = controller(measured);
        const Vec2<T> wanted = signals.force - state.observer.force;
        signals.force = wanted;
        if (c.saturation.limited) {
            signals.force = Saturation<T>::within(c.saturation, wanted);
            signals.excess = signals.excess + (wanted - signals.force);
        }
        state.sent = signals.force;
        if (missing) {
            Observed::pause(state.observer);
        } else {
            const Vec2<T>& v = measured.velocity;
            state.observer.predicted =
                v + (c.map[0] * measured.position + c.map[1] * v + c.push * (signals.force + state.observer.force));
            state.observer.predicts = true;
        }
        return signals;
    }
    // The force that the last step requested acts as this one.
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        state.observer.predicted = state.observer.predicted + c.push * (force - state.sent);
        state.sent = force;
    }
};

// A controller with the force that the nominal plant lacks taken off.
template <Resumable Controller>
using Compensated = Around<Controller, Compensation<typename Controller::Value>>;

}  // namespace fracgyro
