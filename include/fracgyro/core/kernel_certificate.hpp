// A proven bound on the relative error of a sum of exponentials for t^(-α), over a continuous range of times.
#pragma once

#include "fracgyro/core/elementary.hpp"

namespace fracgyro {

// The relative error e(x) = e^(αx) Σ w_j exp(-s_j e^x) - 1 is analytic in x = log t. Cut [0, span] into intervals of
// half-width d around c and take the ellipse with foci c ∓ d and imaginary semi-axis ψ < π/2. Its real semi-axis is A =
// sqrt(ψ² + d²), the sum of the two in units of d is ρ = (ψ + A)/d, and on it |e^(αx)| <= e^(α(c+A)) and Re e^x >=
// e^(c-A) cos ψ, so that
//     |e| <= M = 1 + e^(α(c+A)) Σ w_j exp(-s_j e^(c-A) cos ψ).
// The Chebyshev series of e cut after degree m is a polynomial p with
//     |e - p| <= δ = 2 M ρ^-m/(ρ - 1)                                (Trefethen, ATAP, theorem 8.2).
// A polynomial of degree m sampled at N > m Chebyshev points obeys (Ehlich and Zeller, Math. Z. 86, 1964)
//     max |p| <= max |p(x_k)| / cos(mπ/2N).
// With |p(x_k)| <= |e(x_k)| + δ, the maximum of |e| on the interval is at most (max |e(x_k)| + δ)/cos(mπ/2N) + δ.
//
// Rounding, in units of 2^-52: a sample time is off by at most 40 relatively (its logarithm, at most 23.1, by 32 in
// three roundings, and the exponential by 4), which changes a term by 40 (α + s_j t). The power (4), the exponential
// (4, and s_j t for its argument's rounding), three products, the sum over the exponentials (n) and the final scaling
// of a rate and a weight by the caller (16, of a rate again times s_j t) come to less than n + 80 + 80 s_j t in all.
inline double certified_error(double order, double span, std::size_t count, const double* poles,
                              const double* weights) {
    constexpr int degree = 16;
    constexpr std::size_t points = 192;
    constexpr double psi = 1.2, cosine_of_psi = 0.36235775447667357764;
    constexpr std::uint64_t phase = (std::uint64_t{1} << 62) / points;  // π/2N
    const auto intervals = static_cast<std::size_t>(2.0 * span) + 1;
    const double half = 0.5 * span / static_cast<double>(intervals);
    const double reach = square_root(psi * psi + half * half);
    double largest = 0.0, sampled = 0.0, rounding = 0.0;
    bool finite = true;
    for (std::size_t i = 0; i < intervals; ++i) {
        const double centre = half * static_cast<double>(2 * i + 1);
        const double slowest = exponential(centre - reach) * cosine_of_psi;
        double size = 0.0;
        for (std::size_t j = 0; j < count; ++j) {
            size += weights[j] * exponential(-slowest * poles[j]);
        }
        largest = maximum(largest, 1.0 + exponential(order * (centre + reach)) * size);
        for (std::size_t k = 0; k < points; ++k) {
            const double node = sine_cosine<double>((2 * k + 1) * phase).cosine;
            const double time = exponential(centre + half * node), grown = power(time, order);
            double sum = 0.0, doubt = 0.0;
            for (std::size_t j = 0; j < count; ++j) {
                const double decay = time * poles[j];
                const double term = weights[j] * exponential(-decay) * grown;
                sum += term;
                doubt += term * (static_cast<double>(count + 80) + 80.0 * decay);
            }
            finite = finite && sum + doubt + largest < std::numeric_limits<double>::infinity();
            sampled = maximum(sampled, absolute(sum - 1.0));
            rounding = maximum(rounding, doubt);
        }
    }
    const double rho = (psi + reach) / half;
    double remainder = 2.000001 * largest / (rho - 1.0);  // 2 M, with a margin above the rounding of this
    for (int m = 0; m < degree; ++m) {
        remainder /= rho;
    }
    const double envelope = sine_cosine<double>(degree * phase).cosine;
    return finite ? (sampled + rounding * std::numeric_limits<double>::epsilon() + remainder) / envelope + remainder
                  : std::numeric_limits<double>::infinity();
}

}  // namespace fracgyro
