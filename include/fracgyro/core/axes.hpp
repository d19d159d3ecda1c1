// Two axes that are turned against those of the plant, with a gain along each: those of pick-offs or actuators.
#pragma once

#include "fracgyro/core/linear.hpp"
#include "fracgyro/core/phase.hpp"

namespace fracgyro {

// Axes turned by `misalignment`, counter-clockwise in rad, from the axes of the plant, with a gain of 1 + gain_error
// along them.
struct AxesParams {
    Vec2<double> gain_error{};
    double misalignment = 0.0;

    bool on() const { return gain_error.x() != 0.0 || gain_error.y() != 0.0 || misalignment != 0.0; }
};

// Map from one pair of axes to another: images of one unit of x and of y.
template <Scalar T>
struct AxesMap {
    Vec2<T> x{}, y{};

    Vec2<T> operator()(const Vec2<T>& a) const { return a.x() * x + a.y() * y; }
};

// A vector of the plant as seen along the axes, times their gains.
inline AxesMap<double> onto(const AxesParams& p) {
    const Vec2<double> turn = turn_of<double>(p.misalignment);
    const Vec2<double> gain = Vec2<double>{1.0, 1.0} + p.gain_error;
    return {gain * Vec2<double>{turn.x(), -turn.y()}, gain * swapped(turn)};
}
// The vector of the plant made of amounts along the axes, each times its gain.
inline AxesMap<double> along(const AxesParams& p) {
    const Vec2<double> turn = turn_of<double>(p.misalignment);
    const Vec2<double> gain = Vec2<double>{1.0, 1.0} + p.gain_error;
    return {gain.x() * turn, gain.y() * turned(turn)};
}
// The vector of the plant that is seen as this one: the inverse of `onto`.
inline AxesMap<double> seen_from(const AxesParams& p) {
    const Vec2<double> turn = turn_of<double>(p.misalignment);
    return {(1.0 / (1.0 + p.gain_error.x())) * turn, (1.0 / (1.0 + p.gain_error.y())) * turned(turn)};
}

}  // namespace fracgyro
