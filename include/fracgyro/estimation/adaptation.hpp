// Parameters of the adaptations: gradient.hpp, composite.hpp, joint.hpp.
#pragma once

#include "fracgyro/control/estimates.hpp"
#include "fracgyro/core/fields.hpp"

namespace fracgyro {

enum class AdaptationKind { gradient, composite, joint };

struct AdaptationParams {
    AdaptationKind kind = AdaptationKind::gradient;  // composite: the laws and least squares; joint: joint.hpp
    bool adaptive = true;                            // false: the initial estimates are kept
    RateLaw rate_law = RateLaw::skew;
    double damping_gain = 150.0, stiffness_gain = 150.0, rate_gain = 150.0;  // M, N, P
    std::array<double, 3> bound_gain{1.0, 1.6, 1.6};                         // x₀, x₁, x₂
    std::array<double, 3> initial_bound{0.1, 0.2, 0.3};                      // b̂₀, b̂₁, b̂₂
    double leakage = 0.0;     // 1/time: estimates return to their initial values at this rate; 0: off
    double dead_zone = 0.0;   // the laws pause while ‖s‖ is below it; 0: off
    double projection = 0.0;  // maximum deviation, as a fraction of the family's maximum initial entry; 0: off
    double forgetting = 0.0, rate_forgetting = 0.0;  // 1/time, by least squares: all parameters; Ωz in addition; 0: off
    std::int64_t covariance_steps = 1;               // steps per covariance update of joint

    // The adaptation that runs.
    constexpr AdaptationKind runs() const { return adaptive ? kind : AdaptationKind::gradient; }

    static constexpr std::string_view kinds[] = {"gradient", "composite", "joint"}, switches[] = {"false", "true"},
                                      rate_laws[] = {"skew", "printed"};
    static constexpr auto adaptive_field() {
        return in_table("controller",
                        choice("adaptive", &AdaptationParams::adaptive, switches,
                               "Estimates replace true values, (35). false: off, all known, (20), (34)."));
    }
    // Fields of the laws for D, K and Ωz.
    static constexpr auto law_fields() {
        using P = AdaptationParams;
        return Fields{
            field("damping_gain", &P::damping_gain, "m/q0^2", above_0,
                  "M, > 0: speed of the D estimate. Towards 0.0: off."),
            field("stiffness_gain", &P::stiffness_gain, "m*omega0^2/q0^2", above_0,
                  "N, > 0: speed of the K estimate. Towards 0.0: off."),
            field("rate_gain", &P::rate_gain, "1/q0^2", above_0,
                  "P, > 0: speed of the Omega_z estimate. Towards 0.0: off."),
        };
    }
    static constexpr auto robustness_fields() {
        using P = AdaptationParams;
        return Fields{
            field("leakage", &P::leakage, "omega0", at_least_0,
                  "Unit omega0: rate at which estimates leak back to their initial values. 0.0: off."),
            field("dead_zone", &P::dead_zone, "q0*omega0", at_least_0,
                  "Unit of s: adaptation is frozen while ||s|| is below. 0.0: off."),
            field("projection", &P::projection, "1", at_least_0,
                  "Every estimate is kept within this fraction of its family's largest initial entry about its initial "
                  "value. 0.0: off."),
        };
    }
    // Fields of least squares and of the joint filter.
    static constexpr auto forgetting_fields() {
        using P = AdaptationParams;
        return Fields{
            field("forgetting", &P::forgetting, "omega0", at_least_0,
                  "Unit omega0: rate at which composite and joint forget, all parameters alike. 0.0: off."),
            field("rate_forgetting", &P::rate_forgetting, "omega0", at_least_0,
                  "Unit omega0: additional rate at which they forget Omega_z, which is their bandwidth for it: a fast "
                  "rate, a noisy estimate. 0.0: off, Omega_z is taken for constant."),
        };
    }
    static constexpr auto covariance_field() {
        return settable(Settable::beforehand,
                        field("covariance_steps", &AdaptationParams::covariance_steps, "h",
                              Range{.low = 1.0, .high = 8.0, .whole = true},
                              "Steps, at most 8, among which joint divides the work on its covariance, for a "
                              "microcontroller. 1: off, all of it each step."));
    }
    // Fields of a controller with the laws for D, K and Ωz, without bounds.
    static constexpr auto plant_fields() { return joined(Fields{adaptive_field()}, law_fields(), robustness_fields()); }
    constexpr AdaptationParams without_bounds() const {
        AdaptationParams p = *this;
        p.bound_gain = p.initial_bound = {};
        return p;
    }
    static constexpr auto fields() {
        using P = AdaptationParams;
        return joined(
            Fields{
                adaptive_field(),
                in_table("controller",
                         choice("rate_law", &P::rate_law, rate_laws,
                                "Law of the Omega_z estimate, (44): skew, P (s1 v2 - s2 v1); printed: off, it never "
                                "moves.")),
                choice("kind", &P::kind, kinds,
                       "gradient: the laws (44); composite: with least squares on the plant's equation, which "
                       "gives D, K, Omega_z and its standard deviation; joint: a Kalman filter of them and of the "
                       "motion, which "
                       "knows the sensors' noise and needs no velocity. controller.adaptive false: off."),
            },
            law_fields(),
            Fields{
                field("bound_gain", &P::bound_gain, "m*omega0^2, m*omega0^2/q0^2, m/q0^2", above_0,
                      "[x0, x1, x2], > 0: speed of the bound estimates (12). Towards 0.0: off."),
                fixed(field("initial_bound", &P::initial_bound, "m*omega0^2*q0, m*omega0^2, m*omega0", at_least_0,
                            "[b0, b1, b2] at t = 0, units of (12), >= 0: initial switching gain. Zeros: none.")),
            },
            robustness_fields(), forgetting_fields(), Fields{covariance_field()});
    }
};

}  // namespace fracgyro
