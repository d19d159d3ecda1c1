// 6  The gyroscope, eqs. (5), (9), (13), nondimensional:
//
//        q̈ + (D + ΔD + 2Ω) q̇ + (K + ΔK) q = u + d,       Ω = [[0, -Ωz], [Ωz, 0]]
//
//    u and d are held constant over a step, so the step is exact: with x = [q, q̇] and ẋ = A x + B (u + d),
//    x(t+h) = exp(A h) x(t) + ∫ exp(A τ) B dτ (u + d), both read off one matrix exponential.
#pragma once

#include "fracgyro/core/expm.hpp"
#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/linear.hpp"

namespace fracgyro {

struct GyroscopeParams {
    Sym2<double> damping{}, stiffness{};                      // D, K: may be known to the controller
    Sym2<double> damping_deviation{}, stiffness_deviation{};  // ΔD, ΔK: unknown to it
    double rate = 0.0;                                        // Ωz
    Vec2<double> initial_position{}, initial_velocity{};

    static constexpr auto fields() {
        using P = GyroscopeParams;
        return Fields{
            field("damping", &P::damping, "m*omega0", any_number, "D"),
            field("stiffness", &P::stiffness, "m*omega0^2", any_number, "K"),
            field("damping_deviation", &P::damping_deviation, "m*omega0", any_number, "Delta D"),
            field("stiffness_deviation", &P::stiffness_deviation, "m*omega0^2", any_number, "Delta K"),
            field("angular_rate", &P::rate, "omega0", any_number, "Omega_z"),
            in_table("run", fixed(field("initial_position", &P::initial_position, "q0", any_number,
                                        "q(0) [x, y], unit q0, eq. (49)."))),
            in_table("run", fixed(field("initial_velocity", &P::initial_velocity, "q0*omega0", any_number,
                                        "v(0) [x, y], unit q0 omega0, eq. (49)."))),
        };
    }
};

template <Scalar T>
struct Gyroscope {
    using Column = typename PackOf<T, 4>::Type;
    struct Coefficients {
        std::array<Column, 6> map{};  // columns of x, y, ẋ, ẏ, force x, force y: their effect on x, y, ẋ, ẏ
    };
    using Params = GyroscopeParams;
    using State = Motion<T>;

    // A, and the forces as states that stay constant: x, y, ẋ, ẏ, force x, force y.
    static Matrix<6> system(const GyroscopeParams& p) {
        const Sym2<double> d = p.damping + p.damping_deviation;
        const Sym2<double> k = p.stiffness + p.stiffness_deviation;
        Matrix<6> a{};
        a[0][2] = a[1][3] = a[2][4] = a[3][5] = 1.0;
        a[2][0] = -k.xx(), a[2][1] = -k.xy(), a[2][2] = -d.xx(), a[2][3] = -d.xy() + 2.0 * p.rate;
        a[3][0] = -k.xy(), a[3][1] = -k.yy(), a[3][2] = -d.xy() - 2.0 * p.rate, a[3][3] = -d.yy();
        return a;
    }
    static Coefficients prepare(const GyroscopeParams& p, double step) { return prepare(system(p), step); }
    static Coefficients prepare(const Matrix<6>& a, double step) {
        const Matrix<6> sum = expm(a, step);
        Coefficients c;
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < 6; ++j) {
                c.map[j][i] = T(sum[i][j]);
            }
        }
        return c;
    }

    static State start(const GyroscopeParams& p) {
        return {.position = cast<T>(p.initial_position), .velocity = cast<T>(p.initial_velocity)};
    }

    static const Motion<T>& motion(const State& state) { return state; }

    // Grouped so that the force, which comes last, passes through as few additions as possible.
    static void step(State& state, const Coefficients& c, Vec2<T> control, Vec2<T> disturbance = {}) {
        const Vec2<T> force = control + disturbance;
        const auto times = [&c](std::size_t column, const T& a) { return c.map[column] * Column{a, a, a, a}; };
        const Column free = (times(0, state.position.x()) + times(1, state.position.y())) +
                            (times(2, state.velocity.x()) + times(3, state.velocity.y()));
        const Column next = free + (times(4, force.x()) + times(5, force.y()));
        state = {.position = {next[0], next[1]}, .velocity = {next[2], next[3]}};
    }
};

}  // namespace fracgyro
