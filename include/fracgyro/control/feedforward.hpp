// Forces of a known plant: along the reference, and for an acceleration.
#pragma once

#include "fracgyro/control/reports.hpp"
#include "fracgyro/control/signals.hpp"

namespace fracgyro {

// The force that keeps the nominal plant on the reference: (D̂₀ + 2Ω̂₀) ṙ + K̂₀ r + r̈ at the held point
// (reference.hpp). For a sine it is that of the exact inverse of the sampled plant, to some 1e-8 of itself.
template <Scalar T>
struct Feedforward {
    struct Coefficients {
        Sym2<T> damping{}, stiffness{};
        T twice_rate{};
    };
    static Coefficients prepare(const PlantModel<double>& nominal) {
        return {.damping = cast<T>(nominal.damping),
                .stiffness = cast<T>(nominal.stiffness),
                .twice_rate = T(2.0 * nominal.rate)};
    }
    static Vec2<T> force(const Coefficients& c, const ReferencePoint<T>& r) {
        const Vec2<T> coriolis = c.twice_rate * turned(r.velocity);
        return c.damping * r.velocity + coriolis + c.stiffness * r.position + r.acceleration;
    }
};

// (D̂ + 2Ω̂) v + K̂ q + a: the force that accelerates the estimated plant by a.
template <Scalar T, class Known>
Vec2<T> plant_force(const Known& known, const Motion<T>& motion, const Vec2<T>& acceleration) {
    const Vec2<T>& v = motion.velocity;
    const Vec2<T> coriolis = T(2.0) * (known.rate * turned(v));
    return known.damping * v + coriolis + known.stiffness * motion.position + acceleration;
}

// The motion, moved along the reference from the sample to the held point: the plant's forces there are those that a
// held force has to cancel.
template <Scalar T>
Motion<T> moved(const Motion<T>& motion, const ReferencePoint<T>& sampled, const ReferencePoint<T>& held) {
    return {.position = motion.position + (held.position - sampled.position),
            .velocity = motion.velocity + (held.velocity - sampled.velocity)};
}

}  // namespace fracgyro
