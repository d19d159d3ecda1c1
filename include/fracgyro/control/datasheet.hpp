// Sensors, actuator and noise, as assumed by a controller.
#pragma once

#include "fracgyro/core/fields.hpp"

namespace fracgyro {

struct Datasheet {
    double force_noise = 0.0, position_noise = 0.0, velocity_noise = 0.0;  // standard deviations, drawn every step
    std::int64_t delay = 0;                                                // steps
    double stiffness_drift = 0.0, damping_drift = 0.0;                     // relative, per unit of time

    static constexpr auto fields() {
        using D = Datasheet;
        constexpr Range delays{.low = 0.0, .high = 8.0, .whole = true};
        return Fields{
            fixed(field("force_noise", &D::force_noise, "m*omega0^2*q0", at_least_0,
                        "Standard deviation of the disturbing force, drawn every step. Not set: the simulated value.")),
            fixed(field("position_noise", &D::position_noise, "q0", at_least_0,
                        "Standard deviation of a measured position, with quantization. Not set: the simulated value.")),
            fixed(field("velocity_noise", &D::velocity_noise, "q0*omega0", at_least_0,
                        "Standard deviation of a measured velocity. Not set: the simulated value.")),
            fixed(field("delay", &D::delay, "h", delays,
                        "Delay of the force in steps, at most 8. Not set: the simulated value.")),
            fixed(field("stiffness_drift", &D::stiffness_drift, "omega0", at_least_0,
                        "Unit omega0: standard deviation of the rate at which the stiffness drifts, as a fraction of "
                        "itself. Not set: the largest of the simulated device.")),
            fixed(field("damping_drift", &D::damping_drift, "omega0", at_least_0, "The same of the damping.")),
        };
    }
};

}  // namespace fracgyro
