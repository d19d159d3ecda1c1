// What the controllers are tested on.
#pragma once

#include "modes.hpp"

#include "fracgyro/loop.hpp"

#include <numbers>

namespace fracgyro::testing {

// The paper's simulation study, eqs. (48)-(53), in the corrected reading: noise of variance 1, redrawn every step.
inline Setup paper(std::int64_t steps) {
    constexpr double pi = std::numbers::pi;
    constexpr double step = 1e-3;
    Setup setup;
    setup.steps = steps;
    setup.plant = {.damping = {0.01, 0.002, 0.01},
                   .stiffness = {355.3, 70.99, 532.9},
                   .rate = 0.1,
                   .initial = {.position = {0.5, 0.5}}};
    setup.controller.step = step;
    setup.controller.reference = {.frequency = {pi, 0.5 * pi}, .phase = {0.0, 0.5 * pi}};
    setup.controller.surface.modes = log_trapezoid(0.9, step, static_cast<double>(steps) * step);
    setup.controller.adaptation.initial = {.damping = 0.95 * setup.plant.damping,
                                           .stiffness = 0.95 * setup.plant.stiffness,
                                           .rate = 0.95 * setup.plant.rate,
                                           .bound = {0.1, 0.2, 0.3}};
    setup.disturbance = {.kind = DisturbanceKind::noise, .seed = 1};
    return setup;
}

// For a linear surface with λ1 = 10: holding (0, 0) by a force of at most 100, K̂ at first `stiffness` on both axes.
inline ControllerParams held_at_zero(double stiffness) {
    ControllerParams p;
    p.reference.amplitude = {0.0, 0.0};
    p.control.force_limit = 100.0;
    p.adaptation.initial.stiffness = {stiffness, 0.0, stiffness};
    return p;
}

}  // namespace fracgyro::testing
