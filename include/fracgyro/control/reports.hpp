// Reports of controllers: the channels recorded with motion and force.
#pragma once

#include "fracgyro/control/estimates.hpp"
#include "fracgyro/core/fields.hpp"

namespace fracgyro {

// No channels.
struct EmptyReport {
    static constexpr Fields<> fields() { return {}; }
};

// The estimated plant.
template <Scalar T>
struct PlantReport {
    Sym2<T> damping{}, stiffness{};
    T rate{};

    static constexpr auto fields() {
        using R = PlantReport;
        return Fields{
            channel("damping_estimate", &R::damping, "m*omega0", "estimate of the damping D"),
            channel("stiffness_estimate", &R::stiffness, "m*omega0^2", "estimate of the stiffness K"),
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
        };
    }
};

// The estimated plant and a sliding surface.
template <Scalar T>
struct SlidingReport : PlantReport<T> {
    Vec2<T> surface{};

    static constexpr auto fields() {
        using R = SlidingReport;
        return joined(Fields{momentary(channel("surface", &R::surface, "q0*omega0", "sliding surface s"))},
                      PlantReport<T>::fields());
    }
};

// Quality of the rate estimate.
template <class R>
constexpr auto rate_quality_fields() {
    return Fields{channel("rate_deviation", &R::rate_deviation, "omega0",
                          "standard deviation of the estimate of the angular rate; 0 without data"),
                  channel("rate_trusted", &R::rate_trusted, "1",
                          "1 if the motion separates the angular rate from the other parameters and what is "
                          "measured agrees with the model"),
                  channel("sample_refused", &R::sample_refused, "1",
                          "1 if the last sample was too far from the predicted one to learn from")};
}

// The estimated plant, and the quality of the rate estimate.
template <Scalar T>
struct LearnedPlantReport : PlantReport<T> {
    T rate_deviation{}, rate_trusted{}, sample_refused{};

    static constexpr auto fields() {
        return joined(PlantReport<T>::fields(), rate_quality_fields<LearnedPlantReport>());
    }
};

// Sliding surface and estimates. Estimates are those known when the force was computed.
template <Scalar T>
struct AdaptiveReport : Estimates<T> {
    Vec2<T> surface{};

    static constexpr auto fields() {
        using R = AdaptiveReport;
        return Fields{
            momentary(channel("surface", &R::surface, "q0*omega0", "sliding surface s")),
            channel("damping_estimate", &R::damping, "m*omega0", "estimate of the damping D"),
            channel("stiffness_estimate", &R::stiffness, "m*omega0^2", "estimate of the stiffness K"),
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("rate_symmetric_estimate", &R::rate_symmetric, "omega0",
                    "symmetric part of the estimate of Omega; not zero under the printed law only"),
            channel("bound_estimate", &R::bound, "m*omega0^2*q0, m*omega0^2, m*omega0",
                    "estimates of the bounds b0, b1, b2"),
        };
    }
};

// The same, and the quality of the rate estimate.
template <Scalar T>
struct CompositeReport : AdaptiveReport<T> {
    T rate_deviation{};
    T rate_trusted{};
    T sample_refused{};

    static constexpr auto fields() {
        return joined(AdaptiveReport<T>::fields(), rate_quality_fields<CompositeReport>());
    }
};

}  // namespace fracgyro
