// Signals between a controller and its loop.
#pragma once

#include "fracgyro/control/error.hpp"
#include "fracgyro/core/fields.hpp"

namespace fracgyro {

// The nominal plant, known beforehand: D, K and Ωz.
template <Scalar T>
struct PlantModel {
    Sym2<T> damping{}, stiffness{};
    T rate{};

    static constexpr auto fields() {
        using M = PlantModel;
        return Fields{
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

enum class Status : std::uint8_t {
    ok = 0,
    saturated = 1,     // the force is at its limit
    not_finite = 2,    // an input is NaN or infinite
    out_of_range = 3,  // the input is not a motion of a gyroscope
    restarted = 4,     // the memory was lost
    // 5 is a rejected saved state (integrations/firmware/fracgyro.h)
    implausible = 6,  // the plant cannot have moved here from the last input
    lost = 7          // no sample is accepted until several agree
};

constexpr bool sound(Status status) { return status <= Status::lost && status != Status{5}; }

// Outputs of one step. `excess`: the part of the force that the limit removed. `report`: the controller's own channels,
// as they were when the force was computed.
template <Scalar T, class ReportType>
struct Signals {
    ReferencePoint<T> reference{};
    Sample<T> error{};
    Vec2<T> force{};
    Vec2<T> excess{};
    [[no_unique_address]] ReportType report{};
};

}  // namespace fracgyro
