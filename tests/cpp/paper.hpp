// Setups for the tests of controllers.
#pragma once

#include "kernel.hpp"

#include "fracgyro/sim/cpu_dispatch.hpp"
#include "fracgyro/sim/loop.hpp"

#include <numbers>
#include <stdexcept>

namespace fracgyro::testing {

inline constexpr std::array<std::string_view, 4> sliding_modes{"fractional_fast_terminal", "fractional",
                                                               "fast_terminal", "linear"};

inline std::size_t kind_of(std::string_view name) {
    const auto found = std::find(controller_kinds.begin(), controller_kinds.end(), name);
    if (found == controller_kinds.end()) {
        throw std::invalid_argument("no such kind");
    }
    return static_cast<std::size_t>(found - controller_kinds.begin());
}

// Settings of a sliding mode controller.
inline SlidingModeParams& law(Setup& setup) {
    SlidingModeParams* found = nullptr;
    with_params(setup.controller, [&]<class Params>(Params& params, auto) {
        if constexpr (std::is_same_v<Params, SlidingModeParams>) {
            found = &params;
        }
    });
    return found != nullptr ? *found : throw std::invalid_argument("no sliding mode");
}

// All inputs of prepare(p, p).
struct Tuning : SlidingModeParams, Common {};
inline Tuning tuning(Setup setup) { return {law(setup), setup.common}; }

template <class C>
typename C::Coefficients prepared(const Setup& setup) {
    return prepare<C>(setup.controller, setup.common);
}

// Calls visit.template operator()<Controller>() for the controller of the setup, without joint adaptation
// (test_joint.cpp), which would double the compile time.
template <Scalar T, class Visit>
void with_light_controller(const Setup& setup, Visit&& visit) {
    with_controller<T>(setup.controller, [&]<class C>() {
        if constexpr (!requires { requires C::estimates_motion; }) {
            visit.template operator()<C>();
        } else {
            throw std::invalid_argument("joint adaptation");
        }
    });
}

// The paper's simulation study, eqs. (48)-(53), in the corrected reading: noise of variance 1, redrawn every step.
inline Setup paper(std::int64_t steps, std::string_view kind = sliding_modes[0]) {
    constexpr double pi = std::numbers::pi;
    constexpr double step = 1e-3;
    Setup setup{.controller = params_of_kind(kind_of(kind))};
    setup.steps = steps;
    setup.plant = {.damping = {0.01, 0.002, 0.01},
                   .stiffness = {355.3, 70.99, 532.9},
                   .rate = 0.1,
                   .initial_position = {0.5, 0.5}};
    setup.common.step = step;
    setup.common.reference = {.frequency = {pi, 0.5 * pi}, .phase = {0.0, 0.5 * pi}};
    setup.common.nominal = {.damping = 0.95 * setup.plant.damping,
                            .stiffness = 0.95 * setup.plant.stiffness,
                            .rate = 0.95 * setup.plant.rate};
    if (ExponentialSum* const kernel = kernel_of(setup.controller)) {
        *kernel = log_trapezoid(0.9, step, static_cast<double>(std::max<std::int64_t>(steps, 1)) * step);
    }
    setup.disturbance = {.kind = DisturbanceKind::noise, .seed = 1};
    return setup;
}

// A linear surface with λ1 = 10, which holds (0, 0) with a force of at most 100; initial K̂ is `stiffness` on both
// axes.
inline Tuning held_at_zero(double stiffness) {
    Tuning p;
    p.reference.amplitude = {0.0, 0.0};
    p.force_limit = 100.0;
    p.adaptation.initial_bound = {0.0, 0.0, 0.0};
    p.nominal.stiffness = {stiffness, 0.0, stiffness};
    return p;
}

}  // namespace fracgyro::testing
