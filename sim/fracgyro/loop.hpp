// Page one of the simulator: the six steps of Figure 2 closed into a loop.
#pragma once

#include "controllers.hpp"
#include "disturbance.hpp"
#include "plant.hpp"

namespace fracgyro {

// One run. Nondimensional.
struct Setup {
    std::string_view kind = "fractional_fast_terminal";  // one of controller_kinds
    ControllerParams controller{};
    PlantParams plant{};
    DisturbanceParams disturbance{};
    std::int64_t steps = 0;  // the run has steps + 1 samples, at 0, h, …, steps·h
};

// Everything that is known at one sample, for as long as that sample lasts.
template <Scalar T>
struct Snapshot {
    std::int64_t step;
    const Motion<T>& motion;
    const Signals<T>& signals;
    const Vec2<T>& disturbance;
};

// Motion beyond this is divergence: a tracked reference is of order 1.
inline constexpr double divergence_limit = 1e6;

// Calls observe(snapshot) at every sample, with the disturbance that disturb(n) gives for sample n. Returns the number of
// samples before the motion diverged, steps + 1 if it did not.
template <class Controller, class Disturb, class Observe>
std::int64_t run_loop(const Setup& setup, Disturb&& disturb, Observe&& observe) {
    using T = typename Controller::Value;
    const auto controller = Controller::prepare(setup.controller);
    const auto plant = Plant<T>::prepare(setup.plant, setup.controller.step);
    typename Controller::State state{};
    Motion<T> motion = Plant<T>::start(setup.plant);
    for (std::int64_t n = 0; n <= setup.steps; ++n) {
        const Vec2<double> drawn = disturb(n);
        // Also false for NaN.
        if (!(absolute(motion.position.x) + absolute(motion.position.y) < T(divergence_limit))) {
            return n;
        }
        const Vec2<T> disturbance{T(drawn.x), T(drawn.y)};
        const Signals<T> signals = Controller::step(state, controller, motion);  // 1 to 5
        observe(Snapshot<T>{.step = n, .motion = motion, .signals = signals, .disturbance = disturbance});
        Plant<T>::step(motion, plant, signals.force, disturbance);  // 6
    }
    return setup.steps + 1;
}

// The same, with the disturbance of the setup.
template <class Controller, class Observe>
std::int64_t run_loop(const Setup& setup, Observe&& observe) {
    Disturbance disturbance(setup.disturbance, setup.controller.step);
    std::array<Vec2<double>, 512> coming{};  // in blocks
    const auto disturb = [&](std::int64_t n) {
        const auto place = static_cast<std::size_t>(n) % coming.size();
        if (place == 0) {
            disturbance.fill(n, coming);
        }
        return coming[place];
    };
    return run_loop<Controller>(setup, disturb, observe);
}

}  // namespace fracgyro
