// 1  Velocities and accelerations of a table of positions: the cubic spline through them.
#pragma once

#include "fracgyro/control/reference.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace fracgyro {

// Sets velocities and accelerations of a table that has positions: those of the cubic spline through them whose end
// slopes are those of the cubic through the first and the last four rows, or of fewer. Rows are at ascending times.
inline void differentiate(std::span<TableRow> rows) {
    const std::size_t count = rows.size();
    if (count < 2) {
        return;
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto length = [&](std::size_t i) { return rows[i + 1].time - rows[i].time; };
        const auto slope = [&](std::size_t i) {
            return (rows[i + 1].position[axis] - rows[i].position[axis]) / length(i);
        };
        // Derivative, at the first of them, of the polynomial through up to four rows: Newton's divided differences.
        const auto end_slope = [&](std::size_t first, std::ptrdiff_t towards) {
            const auto row = [&](std::size_t k) -> const TableRow& {
                return rows[static_cast<std::size_t>(static_cast<std::ptrdiff_t>(first) +
                                                     towards * static_cast<std::ptrdiff_t>(k))];
            };
            const std::size_t points = count < 4 ? count : 4;
            std::array<double, 4> difference{};
            for (std::size_t k = 0; k < points; ++k) {
                difference[k] = row(k).position[axis];
            }
            double result = 0.0, product = 1.0;
            for (std::size_t order = 1; order < points; ++order) {
                for (std::size_t k = points - 1; k >= order; --k) {
                    difference[k] = (difference[k] - difference[k - 1]) / (row(k).time - row(k - order).time);
                }
                result = result + product * difference[order];
                product = product * (row(0).time - row(order).time);
            }
            return result;
        };
        // Equations of the slopes v: v_{i-1}/h_{i-1} + 2 (1/h_{i-1} + 1/h_i) v_i + v_{i+1}/h_i = 3 (d_{i-1}/h_{i-1} +
        // d_i/h_i), solved by elimination; the upper diagonal is kept in `acceleration`.
        rows.front().velocity[axis] = end_slope(0, 1);
        rows.front().acceleration[axis] = 0.0;
        const double last = end_slope(count - 1, -1);
        for (std::size_t i = 1; i + 1 < count; ++i) {
            const double before = 1.0 / length(i - 1), after = 1.0 / length(i);
            const double diagonal = 2.0 * (before + after) - before * rows[i - 1].acceleration[axis];
            const double right = 3.0 * (slope(i - 1) * before + slope(i) * after);
            rows[i].acceleration[axis] = after / diagonal;
            rows[i].velocity[axis] = (right - before * rows[i - 1].velocity[axis]) / diagonal;
        }
        rows.back().velocity[axis] = last;
        for (std::size_t i = count - 1; i-- > 1;) {
            rows[i].velocity[axis] = rows[i].velocity[axis] - rows[i].acceleration[axis] * rows[i + 1].velocity[axis];
        }
        for (std::size_t i = 0; i + 1 < count; ++i) {
            rows[i].acceleration[axis] =
                2.0 / length(i) * (3.0 * slope(i) - 2.0 * rows[i].velocity[axis] - rows[i + 1].velocity[axis]);
        }
        const std::size_t i = count - 2;
        rows.back().acceleration[axis] =
            2.0 / length(i) * (rows[i].velocity[axis] + 2.0 * rows[i + 1].velocity[axis] - 3.0 * slope(i));
    }
}

}  // namespace fracgyro
