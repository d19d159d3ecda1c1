// Electrodes of the source of shipped/dual_mass.toml (Micromachines 2018, 9, 511).
#pragma once

#include "fracgyro/plant/electrodes.hpp"

namespace fracgyro::testing {

inline constexpr double tuning_gap = 4e-6;

// 150 gaps on each side.
inline ElectrodeParams tuning_plates(double volts) {
    return {.role = ElectrodeRole::tuning, .count = 150, .gap = tuning_gap, .area = 60e-6 * 200e-6, .bias = volts};
}
inline ElectrodeParams nulling_combs(double volts) {
    return {.role = ElectrodeRole::quadrature,
            .kind = ElectrodeKind::skewed,
            .count = 30,
            .gap = 5e-6,
            .overlap = 10e-6,
            .thickness = 60e-6,
            .ratio = 2.5,
            .bias = 5.0,
            .nulling = volts};
}

}  // namespace fracgyro::testing
