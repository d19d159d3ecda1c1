// Exponentials without the design in kernel_design.hpp: the trapezoidal rule, with s = exp(x), for
//
//     t^(-α)/Γ(1-α) = 1/(Γ(α) Γ(1-α)) ∫ s^(α-1) exp(-s t) ds = 1/(Γ(α) Γ(1-α)) ∫ exp(α x) exp(-t exp(x)) dx.
//
// The integrand is analytic for |Im x| < π/2, so the rule with spacing d has a relative error of about exp(-π²/d).
// Exponentials with s t < slowest for all times are merged into one, with an error of about slowest².
#pragma once

#include "fracgyro/core/fractional.hpp"

#include <cmath>
#include <stdexcept>

namespace fracgyro::testing {

inline ExponentialSum log_trapezoid(double order, double shortest, double longest, double spacing = 0.5,
                                    double slowest = 1e-4) {
    ExponentialSum kernel;
    kernel.order = order;
    kernel.gamma = std::tgamma(2.0 - order);
    if (order == 0.0 || order == 1.0) {
        return kernel;
    }
    const double scale = spacing / (std::tgamma(order) * std::tgamma(1.0 - order));
    const double last = std::log(30.0 / shortest);  // exp(-s t) <= exp(-30) beyond
    const double first = std::log(slowest / longest);
    // All slower exponentials as one: its weight is their sum, its pole their mean.
    const double weights = std::exp(order * first) / (1.0 - std::exp(-order * spacing));
    const double weights_and_poles = std::exp((order + 1.0) * first) / (1.0 - std::exp(-(order + 1.0) * spacing));
    kernel.weights[0] = scale * weights;
    kernel.poles[0] = weights_and_poles / weights;
    kernel.count = 1;
    for (double x = first + spacing; x < last; x += spacing, ++kernel.count) {
        if (kernel.count == ExponentialSum::capacity) {
            throw std::length_error("too many exponentials");
        }
        kernel.weights[kernel.count] = scale * std::exp(order * x);
        kernel.poles[kernel.count] = std::exp(x);
    }
    return kernel;
}

}  // namespace fracgyro::testing
