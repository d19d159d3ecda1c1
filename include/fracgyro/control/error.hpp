// 2  The tracking error, eq. (14): e = q - r and ė = v - dr/dt. Its sign is defined only here.
#pragma once

#include "fracgyro/control/reference.hpp"
#include "fracgyro/core/linear.hpp"

namespace fracgyro {

template <Scalar T>
constexpr Sample<T> tracking_error(const Motion<T>& measured, const ReferencePoint<T>& reference) {
    return {.value = measured.position - reference.position, .derivative = measured.velocity - reference.velocity};
}

}  // namespace fracgyro
