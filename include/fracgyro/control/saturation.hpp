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
};

}  // namespace fracgyro
