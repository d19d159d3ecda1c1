// A disc with nearly equal axes, and averages over whole turns of its vibration's line.
#pragma once

#include "dual_mass.hpp"

#include "fracgyro/controllers/mode_reversal.hpp"
#include "fracgyro/controllers/whole_angle.hpp"

#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace fracgyro::testing {

// Q = 2e6 at 10 kHz; deg/s and deg/h in units of omega0.
inline constexpr double omega0 = 2.0 * pi * 10e3, step = 0.05, decay = 0.5 / 2e6;
inline constexpr double deg_s = pi / 180.0 / omega0, deg_h = deg_s / 3600.0;
inline constexpr double anisotropy = 0.1 * decay, damping_axis = 0.3;  // Δ(1/τ), ϑ_τ
inline constexpr double drift = 0.5 * anisotropy;                      // p

// A symmetric matrix that is `mean` plus `difference`/2 along the axis and minus it across.
inline Sym2<double> along_axis(double mean, double difference, double axis) {
    const double c = std::cos(2.0 * axis), s = std::sin(2.0 * axis);
    return {mean + difference * c, difference * s, mean - difference * c};
}

inline WholeAngleParams angle_loops(double quadrature = 50.0) {
    const double hz = 1e-4;
    return {.loop = {.pll_bandwidth = 100.0 * hz,
                     .amplitude_bandwidth = 100.0 * hz,
                     .amplitude_integral = 20.0 * hz,
                     .demodulation_bandwidth = 2000.0 * hz,
                     .output_bandwidth = 90.0 * hz},
            .angle_bandwidth = 200.0 * hz,
            .quadrature_bandwidth = quadrature * hz};
}

template <class Params>
DeviceSetupOf<Params> disc(const Params& params, double rate, double at = 0.0) {
    DeviceSetupOf<Params> s{};
    s.controller = params;
    s.common = {.step = step, .force_limit = 0.01};
    s.common.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 1.0}};
    s.common.nominal = {.damping = {2.0 * decay, 0.0, 2.0 * decay}, .stiffness = {1.0, 0.0, 1.0}};
    s.plant = {.damping = along_axis(2.0 * decay, anisotropy, damping_axis), .stiffness = {1.0, 0.0, 1.0}};
    s.plant.rate = rate;
    s.plant.initial_velocity = {std::cos(at), std::sin(at)};
    return s;
}

// The rate of the line against its angle over a whole turn: its mean over time, and its Fourier coefficients over the
// angle, without the rotation; rates in omega0. speed: the mean of the line's rate, roughly.
struct Turn {
    double rate = 0.0, cos2 = 0.0, sin2 = 0.0, cos4 = 0.0, sin4 = 0.0;
    double decay_mean = 0.0, decay_cos2 = 0.0, decay_sin2 = 0.0;

    double second() const { return std::hypot(cos2, sin2); }
    double fourth() const { return std::hypot(cos4, sin4); }
};
template <class C>
Turn whole_turn(DeviceSetupOf<typename C::Params> s, double speed) {
    constexpr std::int64_t settle = 100'000;
    Turn turn{};
    double before = 0.0, way = 0.0, time = 0.0;
    bool done = false;
    s.steps = settle + static_cast<std::int64_t>(1.001 * pi / (std::abs(speed) * step));
    run_device_loop<C>(s, [&](const auto& at) {
        const auto& report = at.signals.report;
        const double angle = report.angle, part = std::remainder(angle - before, 2.0 * pi),
                     middle = before + 0.5 * part;
        before = angle;
        if (at.step <= settle || done) {
            return;
        }
        const double rate = part / step + s.plant.rate;
        way += part;
        time += step;
        turn.cos2 += rate * part * std::cos(2.0 * middle);
        turn.sin2 += rate * part * std::sin(2.0 * middle);
        turn.cos4 += rate * part * std::cos(4.0 * middle);
        turn.sin4 += rate * part * std::sin(4.0 * middle);
        turn.decay_mean += part * report.decay;
        turn.decay_cos2 += part * report.decay * std::cos(2.0 * middle);
        turn.decay_sin2 += part * report.decay * std::sin(2.0 * middle);
        done = std::abs(way) >= pi;
    });
    if (!done) {
        throw std::runtime_error("no whole turn");
    }
    turn.rate = way / time + s.plant.rate;
    for (double* sum : {&turn.cos2, &turn.sin2, &turn.cos4, &turn.sin4, &turn.decay_cos2, &turn.decay_sin2}) {
        *sum *= 2.0 / way;
    }
    turn.decay_mean /= way;
    return turn;
}

}  // namespace fracgyro::testing
