// The numbers of a run by name: for faces that are handed numbers and not structs.
//
// Names are those of the scenario's fields, with [0] or .x or .xx for their parts. Values are the core's, nondimensional;
// a switch is 0 or 1 and a choice its place in the list of choices. The modes' rates and weights are handed over beside them.
#pragma once

#include "loop.hpp"

namespace fracgyro {

// Calls visit(name, number) for each, a number being any type that a double can be cast to.
template <class SetupLike, class Visit>
constexpr void for_each_setting(SetupLike& setup, Visit&& visit) {
    auto& [kind, controller, plant, disturbance, steps] = setup;
    visit("run.step", controller.step);
    visit("run.steps", steps);

    auto& reference = controller.reference;
    visit("reference.amplitude.x", reference.amplitude.x);
    visit("reference.amplitude.y", reference.amplitude.y);
    visit("reference.frequency.x", reference.frequency.x);
    visit("reference.frequency.y", reference.frequency.y);
    visit("reference.phase.x", reference.phase.x);
    visit("reference.phase.y", reference.phase.y);

    auto& surface = controller.surface;
    visit("controller.order", surface.modes.order);
    visit("controller.order_gamma", surface.modes.gamma);
    visit("controller.mode_count", surface.modes.count);
    visit("controller.mode_error", surface.modes.error);
    visit("controller.fractional_gain.x", surface.fractional_gain.x);
    visit("controller.fractional_gain.y", surface.fractional_gain.y);
    visit("controller.terminal_gain.x", surface.terminal_gain.x);
    visit("controller.terminal_gain.y", surface.terminal_gain.y);
    visit("controller.terminal_exponent", surface.terminal_exponent);
    visit("controller.singularity_floor", surface.singularity_floor);
    visit("controller.derivative", surface.riemann_liouville);

    auto& control = controller.control;
    visit("controller.layer_thickness", control.layer_thickness);
    visit("controller.layer", control.layer);
    visit("controller.force_limit", control.force_limit);
    visit("controller.switching_limit", control.switching_limit);

    auto& adaptation = controller.adaptation;
    visit("controller.adaptive", adaptation.adaptive);
    visit("controller.rate_law", adaptation.printed_rate_law);
    visit("adaptation.kind", adaptation.composite);
    visit("adaptation.damping_gain", adaptation.damping_gain);
    visit("adaptation.stiffness_gain", adaptation.stiffness_gain);
    visit("adaptation.rate_gain", adaptation.rate_gain);
    visit("adaptation.bound_gain[0]", adaptation.bound_gain[0]);
    visit("adaptation.bound_gain[1]", adaptation.bound_gain[1]);
    visit("adaptation.bound_gain[2]", adaptation.bound_gain[2]);
    visit("adaptation.leakage", adaptation.leakage);
    visit("adaptation.dead_zone", adaptation.dead_zone);
    visit("adaptation.projection", adaptation.projection);
    visit("adaptation.forgetting", adaptation.forgetting);
    visit("adaptation.rate_forgetting", adaptation.rate_forgetting);
    visit("adaptation.initial_damping.xx", adaptation.initial.damping.xx);
    visit("adaptation.initial_damping.xy", adaptation.initial.damping.xy);
    visit("adaptation.initial_damping.yy", adaptation.initial.damping.yy);
    visit("adaptation.initial_stiffness.xx", adaptation.initial.stiffness.xx);
    visit("adaptation.initial_stiffness.xy", adaptation.initial.stiffness.xy);
    visit("adaptation.initial_stiffness.yy", adaptation.initial.stiffness.yy);
    visit("adaptation.initial_rate", adaptation.initial.rate);
    visit("adaptation.initial_bound[0]", adaptation.initial.bound[0]);
    visit("adaptation.initial_bound[1]", adaptation.initial.bound[1]);
    visit("adaptation.initial_bound[2]", adaptation.initial.bound[2]);

    auto& guard = controller.guard;
    visit("guard.checked", guard.checked);
    visit("guard.plant_tolerance", guard.plant_tolerance);
    visit("guard.force_tolerance", guard.force_tolerance);
    visit("guard.position_tolerance", guard.position_tolerance);
    visit("guard.velocity_tolerance", guard.velocity_tolerance);
    visit("guard.patience", guard.patience);
    visit("guard.saturation_patience", guard.saturation_patience);

    visit("plant.damping.xx", plant.damping.xx);
    visit("plant.damping.xy", plant.damping.xy);
    visit("plant.damping.yy", plant.damping.yy);
    visit("plant.stiffness.xx", plant.stiffness.xx);
    visit("plant.stiffness.xy", plant.stiffness.xy);
    visit("plant.stiffness.yy", plant.stiffness.yy);
    visit("plant.damping_deviation.xx", plant.damping_deviation.xx);
    visit("plant.damping_deviation.xy", plant.damping_deviation.xy);
    visit("plant.damping_deviation.yy", plant.damping_deviation.yy);
    visit("plant.stiffness_deviation.xx", plant.stiffness_deviation.xx);
    visit("plant.stiffness_deviation.xy", plant.stiffness_deviation.xy);
    visit("plant.stiffness_deviation.yy", plant.stiffness_deviation.yy);
    visit("plant.angular_rate", plant.rate);
    visit("plant.initial_position.x", plant.initial.position.x);
    visit("plant.initial_position.y", plant.initial.position.y);
    visit("plant.initial_velocity.x", plant.initial.velocity.x);
    visit("plant.initial_velocity.y", plant.initial.velocity.y);

    visit("disturbance.kind", disturbance.kind);
    visit("disturbance.standard_deviation", disturbance.standard_deviation);
    visit("disturbance.hold_steps", disturbance.hold);
    visit("disturbance.seed", disturbance.seed);
    visit("disturbance.amplitude.x", disturbance.amplitude.x);
    visit("disturbance.amplitude.y", disturbance.amplitude.y);
    visit("disturbance.frequency.x", disturbance.frequency.x);
    visit("disturbance.frequency.y", disturbance.frequency.y);
    visit("disturbance.phase.x", disturbance.phase.x);
    visit("disturbance.phase.y", disturbance.phase.y);
}

// Their names, in that order.
inline constexpr auto setting_names = [] {
    constexpr std::size_t count = [] {
        Setup setup{};
        std::size_t seen = 0;
        for_each_setting(setup, [&](std::string_view, auto&) { ++seen; });
        return seen;
    }();
    Setup setup{};
    std::array<std::string_view, count> names{};
    std::size_t at = 0;
    for_each_setting(setup, [&](std::string_view name, auto&) { names[at++] = name; });
    return names;
}();

// Takes every number from `values`, in that order.
inline void take_settings(Setup& setup, const double* values) {
    for_each_setting(setup, [&](std::string_view, auto& field) {
        field = static_cast<std::remove_reference_t<decltype(field)>>(*values++);
    });
}

}  // namespace fracgyro
