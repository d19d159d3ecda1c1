// The closed loop one sample at a time, for those who keep the clock themselves. Its samples are those of run_loop.
#pragma once

#include "loop.hpp"

namespace fracgyro {

template <class Controller>
struct Stepper {
    using T = typename Controller::Value;
    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Plant<T>::Coefficients plant{};
    };
    // At one sample: what is known there, and what the next ones need. A plain value: a copy resumes bit for bit.
    struct State {
        std::int64_t step = 0;
        typename Controller::State controller{};
        Motion<T> motion{};
        Signals<T> signals{};
        Vec2<T> disturbance{};

        Snapshot<T> snapshot() const { return {step, motion, signals, disturbance}; }
    };

    static Coefficients prepare(const Setup& setup) {
        return {.controller = Controller::prepare(setup.controller),
                .plant = Plant<T>::prepare(setup.plant, setup.controller.step)};
    }

    // The sample at t = 0.
    static State start(const Setup& setup, const Coefficients& c, Disturbance& disturbance) {
        State state{.motion = Plant<T>::start(setup.plant)};
        look(state, c, disturbance);
        return state;
    }

    // On to the next sample. Returns whether the motion is still bounded; if not, the rest of the state stays behind it.
    static bool advance(State& state, const Coefficients& c, Disturbance& disturbance) {
        Plant<T>::step(state.motion, c.plant, state.signals.force, state.disturbance);  // 6
        if (!(absolute(state.motion.position.x) + absolute(state.motion.position.y) < T(divergence_limit))) {
            return false;
        }
        ++state.step;
        look(state, c, disturbance);
        return true;
    }

private:
    static void look(State& state, const Coefficients& c, Disturbance& disturbance) {
        Vec2<double> drawn;
        disturbance.fill(state.step, {&drawn, 1});
        state.disturbance = {T(drawn.x), T(drawn.y)};
        state.signals = Controller::step(state.controller, c.controller, state.motion);  // 1 to 5
    }
};

}  // namespace fracgyro
