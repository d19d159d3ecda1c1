// The gyroscope with springs that harden, or soften, and couple the axes:
//
//     q̈ + (D + ΔD + 2Ω) q̇ + (K + ΔK) q + ∂V/∂q = u + d,       V = ¼ κx x⁴ + ¼ κy y⁴ + ½ κxy x² y²,
//
// so that the cubic force is [κx x³ + κxy x y², κy y³ + κxy x² y]. A Runge-Kutta step, with the force held.
#pragma once

#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/plant/plant.hpp"

namespace fracgyro {

struct Duffing {
    struct Params {
        GyroscopeParams linear{};
        Vec2<double> cubic_stiffness{};  // κx, κy
        double cubic_coupling = 0.0;     // κxy

        static constexpr auto fields() {
            return Fields{
                field("cubic_stiffness", &Params::cubic_stiffness, "m*omega0^2/q0^2", any_number,
                      "[x, y]: the springs pull with this times x^3, y^3 more; negative softens. Zeros: off."),
                field("cubic_coupling", &Params::cubic_coupling, "m*omega0^2/q0^2", any_number,
                      "the springs pull with this times x*y^2 more on x, x^2*y on y. 0.0: off."),
            };
        }
    };
    struct Coefficients {
        Sym2<double> damping{}, stiffness{};
        Vec2<double> cubic{};
        double coupling = 0.0, step = 0.0;
    };
    using State = std::array<double, 4>;  // x, y, ẋ, ẏ

    static Coefficients prepare(const Params& p, double step) {
        return {.damping = p.linear.damping + p.linear.damping_deviation,
                .stiffness = p.linear.stiffness + p.linear.stiffness_deviation,
                .cubic = p.cubic_stiffness,
                .coupling = p.cubic_coupling,
                .step = step};
    }
    static State start(const Params& p) {
        const Vec2<double>&q = p.linear.initial_position, &v = p.linear.initial_velocity;
        return {q.x(), q.y(), v.x(), v.y()};
    }
    static Motion<double> motion(const State& s) { return {.position = {s[0], s[1]}, .velocity = {s[2], s[3]}}; }
    static void step(State& state, const Coefficients& c, Vec2<double> control, Vec2<double> disturbance,
                     const RateCourse& rate) {
        const Vec2<double> u = control + disturbance;
        state = runge_kutta(state, c.step, [&](int halves, const State& s) {
            const auto [q, v] = motion(s);
            const Vec2<double> cubic = c.cubic * (q * (q * q)) + c.coupling * (q * swapped(q * q));
            const Vec2<double> coriolis = (2.0 * rate[static_cast<std::size_t>(halves)]) * turned(v);
            const Vec2<double> a = u - c.damping * v - coriolis - c.stiffness * q - cubic;
            return State{v.x(), v.y(), a.x(), a.y()};
        });
    }
};

}  // namespace fracgyro
