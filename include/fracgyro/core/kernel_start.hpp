// Start of the kernel design: estimates of the times of alternation and of the optimal exponentials.
//
// Inside the design, time runs over [1, R]; x = log t in [0, span], span = log R; excess = R - 1; the kernel is t^(-α).
#pragma once

#include "fracgyro/core/elementary.hpp"

namespace fracgyro {

namespace detail {

inline constexpr double half_pi = 1.57079632679489661923;

// The first zero z of J_(α-1) and 2/(π z J_α(z)²), by power series in y = z²/4, whose terms are (-y)^k/(k! (α)_k).
inline void first_bessel_zero(double order, double& zero, double& gauss) {
    double y = order * (1.0 + 0.5 * order - order * order / 12.0), slope = 0.0;
    for (int iteration = 0; iteration < 6; ++iteration) {
        double value = order, term = -y;  // terms of the series times α
        double of_slope = 1.0;            // series of Γ(α+1) y^(-α/2) J_α, which is minus the derivative of `value`
        slope = 0.0;
        for (int k = 1; k < 20; ++k) {
            value += term;
            term *= -y / ((k + 1) * (order + k));
            slope += of_slope;
            of_slope *= -y / (k * (order + k));
        }
        y += value / slope;
    }
    zero = 2.0 * square_root(y);
    const double scale = gamma_from_one_to_two(1.0 + order) / slope;
    gauss = 2.0 * scale * scale / (2.0 * half_pi * zero * power(y, order));
}

}  // namespace detail

// Elliptic quarter period K(k), k² = 1 - 1/R², by the arithmetic-geometric mean; near log(4 R) for wide ranges.
inline double quarter_period(double excess) {
    double a = 1.0, b = 1.0 / (1.0 + excess);
    for (int i = 0; i < 9; ++i) {
        const double mean = 0.5 * (a + b);
        b = square_root(a * b);
        a = mean;
    }
    return detail::half_pi / a;
}

// Logs of Zolotarev's 2n+1 alternation points R dn(i K/2n) on [1, R]: close to the optimal points. Only the half nearer
// to R is computed; dn(K - u) = 1/(R dn(u)) mirrors it in log t. sn follows from a sine by Landen's transformations.
inline void start_times(double excess, double span, std::size_t n, double* log_times) {
    constexpr std::size_t landen = 8;
    std::array<double, landen> k{};
    double other = 1.0 / (1.0 + excess);  // the complementary modulus
    k[0] = excess / (2.0 + excess);
    for (std::size_t i = 1; i < landen; ++i) {
        other = 2.0 * square_root(other) / (1.0 + other);
        k[i] = (1.0 - other) / (1.0 + other);
    }
    const double squared_modulus = excess * (2.0 + excess) / ((1.0 + excess) * (1.0 + excess));
    for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t phase = i * ((std::uint64_t{1} << 61) / n);
        double sn = sine_cosine<double>(phase).sine;
        for (std::size_t j = landen; j-- > 0;) {
            sn = (1.0 + k[j]) * sn / (1.0 + k[j] * sn * sn);
        }
        const double below_longest = -0.5 * logarithm_of_one_plus(-squared_modulus * sn * sn);
        log_times[i] = below_longest;
        log_times[2 * n - i] = span - below_longest;
    }
    log_times[n] = 0.5 * span;
}

// Estimate of the optimal exponentials, within about 0.02 of them. In the interior the poles are uniform in log s with
// spacing h = (span + log 4)/n, the trapezoidal rule. Near s = 0 they follow Gauss quadrature of s^(α-1) ds, i.e.
// squared zeros z of J_(α-1) with weight factors 2/(π z J_α(z)²). A smooth map of u = z h/π joins the two: log u² for
// small u, u for large. At the fast end the spacing widens slightly. The constants were fitted to minimax sets for
// order .05 to .99, errors 1e-2 to 1e-11, ranges 1e5 and 1e8 (rms residual 0.003).
inline void start_terms(double order, double span, std::size_t n, double* log_weights, double* log_poles) {
    const double h = (span + 1.38629436111989061883) / static_cast<double>(n);
    const double mu = 4.0 * (order - 1.0) * (order - 1.0);
    const double gamma = gamma_from_one_to_two(1.0 + order);
    const double offset = logarithm(detail::half_pi / h) - 0.3333 + 0.0694 * h - 0.3162 * order * h - span;
    for (std::size_t j = 0; j < n; ++j) {
        double zero = 0.0, gauss = 0.0;
        if (j == 0) {
            detail::first_bessel_zero(order, zero, gauss);
        } else {
            // McMahon's expansion (DLMF 10.21.19), and the derivative of the phase of J (DLMF 10.18.18).
            const double beta = (static_cast<double>(j) + 0.25 + 0.5 * order) * (2.0 * detail::half_pi);
            const double eighth = 1.0 / (8.0 * beta);
            zero = beta - (mu - 1.0) * eighth - 4.0 * (mu - 1.0) * (7.0 * mu - 31.0) / 3.0 * (eighth * eighth * eighth);
            const double inverse = 1.0 / (zero * zero);
            gauss = 1.0 / (1.0 - (mu - 1.0) / 8.0 * inverse - (mu - 1.0) * (mu - 25.0) / 128.0 * inverse * inverse);
        }
        const double u = zero * h / (2.0 * detail::half_pi), squared = u * u;
        const double from_fastest = h * static_cast<double>(n - 1 - j);
        const double radius = square_root(squared + 0.9882);
        const double bump = exponential(-0.0743 * squared);
        const double steepness = 0.0001 * h + 0.0067 * order * h - 0.0049;
        const double height = 0.2028 - 0.0764 * h + 0.1695 * order * h + steepness * squared;
        const double fast_end = 1.3263 * h * exponential(-2.435 * from_fastest - 4.7092 * h);
        const double slope = 2.0 / u + u / radius - 2.0 * u / (squared + 2.3762) + 2.435 * fast_end +
                             bump * (2.0 * steepness * u - 0.1486 * u * height);
        const double log_pole =
            2.0 * logarithm(u) + radius - logarithm(squared + 2.3762) + offset + height * bump + fast_end;
        log_poles[j] = log_pole;
        log_weights[j] = logarithm(gauss * h * slope * (order / gamma)) + order * log_pole;
    }
}

}  // namespace fracgyro
