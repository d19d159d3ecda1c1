// Metrics of one run gathered while it runs, in constant memory. python/fracgyro/metrics.py defines the same quantities
// on recorded runs; a test compares the two.
#pragma once

#include "loop.hpp"

#include <cmath>

namespace fracgyro {

struct MetricsParams {
    double transient = 10.0;      // end of the transient window
    double error_bound = 0.01;    // ‖e‖ below which the error counts as settled
    double surface_bound = 0.06;  // ‖s‖ below which the surface counts as reached
    double rate_tolerance = 0.1;  // |Ω̂z - Ωz| / |Ωz| below which the rate counts as settled
};

inline constexpr std::array<std::string_view, 24> metric_names{"rmse_whole_x",
                                                               "rmse_whole_y",
                                                               "rmse_transient_x",
                                                               "rmse_transient_y",
                                                               "rmse_steady_x",
                                                               "rmse_steady_y",
                                                               "error_settling_time",
                                                               "surface_settling_time",
                                                               "chattering_x",
                                                               "chattering_y",
                                                               "effort_x",
                                                               "effort_y",
                                                               "rate_error",
                                                               "rate_error_rms",
                                                               "rate_error_peak",
                                                               "rate_settling_time",
                                                               "damping_error",
                                                               "stiffness_error",
                                                               "bound_0",
                                                               "bound_1",
                                                               "bound_2",
                                                               "bound_0_halfway",
                                                               "largest_force",
                                                               "diverged_at"};

// What a metric needs of every sample, for one run or, in lanes, for several. Sums only: counts follow from the windows.
template <Scalar T>
struct MetricsSums {
    T error_bound_squared{}, surface_bound_squared{}, rate{}, rate_bound{};

    // Of the present window. Where a run passes into the steady window, they are set aside and begin anew.
    Vec2<T> squares{}, force{}, bend{};  // Σ e², Σ u², Σ (second difference of u)²
    T rate_squares{};
    Vec2<T> transient_squares{}, transient_force{};
    std::array<Vec2<T>, 2> past{};                                                 // the last two u
    T step = T(0.0);                                                               // samples seen
    T error_outside = T(-1.0), surface_outside = T(-1.0), rate_outside = T(-1.0);  // the last samples outside
    T peak_rate_error{}, largest_force{};

    void add(const Signals<T>& at) {
        const Vec2<T> u = at.force;
        const Vec2<T> error_squares = at.error.value * at.error.value;
        squares = squares + error_squares;
        error_outside = if_less(error_bound_squared, error_squares.x + error_squares.y, step, error_outside);
        surface_outside = if_less(surface_bound_squared, squared_norm(at.surface), step, surface_outside);
        const T off = absolute(at.estimates.rate - rate);
        rate_outside = if_less(rate_bound, off, step, rate_outside);
        peak_rate_error = maximum(peak_rate_error, off);
        rate_squares = rate_squares + off * off;
        // Second differences see what flips from sample to sample and not what is smooth.
        const Vec2<T> difference = (u - past[0]) - (past[0] - past[1]);
        bend = bend + difference * difference;
        force = force + u * u;
        largest_force = maximum(largest_force, maximum(absolute(u.x), absolute(u.y)));
        past = {u, past[0]};
        step = step + T(1.0);
    }
};

// The first sample that is not in the transient window.
inline std::int64_t first_steady_sample(const MetricsParams& p, const Setup& setup) {
    const double h = setup.controller.step;
    auto n = static_cast<std::int64_t>(std::clamp(p.transient / h, 0.0, 1e15));
    while (n > 0 && !(static_cast<double>(n - 1) * h < p.transient)) {
        --n;
    }
    while (static_cast<double>(n) * h < p.transient) {
        ++n;
    }
    return n;
}

// In the order of metric_names; NaN: never settled, or an empty window. `sums` and the last estimates of a run of which
// `samples` were seen; bound_halfway is b̂₀ at half of the run or at its last sample before.
inline std::array<double, metric_names.size()> metric_values(const MetricsParams& params, const Setup& setup,
                                                             const MetricsSums<double>& sums,
                                                             const Estimates<double>& last, double bound_halfway,
                                                             std::int64_t samples) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const double h = setup.controller.step;
    const std::int64_t early = std::min(samples, first_steady_sample(params, setup));
    const auto count = [](std::int64_t n) { return static_cast<double>(n); };
    const auto rms = [](const Vec2<double>& sum, double n) {  // 0/0 is NaN: an empty window has no RMS
        return Vec2<double>{std::sqrt(sum.x / n), std::sqrt(sum.y / n)};
    };
    const double late = count(samples - early);
    const Vec2<double> whole = rms(sums.transient_squares + sums.squares, count(samples));
    const Vec2<double> transient = rms(sums.transient_squares, count(early));
    const Vec2<double> steady = rms(sums.squares, late);
    const Vec2<double> effort = rms(sums.transient_force + sums.force, count(samples));
    const auto chattering = [&](double bend, double force) {
        return late > 2 ? std::sqrt((bend / (late - 2)) / (force / late)) : nan;
    };
    const auto settled = [&](double outside) { return outside < count(samples - 1) ? (outside + 1) * h : nan; };
    // Frobenius norm of the error over that of the truth.
    const auto relative = [](const Sym2<double>& estimate, const Sym2<double>& truth) {
        const auto square = [](const Sym2<double>& a) { return a.xx * a.xx + 2.0 * a.xy * a.xy + a.yy * a.yy; };
        return std::sqrt(square(estimate - truth) / square(truth));
    };
    const PlantParams& p = setup.plant;
    return {whole.x,
            whole.y,
            transient.x,
            transient.y,
            steady.x,
            steady.y,
            settled(sums.error_outside),
            settled(sums.surface_outside),
            chattering(sums.bend.x, sums.force.x),
            chattering(sums.bend.y, sums.force.y),
            effort.x,
            effort.y,
            last.rate - p.rate,
            std::sqrt(sums.rate_squares / late),
            sums.peak_rate_error,
            settled(sums.rate_outside),
            relative(last.damping, p.damping + p.damping_deviation),
            relative(last.stiffness, p.stiffness + p.stiffness_deviation),
            last.bound[0],
            last.bound[1],
            last.bound[2],
            bound_halfway,
            sums.largest_force,
            samples > setup.steps ? nan : count(samples) * h};
}

}  // namespace fracgyro
