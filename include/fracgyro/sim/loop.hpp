// A whole run on an ideal device, with the gyroscope or another plant.
#pragma once

#include "fracgyro/sim/stepper.hpp"

namespace fracgyro {

// Calls observe(snapshot) at every sample, with the disturbance that disturb(n) gives for sample n. Returns the number
// of samples before the motion diverged, steps + 1 if it did not.
template <Controller C, class Gyroscope = IdealGyroscope<typename C::Value>, class Setup, class Disturb, class Observe>
std::int64_t run_loop(const Setup& setup, Disturb&& disturb, Observe&& observe) {
    using Loop = Stepper<C, Gyroscope>;
    const auto coefficients = copied(Loop::prepare(setup));
    auto state = copied(Loop::begin(setup));
    Loop::run(state, coefficients, setup.steps + 1, disturb, observe);
    return state.step;
}

// The same, with the disturbance of the setup.
template <Controller C, class Params, class Observe>
std::int64_t run_loop(const SetupOf<Params>& setup, Observe&& observe) {
    return run_loop<C>(setup, Disturbance(setup.disturbance, setup.common.step), observe);
}

}  // namespace fracgyro
