// The matrix exponential, by scaling and squaring: the same bits everywhere, since it uses only sums and products.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>
#include <cstdint>

namespace fracgyro {

template <std::size_t Size>
using Matrix = std::array<std::array<double, Size>, Size>;

template <std::size_t Size>
Matrix<Size> product(const Matrix<Size>& l, const Matrix<Size>& r) {
    Matrix<Size> m{};
    for (std::size_t i = 0; i < Size; ++i) {
        for (std::size_t j = 0; j < Size; ++j) {
            for (std::size_t n = 0; n < Size; ++n) {
                m[i][j] += l[i][n] * r[n][j];
            }
        }
    }
    return m;
}

// exp(a·time): a Taylor series for a small matrix, then repeated squaring.
template <std::size_t Size>
Matrix<Size> expm(const Matrix<Size>& a, double time) {
    double size = 0.0;
    for (const auto& row : a) {
        double sum = 0.0;
        for (const double x : row) {
            sum += absolute(x) * time;
        }
        size = maximum(size, sum);
    }
    int squarings = 0;
    for (; size > 0.25 && squarings < 60; size *= 0.5) {
        ++squarings;
    }
    const double scale = time / static_cast<double>(std::int64_t{1} << squarings);
    Matrix<Size> power{}, sum{};
    for (std::size_t i = 0; i < Size; ++i) {
        power[i][i] = sum[i][i] = 1.0;
    }
    for (int n = 1; n <= 16; ++n) {
        power = product(power, a);
        for (std::size_t i = 0; i < Size; ++i) {
            for (std::size_t j = 0; j < Size; ++j) {
                power[i][j] *= scale / n;
                sum[i][j] += power[i][j];
            }
        }
    }
    for (int n = 0; n < squarings; ++n) {
        sum = product(sum, sum);
    }
    return sum;
}

}  // namespace fracgyro
