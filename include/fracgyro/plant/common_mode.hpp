// The common mode of a device: its masses moved all alike by an acceleration a of the frame, which shifts the gaps of
// the electrodes.
//
//    ẍ_c + (ω_c/Q_c) ẋ_c + ω_c² x_c = -a      on each axis, at rest at first; exact for an a held for a step
//
// Electrodes do not act on it in return.
#pragma once

#include "fracgyro/core/expm.hpp"
#include "fracgyro/plant/disturbance.hpp"

namespace fracgyro {

// Nondimensional.
struct CommonModeParams {
    static constexpr double off = std::numeric_limits<double>::infinity();
    Vec2<double> frequency{off, off}, quality{1.0, 1.0};  // ω_c, Q_c
    DisturbanceParams acceleration{};                     // -a

    bool on() const { return frequency.x() < off || frequency.y() < off; }
};

struct CommonMode {
    using State = Motion<double>;
    struct Coefficients {
        std::array<Matrix<3>, 2> map{};  // for x_c, ẋ_c and -a, on x and on y
        bool on = false;
    };

    static Coefficients prepare(const CommonModeParams& p, double step) {
        Coefficients c;
        c.on = p.on();
        for (std::size_t axis = 0; axis < 2; ++axis) {
            const double omega = axis == 0 ? p.frequency.x() : p.frequency.y();
            if (omega < CommonModeParams::off) {
                Matrix<3> a{};
                a[0][1] = a[1][2] = 1.0;
                a[1][0] = -(omega * omega);
                a[1][1] = -(omega / (axis == 0 ? p.quality.x() : p.quality.y()));
                c.map[axis] = expm(a, step);
            }
        }
        return c;
    }
    // `push`: -a
    static void step(State& state, const Coefficients& c, const Vec2<double>& push) {
        const auto next = [&](std::size_t row) {
            const auto &x = c.map[0][row], &y = c.map[1][row];
            return Vec2<double>{x[0] * state.position.x() + x[1] * state.velocity.x() + x[2] * push.x(),
                                y[0] * state.position.y() + y[1] * state.velocity.y() + y[2] * push.y()};
        };
        state = {.position = next(0), .velocity = next(1)};
    }
};

}  // namespace fracgyro
