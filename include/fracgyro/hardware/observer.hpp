// Velocity observer: estimates the velocity from positions only, for a gyroscope without velocity sensors.
//
//    Each step: predict with the acting force u and the nominal plant, i.e. the initial estimates D̂, K̂, Ω̂z; then
//    correct by the measured position y. With r = y - q⁻:
//
//        q = q⁻ + (1 - θ³) r        v = v⁻ + 3/2 (1 - θ²)(1 - θ) r/h        f = f⁻ + (1 - θ)³ r/h²
//        a = u + f - (D̂ + 2Ω̂) v - K̂ q        q⁻ = q + h v + ½ h² a        v⁻ = v + h a        f⁻ = f
//
//    f is the acceleration missing from the nominal plant. On each axis q, v, f are the critically damped g-h-k (fading
//    memory) filter (Morrison 1969; Brookner, "Tracking and Kalman filtering made easy", 1998, ch. 1), whose error is
//    forgotten by θ = exp(-ω h) per step, three times over: ω is the only parameter, the observer's bandwidth. A
//    missing acceleration that changes at the rate d leaves an error of v of 3 d/ω²; a constant one leaves none.
//    Holding a over the step adds to the missing acceleration: h/2 da/dt.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/core/saved.hpp"

namespace fracgyro {

template <Scalar T>
struct Observer {
    struct Coefficients {
        Sym2<T> damping{}, stiffness{};
        T twice_rate{}, step{}, half_square{};  // 2Ω̂z, h, ½h²
        T position_gain{}, velocity_gain{}, acceleration_gain{};
    };
    struct State {
        Motion<T> motion{};      // predicted for the coming sample
        Vec2<T> acceleration{};  // f
        Kept<T, bool> started = false;
    };

    static Coefficients prepare(const PlantModel<double>& nominal, double bandwidth, double step) {
        const double forgets = exponential(-bandwidth * step);
        const double new_part = 1.0 - forgets;
        return {.damping = cast<T>(nominal.damping),
                .stiffness = cast<T>(nominal.stiffness),
                .twice_rate = T(2.0 * nominal.rate),
                .step = T(step),
                .half_square = T(0.5 * step * step),
                .position_gain = T(1.0 - forgets * forgets * forgets),
                .velocity_gain = T(1.5 * (1.0 - forgets * forgets) * new_part / step),
                .acceleration_gain = T(new_part * new_part * new_part / (step * step))};
    }

    // Corrects by the position measured now. The first one starts the observer, at rest.
    static void correct(State& state, const Coefficients& c, const Vec2<T>& measured) {
        if (!state.started) {
            state = {.motion = {.position = measured}, .started = true};
        }
        const Vec2<T> miss = measured - state.motion.position;
        state.motion.position = state.motion.position + c.position_gain * miss;
        state.motion.velocity = state.motion.velocity + c.velocity_gain * miss;
        state.acceleration = state.acceleration + c.acceleration_gain * miss;
    }

    // Predicts the next sample, under the force held until then.
    static void predict(State& state, const Coefficients& c, const Vec2<T>& force) {
        Vec2<T>& q = state.motion.position;
        Vec2<T>& v = state.motion.velocity;
        const Vec2<T> coriolis = c.twice_rate * turned(v);
        const Vec2<T> a = force + state.acceleration - c.damping * v - coriolis - c.stiffness * q;
        q = q + c.step * v + c.half_square * a;
        v = v + c.step * a;
    }
    // The force of that prediction was larger by this.
    static void more(State& state, const Coefficients& c, const Vec2<T>& force) {
        state.motion.position = state.motion.position + c.half_square * force;
        state.motion.velocity = state.motion.velocity + c.step * force;
    }
};

// A controller that receives only positions: the velocity passed to it is ignored.
template <Resumable Controller>
struct Observing {
    using Value = typename Controller::Value;
    using T = Value;
    using Params = typename Controller::Params;
    using Report = typename Controller::Report;
    static constexpr bool measures_velocity = false;

    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Observer<T>::Coefficients observer{};
    };
    struct State {
        typename Controller::State controller{};
        typename Observer<T>::State observer{};
        Vec2<T> force{};  // the acting force
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.controller = Controller::prepare(p, common),
                .observer = Observer<T>::prepare(common.nominal, common.observer_bandwidth, common.step)};
    }
    static bool sound(const State& state, const Coefficients& c) {
        return Controller::sound(state.controller, c.controller) && fracgyro::sound(state.observer.started);
    }
    static Report report(const State& state, const Coefficients& c) {
        return Controller::report(state.controller, c.controller);
    }
    static std::uint64_t steps(const State& state) { return Controller::steps(state.controller); }
    static void start_over(State& state, bool keep_estimates) {
        Controller::start_over(state.controller, keep_estimates);
        state.observer = {};
        state.force = {};
    }

    // Without a measurement the last force is held, and the observer predicts.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Motion<T> seen = measured;
        if (missing == nullptr) {
            Observer<T>::correct(state.observer, c.observer, measured.position);
            seen.velocity = state.observer.motion.velocity;
        }
        const Signals<T, Report> signals = Controller::step(state.controller, c.controller, seen, missing);
        if (missing == nullptr) {
            state.force = signals.force;
        }
        Observer<T>::predict(state.observer, c.observer, state.force);
        return signals;
    }
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        Observer<T>::more(state.observer, c.observer, force - state.force);
        state.force = force;
        if constexpr (KnowsForce<Controller>) {
            Controller::acted(state.controller, c.controller, force);
        }
    }
};

// The controller for a device without velocity sensors: behind an observer, unless it measures no velocity itself.
template <Resumable Controller>
struct FromPositions {
    using Type = std::conditional_t<measures_velocity<Controller>, Observing<Controller>, Controller>;
};

}  // namespace fracgyro
