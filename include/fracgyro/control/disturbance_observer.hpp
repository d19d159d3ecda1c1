// Disturbance observer: estimates the force that the nominal plant lacks from the measured velocity, a part for any
// control law.
//
//        d̂ <- d̂ + (1 - exp(-L h))/h (ė - ė⁻)        ė⁻ = ė + h (u - û + d̂)
//
//    with u the acting force and û the one with which the nominal plant would keep ė. A constant force that is missing
//    is found with the time constant 1/L, also under the force limit: nothing winds up. After missing samples the
//    prediction starts over, and d̂ is kept.
//
// Source: textbook (Ohnishi 1987), with the exact gain of a sampled loop: docs/decisions/0051.
#pragma once

#include "fracgyro/control/error.hpp"
#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/saved.hpp"

namespace fracgyro {

template <Scalar T>
struct DisturbanceObserver {
    struct Coefficients {
        T gain{}, step{};  // (1 - exp(-L h))/h, h
    };
    struct State {
        Vec2<T> force{};      // d̂
        Vec2<T> predicted{};  // ė⁻
        Kept<T, bool> predicts = false;
    };

    static Coefficients prepare(double bandwidth, double step) {
        return {.gain = T((1.0 - exponential(-bandwidth * step)) / step), .step = T(step)};
    }
    static bool sound(const State& state) { return fracgyro::sound(state.predicts); }

    static void correct(State& state, const Coefficients& c, const Sample<T>& error) {
        if (state.predicts) {
            state.force = state.force + c.gain * (error.derivative - state.predicted);
        }
    }
    // `accelerates`: u - û.
    static void predict(State& state, const Coefficients& c, const Sample<T>& error, const Vec2<T>& accelerates) {
        state.predicted = error.derivative + c.step * (accelerates + state.force);
        state.predicts = true;
    }
    static void pause(State& state) { state.predicts = false; }
    static void start_over(State& state, bool keep_estimates) {
        state = {.force = keep_estimates ? state.force : Vec2<T>{}};
    }
};

}  // namespace fracgyro
