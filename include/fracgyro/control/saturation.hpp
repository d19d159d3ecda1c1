// The force limit, the same on each axis.
#pragma once

#include "fracgyro/core/linear.hpp"

namespace fracgyro {

template <Scalar T>
struct Saturation {
    struct Coefficients {
        T limit{};
        bool limited = false;
    };
    static Coefficients prepare(double limit) {
        return {.limit = T(limit), .limited = limit < std::numeric_limits<double>::infinity()};
    }
    static Vec2<T> within(const Coefficients& c, const Vec2<T>& force) { return clamp(force, -c.limit, c.limit); }

    // Splits the wanted force into the acting force and the excess, both in `signals`. Returns 0 if integral action on
    // `error` would wind up, as the excess opposes the error, else 1.
    template <class Signals>
    static T apply(Signals& signals, const Coefficients& c, const Vec2<T>& wanted, const Vec2<T>& error) {
        signals.force = wanted;
        if (!c.limited) {
            return T(1.0);
        }
        signals.force = within(c, wanted);
        signals.excess = wanted - signals.force;
        const T unwinding = dot(signals.excess, error);
        return if_less(unwinding, T(0.0), T(0.0), T(1.0));
    }
};

}  // namespace fracgyro
