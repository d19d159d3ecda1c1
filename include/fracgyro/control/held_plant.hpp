// The nominal plant under a held force: its exact maps over a step, in double precision.
//
//    In units of the step, [q/h², q̇/h] is of order 1 for a force of order 1.
#pragma once

#include "fracgyro/control/signals.hpp"
#include "fracgyro/core/expm.hpp"

namespace fracgyro::held_plant {

inline double of(const Vec2<double>& v, std::size_t axis) { return axis == 0 ? v.x() : v.y(); }

// Map of position, velocity and held force of both axes over a step.
[[gnu::noinline]] inline Matrix<6> both_axes(const PlantModel<double>& nominal, double h) {
    const Sym2<double>&k = nominal.stiffness, &d = nominal.damping;
    const double twice_rate = 2.0 * nominal.rate;
    Matrix<6> system{};
    system[0][2] = system[1][3] = system[2][4] = system[3][5] = 1.0;
    system[2] = {-k.xx() * h * h, -k.xy() * h * h, -d.xx() * h, -(d.xy() - twice_rate) * h, 1.0, 0.0};
    system[3] = {-k.xy() * h * h, -k.yy() * h * h, -(d.xy() + twice_rate) * h, -d.yy() * h, 0.0, 1.0};
    return expm(system, 1.0);
}
// The same of one axis without coupling.
inline Matrix<3> one_axis(const PlantModel<double>& nominal, double h, std::size_t axis) {
    Matrix<3> system{};
    system[0][1] = system[1][2] = 1.0;
    system[1][0] = -of(nominal.stiffness.diagonal, axis) * h * h;
    system[1][1] = -of(nominal.damping.diagonal, axis) * h;
    return expm(system, 1.0);
}
// From units of the step to those of q, q̇ and the force.
inline Matrix<6> without_units(Matrix<6> map, double h) {
    for (std::size_t i = 0; i < 2; ++i) {
        for (std::size_t j = 0; j < 6; ++j) {
            map[i][j] *= j < 2 ? 1.0 : j < 4 ? h : h * h;
            map[i + 2][j] *= j < 2 ? 1.0 / h : j < 4 ? 1.0 : h;
        }
    }
    return map;
}
// Two rows and columns of a map.
template <Scalar T, std::size_t Size>
Matrix2<T> block(const Matrix<Size>& rows, std::size_t row, std::size_t column) {
    return {{T(rows[row][column]), T(rows[row + 1][column])}, {T(rows[row][column + 1]), T(rows[row + 1][column + 1])}};
}

}  // namespace fracgyro::held_plant
