// What passes between a controller and those around it.
#pragma once

#include "fracgyro/control/error.hpp"
#include "fracgyro/core/fields.hpp"

namespace fracgyro {

// What is known of the plant beforehand, nominally: D, K and Ωz.
template <Scalar T>
struct PlantModel {
    Sym2<T> damping{}, stiffness{};
    T rate{};

    static constexpr auto fields() {
        using M = PlantModel;
        return std::tuple{
            fixed(field("initial_damping", &M::damping, "m*omega0", any_number,
                        "D estimate at t = 0: in a scenario initial_ratio times plant.damping.")),
            fixed(field("initial_stiffness", &M::stiffness, "m*omega0^2", any_number,
                        "K estimate at t = 0: in a scenario initial_ratio times plant.stiffness.")),
            fixed(field("initial_rate", &M::rate, "omega0", any_number,
                        "Omega_z estimate at t = 0: in a scenario initial_ratio times plant.angular_rate, or "
                        "initial_rate.")),
        };
    }
};

// What one step of a controller finds. `excess`: what the force limit took from the force. `report`: what this kind of
// controller reports besides, as it stood when the force was computed.
template <Scalar T, class ReportType>
struct Signals {
    ReferencePoint<T> reference{};
    Sample<T> error{};
    Vec2<T> force{};
    Vec2<T> excess{};
    [[no_unique_address]] ReportType report{};
};

}  // namespace fracgyro
