// The closed loop one sample at a time, for those who keep the clock themselves. Its samples are those of run_loop.
#pragma once

#include "loop.hpp"

namespace fracgyro {

template <Controller C>
struct Stepper {
    using T = typename C::Value;
    using Report = typename C::Report;
    struct Coefficients {
        typename C::Coefficients controller{};
        typename Plant<T>::Coefficients plant{};
    };
    // At one sample: what is known there, and what the next ones need. A plain value: a copy resumes bit for bit.
    struct State {
        std::int64_t step = 0;
        typename C::State controller{};
        Motion<T> motion{};
        Signals<T, Report> signals{};
        Vec2<T> disturbance{};

        Snapshot<T, Report> snapshot() const { return {step, motion, signals, disturbance}; }
    };

    template <class Params>
    static Coefficients prepare(const SetupOf<Params>& setup) {
        return {.controller = fracgyro::prepare<C>(setup.controller, setup.common),
                .plant = Plant<T>::prepare(setup.plant, setup.common.step)};
    }

    // The sample at t = 0.
    template <class Params>
    static State start(const SetupOf<Params>& setup, const Coefficients& c, Disturbance& disturbance) {
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
        state.signals = C::step(state.controller, c.controller, state.motion);  // 1 to 5
    }
};

}  // namespace fracgyro
