// The controller made total, for hardware: whatever the sensors deliver, step() answers with a force within the limit, in
// bounded time, and works on when they do.
//
//    A sample that is not finite or beyond any motion was not measured. The last force is held, the estimates rest, and
//    the error is taken to be the last one, so that the reference and the fractional memory stay in time. Before the
//    first good sample there is no last one: the force is 0 and time does not start.
//
//    A force that is not finite means that the memory is lost, as by gains beyond reason: the last force is held and the
//    controller starts anew with the next sample.
#pragma once

#include "controller.hpp"

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "fracgyro must see NaN and infinity: compile without -ffast-math and -ffinite-math-only"
#endif

namespace fracgyro {

enum class Status {
    ok,
    saturated,     // the force is at its limit
    not_finite,    // an input is NaN or infinite
    out_of_range,  // the input is no motion of a gyroscope
    restarted      // the memory was lost
};

template <class Controller>
struct Guard {
    using T = typename Controller::Value;
    // In reference lengths, and those per unit of time; the sum over both axes. A tracked reference is of order 1.
    static constexpr double largest_motion = 1e6;

    struct State {
        typename Controller::State controller{};
        Sample<T> error{};  // the last that was measured, and the force that answered it
        Vec2<T> force{};
        bool started = false;
    };

    static bool sound(const State& state, const typename Controller::Coefficients& c) {
        return Controller::sound(state.controller, c) && fracgyro::sound(state.started);
    }

    static Status step(State& state, const typename Controller::Coefficients& c, const Motion<T>& measured) {
        T size = sum(measured.position);
        if constexpr (Controller::measures_velocity) {
            size = size + sum(measured.velocity);
        }
        const bool good = size < T(largest_motion);  // false for NaN
        if (!good && !state.started) {
            return fault(size);
        }
        Signals<T> signals = Controller::prospect(state.controller, c);
        const Motion<T> motion = good ? measured
                                      : Motion<T>{.position = signals.reference.position + state.error.value,
                                                  .velocity = signals.reference.velocity + state.error.rate};
        Controller::respond(state.controller, c, motion, signals, good);
        if (!(sum(signals.force) + sum(signals.excess) < infinity)) {
            state.controller = {};
            state.started = false;
            return Status::restarted;
        }
        if (!good) {
            return fault(size);
        }
        state.error = signals.error;
        state.force = signals.force;
        state.started = true;
        return T(0.0) < sum(signals.excess) ? Status::saturated : Status::ok;
    }

private:
    static constexpr T infinity = T(std::numeric_limits<double>::infinity());

    static T sum(const Vec2<T>& a) { return absolute(a.x) + absolute(a.y); }
    static Status fault(T size) { return size < infinity ? Status::out_of_range : Status::not_finite; }
};

}  // namespace fracgyro
