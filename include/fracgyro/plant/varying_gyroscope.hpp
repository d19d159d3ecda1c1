// 6  The gyroscope with a dynamic rate, drifting springs and dampers, or nonlinear springs:
//
//        q̈ + ((1 + η(t)) (D + ΔD) + T(t) D' + 2Ω(t)) q̇ + ((1 + ε(t)) (K + ΔK) + T(t) K') q + κ q³ = u + d
//
//    κ q³ = [κx x³, κy y³] plus the forces of CubicCoupling; T is the change of temperature, K' and D' that of the
//    matrices per kelvin.
//
//    With x = [q, q̇] and the A of gyroscope.hpp, at the mean rate: ẋ = A x + B (u + d) + N(t, x). A step uses Lawson's
//    method of fourth order ("Generalized Runge-Kutta processes for stable systems with large Lipschitz constants",
//    1967): the classical Runge-Kutta method applied to exp(-A t) x. The linear constant part is exact, including the
//    force, so the step neither damps nor detunes the modes; the only error is due to N, h⁵ per step.
//
//    Ωx(t) and Ωy(t) add their terms of eq. (1), less those of the plant, to K.
//
//    `inertial`: the centrifugal and Euler forces follow Ωz(t), as in a frame that turns with it,
//        (d/dt + Ω)² q + (1 + η) (D + ΔD) q̇ + … = u + d.   With δ = Ωz - its mean, J q = [-y, x], w = q̇ + δ J q this is
//        q̇ = w - δ J q,       ẇ = A-part of (q, w) + δ ((D + ΔD) J q - J w) - η (D + ΔD) q̇ + …
//    without a derivative of the rate; at a jump of the rate, w is continuous and q̇ is not.
#pragma once

#include "fracgyro/plant/gyroscope.hpp"
#include "fracgyro/plant/imperfections.hpp"

namespace fracgyro {

struct VaryingPlantParams {
    GyroscopeParams plant{};  // at the mean rate
    Vec2<double> cubic_stiffness{};
    bool inertial = false;
    ThermalParams thermal{};
    CubicCoupling coupling{};
    bool tilts = false;
};

// Deviations from the mean at one instant: Ωz - mean, ε and η; T, where K' or D' is not zero; what Ωx and Ωy add to K.
struct Variation {
    double rate = 0.0, stiffness = 0.0, damping = 0.0, warmer = 0.0;
    Sym2<double> tilt{};
};

// K'
inline Sym2<double> stiffness_per_kelvin(const ThermalParams& p, const Sym2<double>& k) {
    return {p.spring.x() * k.xx(), p.quadrature * square_root(absolute(k.xx() * k.yy())), p.spring.y() * k.yy()};
}
// D': R(θ) D R(-θ) for small θ is D + θ (J D - D J).
inline Sym2<double> damping_per_kelvin(const ThermalParams& p, const Sym2<double>& d) {
    const double turn = p.damping_axis;
    return {p.damper.x() * d.xx() - 2.0 * turn * d.xy(), turn * (d.xx() - d.yy()),
            p.damper.y() * d.yy() + 2.0 * turn * d.xy()};
}

struct VaryingGyroscope {
    struct Coefficients {
        Gyroscope<double>::Coefficients half{};  // half a step
        Sym2<double> damping{}, stiffness{};
        Sym2<double> damping_per_kelvin{}, stiffness_per_kelvin{};
        Vec2<double> cubic{};
        CubicCoupling coupling{};
        bool coupled = false;
        double step = 0.0;
        bool inertial = false, tilts = false;
    };
    // Values over one step: the rate before its first sample, as it may jump there; then at its beginning, middle and
    // end.
    struct Course {
        double rate_before = 0.0;
        std::array<Variation, 3> at{};
    };

    static Coefficients prepare(const VaryingPlantParams& p, double step) {
        const Sym2<double> damping = p.plant.damping + p.plant.damping_deviation;
        const Sym2<double> stiffness = p.plant.stiffness + p.plant.stiffness_deviation;
        return {.half = Gyroscope<double>::prepare(p.plant, 0.5 * step),
                .damping = damping,
                .stiffness = stiffness,
                .damping_per_kelvin = fracgyro::damping_per_kelvin(p.thermal, damping),
                .stiffness_per_kelvin = fracgyro::stiffness_per_kelvin(p.thermal, stiffness),
                .cubic = p.cubic_stiffness,
                .coupling = p.coupling,
                .coupled = p.coupling.on(),
                .step = step,
                .inertial = p.inertial,
                .tilts = p.tilts};
    }

    static void step(Motion<double>& state, const Coefficients& c, Vec2<double> control, Vec2<double> disturbance,
                     const Course& course) {
        step(state, c, control, disturbance, course, NoForce{});
    }
    // With a further force that depends on the position: more(q). Inlined into both of its loops, as one that is not
    // costs a twentieth of a step.
    template <class Force>
    [[gnu::always_inline]] static void step(Motion<double>& state, const Coefficients& c, Vec2<double> control,
                                            Vec2<double> disturbance, const Course& course, const Force& more) {
        using Point = Motion<double>;
        const auto flow = [&](Point x) {
            Gyroscope<double>::step(x, c.half, control, disturbance);
            return x;
        };
        const auto plus = [](const Point& x, double h, const Point& k) {
            return Point{.position = x.position + h * k.position, .velocity = x.velocity + h * k.velocity};
        };
        const double h = c.step;
        Point x = state;
        if (c.inertial) {
            x.velocity = x.velocity + course.rate_before * turned(x.position);
        }
        const Point k1 = rest(c, course.at[0], x, more);
        const Point middle = flow(x);
        const Point k2 = rest(c, course.at[1], flow(plus(x, 0.5 * h, k1)), more);
        const Point k3 = rest(c, course.at[1], plus(middle, 0.5 * h, k2), more);
        const Point k4 = rest(c, course.at[2], flow(plus(middle, h, k3)), more);
        const Point most = plus(plus(flow(plus(x, h / 6.0, k1)), h / 3.0, k2), h / 3.0, k3);
        state = plus(flow(most), h / 6.0, k4);
        if (c.inertial) {
            state.velocity = state.velocity - course.at[2].rate * turned(state.position);
        }
    }

    // The cubic forces.
    static Vec2<double> cubic(const Coefficients& c, const Vec2<double>& q) {
        const Vec2<double> own = -(c.cubic * (q * (q * q)));
        return c.coupled ? own + c.coupling(q) : own;
    }

private:
    struct NoForce {};

    // N(t, x)
    template <class Force>
    [[gnu::always_inline]] static Motion<double> rest(const Coefficients& c, const Variation& now,
                                                      const Motion<double>& x, const Force& more) {
        const Vec2<double>& q = x.position;
        Vec2<double> force = -(now.stiffness * (c.stiffness * q) + c.cubic * (q * (q * q)));
        if (c.coupled) {
            force = force + c.coupling(q);
        }
        if (c.tilts) {
            force = force - now.tilt * q;
        }
        if constexpr (!std::is_same_v<Force, NoForce>) {
            force = force + more(q);
        }
        if (now.damping != 0.0) {
            const Vec2<double> velocity = c.inertial ? x.velocity - now.rate * turned(q) : x.velocity;
            force = force - now.damping * (c.damping * velocity);
        }
        if (now.warmer != 0.0) {
            const Vec2<double> velocity = c.inertial ? x.velocity - now.rate * turned(q) : x.velocity;
            force = force - now.warmer * (c.stiffness_per_kelvin * q + c.damping_per_kelvin * velocity);
        }
        if (c.inertial) {
            return {.position = -(now.rate * turned(q)),
                    .velocity = force + now.rate * (c.damping * turned(q) - turned(x.velocity))};
        }
        return {.velocity = force - (2.0 * now.rate) * turned(x.velocity)};
    }
};

}  // namespace fracgyro
