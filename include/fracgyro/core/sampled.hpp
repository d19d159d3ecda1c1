// Fractional operators of a signal of which only values are known, in fixed memory: exact for lines between samples, or
// for parabolas through this sample and the two before.
//
// Kernel k(t) = t^(-α)/Γ(1-α), ν = 1-α, its exponentials Σ w_j exp(-s_j t) from `shortest` on, step h, samples u_n,
// which are 0 for n < 0, and d_n = u_n - u_(n-1). With x in [0, 1] counting steps back from t_n, the signal is
//
//     u = u_n - x d_n + p (x² - x)/2 (d_n - d_(n-1)),    p = 0 for lines, 1 for parabolas,
//
// and with moments μ_k = ∫ x^k exp(-z x) dx, z = s_j h, r = exp(-z), the memory of an exponential is
//
//     u':       E_n = r E_(n-1) + μ₀ d_n + p (μ₀/2 - μ₁) (d_n - d_(n-1))
//     u/h:      E_n = r E_(n-1) + (μ₀ - μ₁) u_n + μ₁ u_(n-1) + p (μ₂ - μ₁)/2 (d_n - d_(n-1)).
//
// The stored state is driven by a single number: E_n = a₀ d_n + a₁ d_(n-1) + r E_(n-1) is a₀ d_n + (r a₀ + a₁) G_(n-1)
// with G_n = r G_(n-1) + d_n, and likewise E_n = a₀ u_n + a₁ u_(n-1) + a₂ u_(n-2) + r E_(n-1) is a₀ u_n + (r a₀ + a₁)
// u_(n-1) + (r (r a₀ + a₁) + a₂) G_(n-2). The difference between the kernel and the exponentials below `shortest` acts
// on the last interval only, by its moments.
#pragma once

#include "fracgyro/core/moments.hpp"

#include <cstddef>
#include <span>

namespace fracgyro {

namespace in_double {
using fracgyro_number = double;
#include "fracgyro/core/sampled_step.h"
}  // namespace in_double
namespace in_single {
using fracgyro_number = float;
#include "fracgyro/core/sampled_step.h"
}  // namespace in_single

using SampledTerm = in_double::fracgyro_term;
using SampledGains = in_double::fracgyro_gains;

struct SampledOperator {
    bool derivative = false;  // Caputo's D^α, else the integral I^(1-α)
    bool parabolas = false;
};

namespace detail {

// ∫ t^k of the kernel minus the exponentials below `shortest`, over h^k.
inline std::array<double, 3> lacking(std::span<const double> poles, const double* weights, double order,
                                     double shortest, double step) {
    std::array<double, 3> sums{};
    for (std::size_t j = 0; j < poles.size(); ++j) {
        const std::array<double, 3> moments = exponential_moments(poles[j] * shortest);
        for (std::size_t k = 0; k < 3; ++k) {
            sums[k] += weights[j] * moments[k];
        }
    }
    const double kernel = power(shortest, 1.0 - order) / gamma_from_one_to_two(2.0 - order);
    double unit = 1.0;
    for (std::size_t k = 0; k < 3; ++k, unit *= shortest / step) {
        sums[k] = unit * (kernel * (1.0 - order) / (static_cast<double>(k + 1) - order) - shortest * sums[k]);
    }
    return sums;
}

}  // namespace detail

// 0 < order < 1, step >= shortest. Writes a term for each pole; the trace is left 0.
inline SampledGains sampled_operator(std::span<const double> poles, const double* weights, double order,
                                     double shortest, double step, const SampledOperator& kind, SampledTerm* terms) {
    const double p = kind.parabolas ? 1.0 : 0.0;
    const std::array<double, 3> lack = detail::lacking(poles, weights, order, shortest, step);
    SampledGains gains{};
    for (std::size_t j = 0; j < poles.size(); ++j) {
        const double z = poles[j] * step;
        const std::array<double, 3> mu = exponential_moments(z);
        const double decay = -z * mu[0], r = 1.0 + decay;
        if (kind.derivative) {
            const double bend = p * (0.5 * mu[0] - mu[1]), first = mu[0] + bend;
            gains.change += weights[j] * first;
            terms[j] = {.decay = decay, .weight = weights[j] * (r * first - bend)};
        } else {
            const double unit = step * weights[j], bend = p * 0.5 * (mu[2] - mu[1]);
            const double first = (mu[0] - mu[1]) + bend, second = r * first + (mu[1] - 2.0 * bend);
            gains.now += unit * first;
            gains.past += unit * second;
            terms[j] = {.decay = decay, .weight = unit * (r * second + bend)};
        }
    }
    if (kind.derivative) {
        const double bend = p * (0.5 * lack[0] - lack[1]) / step;
        gains.of_changes = static_cast<int>(poles.size());
        gains.change += lack[0] / step + bend;
        gains.past_change = -bend;
    } else {
        const double bend = p * 0.5 * (lack[2] - lack[1]);
        gains.of_values = static_cast<int>(poles.size());
        gains.now += lack[0];
        gains.change = bend - lack[1];
        gains.past_change = -bend;
    }
    return gains;
}

}  // namespace fracgyro
