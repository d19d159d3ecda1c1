// Shared by the programs that time the loop: the paper's scenario, and its runs in the lanes of a register.
#pragma once

#include "fracgyro/sim/lane_setup.hpp"
#include "fracgyro/sim/cpu_dispatch.hpp"

namespace fracgyro {

inline Setup paper(std::int64_t steps, const ExponentialSum& kernel) {
    constexpr double pi = 3.14159265358979323846;
    Setup s;
    s.steps = steps;
    s.common.reference = {.frequency = {pi, pi / 2}, .phase = {0.0, pi / 2}};
    *kernel_of(s.controller) = kernel;
    s.plant = {.damping = {0.01, 0.002, 0.01}, .stiffness = {63.955 / 0.18, 12.779 / 0.18, 95.92 / 0.18}, .rate = 0.1};
    s.plant.initial_position = {0.5, 0.5};
    s.common.nominal = {
        .damping = 0.95 * s.plant.damping, .stiffness = 0.95 * s.plant.stiffness, .rate = 0.95 * s.plant.rate};
    s.disturbance.kind = DisturbanceKind::noise;
    return s;
}

// The RMS error of x of the first of these runs, which share registers of `Bytes` bytes.
template <std::size_t Bytes>
double run_lanes(const KernelsOfWidth<Bytes>& kernels, std::span<const Setup* const> runs, bool single) {
    return (single ? measure_all(kernels.floats, runs, MetricsParams{}, 1)
                   : measure_all(kernels.doubles, runs, MetricsParams{}, 1))[0]
        .rmse_whole.x();
}

}  // namespace fracgyro
