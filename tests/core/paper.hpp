// The paper's simulation study, eqs. (48)-(53), in the corrected reading: noise of variance 1, redrawn every step.
#pragma once

#include "modes.hpp"

#include "fracgyro/loop.hpp"

#include <numbers>

namespace fracgyro::testing {

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

}  // namespace fracgyro::testing
