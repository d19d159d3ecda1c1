// Design of constant Kalman filters about the nominal plant, computed once in double precision.
//
//    In units of the step, z = [q/h², q̇/h] is of order 1 for a force of order 1. Each axis has gains of its own, for a
//    plant without coupling: within a step, coupling moves the mass very little, and the prediction includes it.
//
//    The force that the nominal plant lacks is a constant c, and, if frequencies are known, oscillators at each. With
//    the angle λ = ω h for their bandwidth ω, and forces in units of the disturbance:
//
//        z⁺ = F z + G (c + Σ cosine_n + w)        c⁺ = c + λ w_c        w, w_c, ... of variance 1
//
//    The gains are those of the discrete Riccati equation (core/riccati.hpp).
#pragma once

#include "fracgyro/control/datasheet.hpp"
#include "fracgyro/control/held_plant.hpp"
#include "fracgyro/core/riccati.hpp"

namespace fracgyro {

namespace filter_design {

inline constexpr std::size_t max_frequencies = 4, room = 3 + 2 * max_frequencies;
using Gains = Table<room, 2>;  // for a measured position and velocity, with a row for each state

// Frequencies at which forces are estimated.
struct Oscillators {
    std::array<double, max_frequencies> angle{};   // by which one turns in a step
    std::array<double, max_frequencies> ripple{};  // velocity at the samples over its sine, in units of the step
    std::size_t count = 0;
};

// Gains of one axis, whose map is `plant` (held_plant.hpp). States: position, velocity, the constant force, then cosine
// and sine at each frequency. `bandwidth`: that of the unknown forces.
[[gnu::noinline]] inline Gains gains(const Matrix<3>& plant, double h, const Sym2<double>& stiffness,
                                     const Datasheet& assumed, double bandwidth, const Oscillators& known,
                                     bool velocity_measured) {
    const double square = maximum(0.5 * absolute(stiffness.xx() + stiffness.yy()), 1e-6);
    // A plant that is a few percent off moves the mass by more than a smaller disturbance would.
    const double by_position = square * assumed.position_noise;
    const double by_velocity = square_root(square) * assumed.velocity_noise;
    const double sensed = velocity_measured ? minimum(by_position, by_velocity) : by_position;
    const double force = maximum(maximum(assumed.force_noise, sensed), 1e-6 * square);
    // A sensor below a hundredth of the motion that the disturbance causes in a step gains nothing.
    const auto variance = [](double noise, double floor) { return noise > floor ? noise * noise : floor * floor; };
    const double position = variance(assumed.position_noise / (h * h * force), 0.005);
    const double velocity = variance(assumed.velocity_noise / (h * force), 0.01);
    const double learned = bandwidth * h, grows = learned * learned;

    LeadingMatrix<room> a{.size = 3 + 2 * known.count}, noise{.size = a.size};
    for (std::size_t row = 0; row < 2; ++row) {
        for (std::size_t column = 0; column < 2; ++column) {
            a[row][column] = plant[row][column];
            noise[row][column] = plant[row][2] * plant[column][2];
        }
        a[row][2] = plant[row][2];
        for (std::size_t n = 0; n < known.count; ++n) {
            a[row][3 + 2 * n] = plant[row][2];
        }
    }
    a[2][2] = 1.0;
    noise[2][2] = grows;
    for (std::size_t n = 0; n < known.count; ++n) {
        const std::size_t cosine = 3 + 2 * n, sine = cosine + 1;
        const auto turn = sine_cosine<double>(phase_of(known.angle[n]));
        a[cosine][cosine] = a[sine][sine] = turn.cosine;
        a[cosine][sine] = turn.sine;
        a[sine][cosine] = -turn.sine;
        noise[cosine][cosine] = noise[sine][sine] = 2.0 * grows;
    }
    Gains found{};
    const auto measure = [&]<std::size_t Sensors>(const std::array<double, Sensors>& variances) {
        Table<room, Sensors> c{};
        for (std::size_t i = 0; i < Sensors; ++i) {
            c[i][i] = 1.0;
            for (std::size_t n = 0; n < known.count && i == 1; ++n) {
                c[4 + 2 * n][i] = known.ripple[n];
            }
        }
        const auto gain = riccati_gain(riccati(a.transposed(), c, noise, variances), c, variances);
        for (std::size_t i = 0; i < a.size; ++i) {
            const double unit = i == 0 ? h * h : i == 1 ? h : 1.0;
            for (std::size_t j = 0; j < Sensors; ++j) {
                found[i][j] = gain[j][i] * unit / (j == 0 ? h * h : h);
            }
        }
    };
    if (velocity_measured) {
        measure(std::array{position, velocity});
    } else {
        measure(std::array{position});
    }
    return found;
}

}  // namespace filter_design

// Gains of one state of both axes, for a measured position and velocity, or a position only.
template <Scalar T, std::size_t Sensors>
struct FilterGain {
    std::array<Vec2<T>, Sensors> of{};

    static FilterGain prepare(const std::array<filter_design::Gains, 2>& axes, std::size_t state) {
        FilterGain g;
        for (std::size_t i = 0; i < Sensors; ++i) {
            g.of[i] = {T(axes[0][state][i]), T(axes[1][state][i])};
        }
        return g;
    }
    Vec2<T> times(const Vec2<T>& position, const Vec2<T>& velocity) const {
        Vec2<T> moved = of[0] * position;
        if constexpr (Sensors == 2) {
            moved = moved + of[1] * velocity;
        }
        return moved;
    }
};

}  // namespace fracgyro
