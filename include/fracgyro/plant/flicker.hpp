// Flicker noise: white noise w of unit variance through (1 - z⁻¹)^(-1/2), the discrete half integral (Kasdin, "Discrete
// simulation of colored noise and stochastic processes and 1/f^α power law noise generation", 1995):
//
//    |H|² = 1/(2 sin ½θ), θ = ω h the phase of a step: 1/θ within 0.05 dB up to θ = 0.5, and 2.0 dB more at half the
//    sampling frequency. A times this noise has the two-sided density A²/|ω|, whatever the step.
//
// In fixed memory, from        (1 - x)^(-1/2) = 1/π ∫₀¹ [p (1 - p)]^(-1/2)/(1 - p x) dp
// by p = 1/(1 + r), r = e^u and the trapezoidal rule over u: first-order poles, two to a decade of r from 10 down to
// 3e-10. The rest of the sum is one more pole below, and above them w itself. The error is less than 0.01 dB for θ from
// 3e-8 to 0.03, and than 0.08 dB from 3e-10 to π; below 3e-11 the density is flat. It starts from 0.
#pragma once

#include "fracgyro/core/linear.hpp"

#include <array>

namespace fracgyro {

struct Flicker {
    static constexpr std::size_t poles = 23;
    struct Coefficients {
        std::array<double, poles> pole{}, weight{};
        double direct = 0.0;
    };
    template <class T>  // one number, or one for each axis
    using State = std::array<T, poles>;

    static const Coefficients coefficients;

    // The noise at a sample, from the w drawn there; called once per sample.
    template <class T>
    static T next(State<T>& state, const T& drawn) {
        std::array<T, 4> sum{coefficients.direct * drawn};  // four sums, which do not wait for each other
        for (std::size_t k = 0; k < poles; ++k) {
            state[k] = coefficients.pole[k] * state[k] + drawn;
            sum[k % 4] = sum[k % 4] + coefficients.weight[k] * state[k];
        }
        return (sum[0] + sum[1]) + (sum[2] + sum[3]);
    }

private:
    static constexpr Coefficients prepare() {
        constexpr double ratio = 0.56234132519034908;  // 10^(-1/4): of √r, two poles to a decade
        constexpr double spacing = 1.15129254649702284 / 3.14159265358979324;  // ln √10 over π
        constexpr int above = 60;           // terms of the sum before the first pole, which fall as √r rises
        double root = 3.16227766016837933;  // √r
        const auto weight = [&](double a) { return spacing * a / (1.0 + a * a); };
        Coefficients c;
        double beyond = root;
        for (int k = 0; k < above; ++k) {
            beyond /= ratio;
            c.direct += weight(beyond);
        }
        for (std::size_t k = 0; k + 1 < poles; ++k, root *= ratio) {
            c.pole[k] = 1.0 / (1.0 + root * root);
            c.weight[k] = weight(root);
        }
        // All following terms, for which 1 + r is 1: one pole with their Σ √r and Σ r √r.
        const double all = root / (1.0 - ratio), moment = root * root * root / (1.0 - ratio * ratio * ratio);
        c.pole[poles - 1] = 1.0 / (1.0 + moment / all);
        c.weight[poles - 1] = spacing * all;
        return c;
    }
};

inline constexpr Flicker::Coefficients Flicker::coefficients = Flicker::prepare();

}  // namespace fracgyro
