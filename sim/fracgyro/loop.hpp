// Page one of the simulator: the six steps of Figure 2 closed into a loop.
#pragma once

#include "disturbance.hpp"
#include "plant.hpp"

#include "fracgyro/registry.hpp"

namespace fracgyro {

// One run. Nondimensional. Params: of any kind, or those of one controller, which need not be in the registry.
template <class Params>
struct SetupOf {
    Params controller{};
    Common common{};
    PlantParams plant{};
    DisturbanceParams disturbance{};
    std::int64_t steps = 0;  // the run has steps + 1 samples, at 0, h, …, steps·h
};
using Setup = SetupOf<ControllerParams>;

// Everything that is known at one sample, for as long as that sample lasts.
template <Scalar T, class Report>
struct Snapshot {
    std::int64_t step;
    const Motion<T>& motion;
    const Signals<T, Report>& signals;
    const Vec2<T>& disturbance;
};

// Motion beyond this is divergence: a tracked reference is of order 1.
inline constexpr double divergence_limit = 1e6;

// Calls observe(snapshot) at every sample, with the disturbance that disturb(n) gives for sample n. Returns the number of
// samples before the motion diverged, steps + 1 if it did not.
template <Controller C, class Params, class Disturb, class Observe>
std::int64_t run_loop(const SetupOf<Params>& setup, Disturb&& disturb, Observe&& observe) {
    using T = typename C::Value;
    const auto controller = prepare<C>(setup.controller, setup.common);
    const auto plant = Plant<T>::prepare(setup.plant, setup.common.step);
    typename C::State state{};
    Motion<T> motion = Plant<T>::start(setup.plant);
    for (std::int64_t n = 0; n <= setup.steps; ++n) {
        const Vec2<double> drawn = disturb(n);
        // Also false for NaN.
        if (!(absolute(motion.position.x) + absolute(motion.position.y) < T(divergence_limit))) {
            return n;
        }
        const Vec2<T> disturbance{T(drawn.x), T(drawn.y)};
        const auto signals = C::step(state, controller, motion);  // 1 to 5
        observe(Snapshot<T, typename C::Report>{
            .step = n, .motion = motion, .signals = signals, .disturbance = disturbance});
        Plant<T>::step(motion, plant, signals.force, disturbance);  // 6
    }
    return setup.steps + 1;
}

// The same, with the disturbance of the setup.
template <Controller C, class Params, class Observe>
std::int64_t run_loop(const SetupOf<Params>& setup, Observe&& observe) {
    Disturbance disturbance(setup.disturbance, setup.common.step);
    std::array<Vec2<double>, 512> coming{};  // in blocks
    const auto disturb = [&](std::int64_t n) {
        const auto place = static_cast<std::size_t>(n) % coming.size();
        if (place == 0) {
            disturbance.fill(n, coming);
        }
        return coming[place];
    };
    return run_loop<C>(setup, disturb, observe);
}

}  // namespace fracgyro
