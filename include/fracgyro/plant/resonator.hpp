// A resonator with one axis: ẍ + dxx ẋ + kxx x = u + d, with the damping and stiffness of axis x; y stays 0, and forces
// on it have no effect. The step is exact, like that of the gyroscope.
#pragma once

#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/plant/plant.hpp"

namespace fracgyro {

struct Resonator {
    struct Params {
        GyroscopeParams linear{};
        static constexpr Fields<> fields() { return {}; }
    };
    struct Coefficients {
        Matrix<3> map{};  // columns x, ẋ, force: their effect on x and ẋ
    };
    using State = std::array<double, 2>;  // x, ẋ

    static Coefficients prepare(const Params& p, double step) {
        Matrix<3> a{};
        a[0][1] = a[1][2] = 1.0;
        a[1][0] = -(p.linear.stiffness + p.linear.stiffness_deviation).xx();
        a[1][1] = -(p.linear.damping + p.linear.damping_deviation).xx();
        return {expm(a, step)};
    }
    static State start(const Params& p) { return {p.linear.initial_position.x(), p.linear.initial_velocity.x()}; }
    static Motion<double> motion(const State& s) { return {.position = {s[0], 0.0}, .velocity = {s[1], 0.0}}; }
    static void step(State& s, const Coefficients& c, Vec2<double> control, Vec2<double> disturbance) {
        const double u = control.x() + disturbance.x();
        const Matrix<3>& m = c.map;
        s = {m[0][0] * s[0] + m[0][1] * s[1] + m[0][2] * u, m[1][0] * s[0] + m[1][1] * s[1] + m[1][2] * u};
    }
};

}  // namespace fracgyro
