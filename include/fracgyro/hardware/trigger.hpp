// Event trigger: the controller runs each step, and its force is sent only if it differs enough from the one that acts.
//
// Use it when each force that is sent costs something: a bus, a converter's energy.
//
//        a new force is sent if  |u - u_sent| >= a + b |u_sent|  on either axis
//
//    The acting force is within a + b |u_sent| of that of the law, an additional bounded disturbance: below the noise
//    of the law's force, every step sends. Observer, filter and laws that ask for the acting force know the sent one.
//
// Source: textbook; docs/decisions/0053.
#pragma once

#include "fracgyro/hardware/around.hpp"

namespace fracgyro {

template <Scalar T>
struct Trigger {
    using Value = T;
    struct Coefficients {
        T threshold{}, share{};  // a, b
    };
    struct State {
        Vec2<T> sent{};
    };

    static Coefficients prepare(const Common& common) {
        return {.threshold = T(common.trigger.threshold), .share = T(common.trigger.share)};
    }

    static bool sound(const State&) { return true; }  // numbers only

    // The force that acts. A wanted one that is not a number is sent, as only the guard knows what to do with it.
    static Vec2<T> sent(State& state, const Coefficients& c, const Vec2<T>& wanted) {
        const Vec2<T> differs = absolute(wanted - state.sent);
        const Vec2<T> allowed = Vec2<T>{c.threshold, c.threshold} + c.share * absolute(state.sent);
        const T zero = T(0.0), one = T(1.0);
        const T keeps = if_less(differs.x(), allowed.x(), one, zero) * if_less(differs.y(), allowed.y(), one, zero);
        state.sent = if_less({zero, zero}, {keeps, keeps}, state.sent, wanted);
        return state.sent;
    }

    // One step of a controller whose force is sent by events, as in MotionFilter.
    template <class Step>
    static auto step(State& state, const Coefficients& c, const Motion<T>& measured, bool /*missing*/,
                     Step&& controller) {
        auto signals = controller(measured);
        signals.force = sent(state, c, signals.force);
        return signals;
    }
    // The sent force still acts.
    static void start_over(State&, bool /*keep_estimates*/) {}
};

// A controller whose force is sent by events.
template <Resumable Controller>
using Triggered = Around<Controller, Trigger<typename Controller::Value>>;

}  // namespace fracgyro
