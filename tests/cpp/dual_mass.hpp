// The gyroscope dual_mass (Micromachines 2018, 9, 511), nondimensional, and the loops of a conventional one.
#pragma once

#include "fracgyro/controllers/conventional.hpp"
#include "fracgyro/sim/device_loop.hpp"

#include <numbers>

namespace fracgyro::testing {

inline constexpr double pi = std::numbers::pi;

struct Gyro {
    double rate = 0.0, quadrature = 0.0, damping = 0.0;  // Ωz, and kxy and dxy as equivalent rates
    std::int64_t delay = 0, declared = 0;
    bool from_rest = false;
};
inline constexpr double omega = 24661.50233021, h = 0.05, rate_300 = 300.0 * pi / 180.0 / omega;

template <class Params>
DeviceSetupOf<Params> setup_of(const Gyro& gyro, Params params) {
    const double dx = 7.49397e-6 / (1.42e-6 * omega), dy = 7.90472e-5 / (1.42e-6 * omega), ky = 887.1103346 / 863.62937;
    DeviceSetupOf<Params> s{};
    s.controller = params;
    s.common = {.step = h, .force_limit = 0.01};
    s.common.reference = {.amplitude = {1.0, 1.0}, .frequency = {1.0, 1.013503185}, .phase = {0.0, pi / 2}};
    s.common.nominal = {.damping = {dx, 0.0, dy}, .stiffness = {1.0, 0.0, ky}};
    s.plant = {.damping = {dx, 2.0 * gyro.damping, dy}, .stiffness = {1.0, 2.0 * gyro.quadrature, ky}};
    s.plant.rate = gyro.rate;
    s.plant.initial_position = {gyro.from_rest ? 1e-3 : 0.0, 0.0};
    s.plant.initial_velocity = {gyro.from_rest ? 0.0 : 1.0, 0.0};
    s.device.delay = gyro.delay;
    s.steps = 80000;
    return s;
}
inline ConventionalParams conventional_loops(std::int64_t declared) {
    const double unit = 2.0 * pi / omega;
    ConventionalParams p{.pll_bandwidth = 100.0 * unit,
                         .amplitude_bandwidth = 100.0 * unit,
                         .amplitude_integral = 20.0 * unit,
                         .demodulation_bandwidth = 2000.0 * unit,
                         .output_bandwidth = 90.0 * unit};
    p.datasheet.delay = declared;
    return p;
}

}  // namespace fracgyro::testing
