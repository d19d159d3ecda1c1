// Metrics of one run gathered while it runs, in constant memory. python/fracgyro/analysis/metrics.py defines the same
// quantities on recorded runs; a test compares the two.
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/sim/loop.hpp"

#include <cmath>

namespace fracgyro {

struct MetricsParams {
    double transient = 10.0;      // end of the transient window
    double error_bound = 0.01;    // ‖e‖ below which the error counts as settled
    double surface_bound = 0.06;  // ‖s‖ below which the surface counts as reached
    double rate_tolerance = 0.1;  // |Ω̂z - Ωz| / |Ωz| below which the rate counts as settled
};

// NaN: never settled, an empty window, or not reported by the controller.
struct Metrics {
    Vec2<double> rmse_whole{}, rmse_transient{}, rmse_steady{};
    double error_settling_time = 0.0, surface_settling_time = 0.0;
    Vec2<double> chattering{}, effort{};
    double rate_error = 0.0, rate_error_rms = 0.0, rate_error_peak = 0.0, rate_settling_time = 0.0;
    double damping_error = 0.0, stiffness_error = 0.0;
    std::array<double, 3> bound_final{};
    double bound_0_halfway = 0.0, largest_force = 0.0, saturated_share = 0.0, diverged_at = 0.0;

    static constexpr auto fields() {
        using M = Metrics;
        constexpr std::string_view length = "q0", time = "1/omega0", force = "m*omega0^2*q0", rate = "omega0";
        return Fields{
            channel("rmse_whole", &M::rmse_whole, length, "RMS error, whole run"),
            channel("rmse_transient", &M::rmse_transient, length, "RMS error, transient"),
            channel("rmse_steady", &M::rmse_steady, length, "RMS error, steady"),
            channel("error_settling_time", &M::error_settling_time, time, "settling time of the error"),
            channel("surface_settling_time", &M::surface_settling_time, time, "settling time of the surface"),
            channel("chattering", &M::chattering, "1", "chattering of u"),
            channel("effort", &M::effort, force, "RMS force"),
            channel("rate_error", &M::rate_error, rate, "rate error at the end"),
            channel("rate_error_rms", &M::rate_error_rms, rate, "RMS rate error, steady"),
            channel("rate_error_peak", &M::rate_error_peak, rate, "peak rate error"),
            channel("rate_settling_time", &M::rate_settling_time, time, "settling time of the rate"),
            channel("damping_error", &M::damping_error, "1", "relative error of D at the end"),
            channel("stiffness_error", &M::stiffness_error, "1", "relative error of K at the end"),
            channel("bound_final", &M::bound_final, "m*omega0^2*q0, m*omega0^2, m*omega0",
                    "bound estimate b at the end"),
            channel("bound_0_halfway", &M::bound_0_halfway, force, "bound estimate b0 halfway"),
            channel("largest_force", &M::largest_force, force, "peak force"),
            channel("saturated_share", &M::saturated_share, "1", "share of samples at the force limit"),
            channel("diverged_at", &M::diverged_at, time, "time at which the motion diverged"),
        };
    }
};
inline constexpr std::size_t metrics_width = width_of<Metrics>();

// Sums for the metrics, of one run or, in lanes, of several: over a segment of samples, short enough for sums in single
// precision, which MetricsTotals then adds up.
template <Scalar T>
struct MetricsSums {
    T error_bound_squared{}, surface_bound_squared{}, rate{}, rate_bound{}, force_limit{};  // set once
    std::array<Vec2<T>, 2> past{};                                                          // the last two u

    struct Segment {
        Vec2<T> squares{}, force{}, second_difference{};  // Σ e², Σ u², Σ (second difference of u)²
        T rate_squares{};
        T step = T(0.0);                                                               // samples seen
        T error_outside = T(-1.0), surface_outside = T(-1.0), rate_outside = T(-1.0);  // the last samples outside
        T peak_rate_error{}, largest_force{}, saturated{};
    } segment{};

    template <class Report>
    void add(const Signals<T, Report>& at) {
        add(at, at.report);
    }
    // Adds a sample with a report from elsewhere. Sums of values that no report has stay unchanged, and their metrics
    // are NaN.
    template <class Some, class Report>
    void add(const Signals<T, Some>& at, const Report& report) {
        Segment& s = segment;
        const Vec2<T> u = at.force;
        const Vec2<T> squares = at.error.value * at.error.value;
        s.squares = s.squares + squares;
        s.error_outside = if_less(error_bound_squared, squares.x() + squares.y(), s.step, s.error_outside);
        if constexpr (requires { report.surface; }) {
            s.surface_outside = if_less(surface_bound_squared, squared_norm(report.surface), s.step, s.surface_outside);
        }
        if constexpr (requires { report.rate; }) {
            const T off = absolute(report.rate - rate);
            s.rate_outside = if_less(rate_bound, off, s.step, s.rate_outside);
            s.peak_rate_error = maximum(s.peak_rate_error, off);
            s.rate_squares = s.rate_squares + off * off;
        }
        // Second differences respond to changes from sample to sample and not to smooth signals.
        const Vec2<T> difference = (u - past[0]) - (past[0] - past[1]);
        s.second_difference = s.second_difference + difference * difference;
        s.force = s.force + u * u;
        const T force = maximum(absolute(u.x()), absolute(u.y()));
        s.largest_force = maximum(s.largest_force, force);
        s.saturated = s.saturated + if_less(force, force_limit, T(0.0), T(1.0));
        past = {u, past[0]};
        s.step = s.step + T(1.0);
    }
};

// Sums of one run, as `number` extracts them from a scalar.
template <class T, class Number>
typename MetricsSums<double>::Segment segment_of(const typename MetricsSums<T>::Segment& s, Number&& number) {
    const auto vec2 = [&](const Vec2<T>& a) { return Vec2<double>{number(a.x()), number(a.y())}; };
    return {.squares = vec2(s.squares),
            .force = vec2(s.force),
            .second_difference = vec2(s.second_difference),
            .rate_squares = number(s.rate_squares),
            .step = number(s.step),
            .error_outside = number(s.error_outside),
            .surface_outside = number(s.surface_outside),
            .rate_outside = number(s.rate_outside),
            .peak_rate_error = number(s.peak_rate_error),
            .largest_force = number(s.largest_force),
            .saturated = number(s.saturated)};
}

// Totals of a whole run.
struct MetricsTotals {
    struct Window {
        Vec2<double> squares{}, force{};
    } transient{}, steady{};
    Vec2<double> second_difference{};  // from the third sample of the steady window on
    double rate_squares = 0.0;         // over the steady window
    std::int64_t error_outside = -1, surface_outside = -1, rate_outside = -1;
    double peak_rate_error = 0.0, largest_force = 0.0, saturated = 0.0;

    // Adds a segment from sample `first` on, which is within one window; `steady_from` is the first sample of the
    // steady one.
    void add(const MetricsSums<double>::Segment& s, std::int64_t first, std::int64_t steady_from) {
        Window& window = first < steady_from ? transient : steady;
        window.squares = window.squares + s.squares;
        window.force = window.force + s.force;
        if (first >= steady_from) {
            rate_squares += s.rate_squares;
        }
        if (first >= steady_from + 2) {
            second_difference = second_difference + s.second_difference;
        }
        const auto last = [first](std::int64_t& total, double outside) {
            if (outside >= 0.0) {
                total = first + static_cast<std::int64_t>(outside);
            }
        };
        last(error_outside, s.error_outside);
        last(surface_outside, s.surface_outside);
        last(rate_outside, s.rate_outside);
        peak_rate_error = std::max(peak_rate_error, s.peak_rate_error);
        largest_force = std::max(largest_force, s.largest_force);
        saturated += s.saturated;
    }
};

// The first sample after the transient window; steps + 1 if there is none.
template <class Params>
std::int64_t first_steady_sample(const MetricsParams& p, const SetupOf<Params>& setup) {
    const double h = setup.common.step;
    const std::int64_t end = setup.steps + 1;
    const double whole = minimum(maximum(0.0, p.transient / h), static_cast<double>(end));  // 0 for NaN
    std::int64_t n = std::max<std::int64_t>(static_cast<std::int64_t>(whole) - 1, 0);       // the quotient is rounded
    while (n < end && static_cast<double>(n) * h < p.transient) {
        ++n;
    }
    return n;
}

inline constexpr std::size_t longest_segment = 64;  // samples

// End of the segment from sample `first` on: the end of a window, or the first sample whose estimates count.
template <class Params>
std::int64_t end_of_segment(std::int64_t first, std::int64_t steady_from, const SetupOf<Params>& setup) {
    std::int64_t end = std::min(first + static_cast<std::int64_t>(longest_segment), setup.steps + 1);
    for (const std::int64_t stop : {setup.steps / 2, setup.steps, steady_from, steady_from + 2}) {
        end = first < stop ? std::min(end, stop) : end;
    }
    return end;
}

// The part of a report that metrics use; NaN if the controller does not report it.
struct CommonReport {
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    Vec2<double> surface{nan, nan};
    Sym2<double> damping{nan, nan, nan}, stiffness{nan, nan, nan};
    double rate = nan;
    std::array<double, 3> bound{nan, nan, nan};
    bool has_rate = false, has_surface = false;

    // `number` extracts one number from a scalar of the report.
    template <class Report, class Number>
    static CommonReport of(const Report& r, Number&& number) {
        CommonReport last;
        const auto sym2 = [&](const auto& a) { return Sym2<double>{number(a.xx()), number(a.xy()), number(a.yy())}; };
        if constexpr (requires { r.damping, r.stiffness; }) {
            last.damping = sym2(r.damping);
            last.stiffness = sym2(r.stiffness);
        }
        if constexpr (requires { r.rate; }) {
            last.rate = number(r.rate);
            last.has_rate = true;
        }
        if constexpr (requires { r.bound; }) {
            last.bound = {number(r.bound[0]), number(r.bound[1]), number(r.bound[2])};
        }
        if constexpr (requires { r.surface; }) {
            last.surface = {number(r.surface.x()), number(r.surface.y())};
            last.has_surface = true;
        }
        return last;
    }
};

// Metrics of a run that lasted for `samples`; bound_halfway is b̂₀ at half of the run, or at its last sample if it ended
// before.
template <class Params>
Metrics metric_values(const MetricsParams& params, const SetupOf<Params>& setup, const MetricsTotals& totals,
                      const CommonReport& last, double bound_halfway, std::int64_t samples) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const double h = setup.common.step;
    const std::int64_t early = std::min(samples, first_steady_sample(params, setup));
    const auto count = [](std::int64_t n) { return static_cast<double>(n); };
    const auto ratio = [](double a, double b) {  // IEEE 754 quotient, without dividing by zero
        return b != 0.0 ? a / b : a > 0.0 ? std::numeric_limits<double>::infinity() : nan;
    };
    const auto rms = [&](const Vec2<double>& sum, double n) {  // NaN: an empty window
        return Vec2<double>{std::sqrt(ratio(sum.x(), n)), std::sqrt(ratio(sum.y(), n))};
    };
    const double late = count(samples - early);
    const Vec2<double> whole = rms(totals.transient.squares + totals.steady.squares, count(samples));
    const Vec2<double> transient = rms(totals.transient.squares, count(early));
    const Vec2<double> steady = rms(totals.steady.squares, late);
    const Vec2<double> effort = rms(totals.transient.force + totals.steady.force, count(samples));
    const auto chattering = [&](double second_difference, double force) {
        return late > 2 ? std::sqrt(ratio(second_difference / (late - 2), force / late)) : nan;
    };
    const auto settled = [&](std::int64_t outside) { return outside < samples - 1 ? count(outside + 1) * h : nan; };
    // Frobenius norm of the error over the norm of the true value.
    const auto relative = [&](const Sym2<double>& estimate, const Sym2<double>& truth) {
        const auto square = [](const Sym2<double>& a) {
            return a.xx() * a.xx() + 2.0 * a.xy() * a.xy() + a.yy() * a.yy();
        };
        return std::sqrt(ratio(square(estimate - truth), square(truth)));
    };
    const GyroscopeParams& p = setup.plant;
    return {.rmse_whole = whole,
            .rmse_transient = transient,
            .rmse_steady = steady,
            .error_settling_time = settled(totals.error_outside),
            .surface_settling_time = last.has_surface ? settled(totals.surface_outside) : nan,
            .chattering = {chattering(totals.second_difference.x(), totals.steady.force.x()),
                           chattering(totals.second_difference.y(), totals.steady.force.y())},
            .effort = effort,
            .rate_error = last.rate - p.rate,
            .rate_error_rms = last.has_rate ? std::sqrt(ratio(totals.rate_squares, late)) : nan,
            .rate_error_peak = last.has_rate ? totals.peak_rate_error : nan,
            .rate_settling_time = last.has_rate ? settled(totals.rate_outside) : nan,
            .damping_error = relative(last.damping, p.damping + p.damping_deviation),
            .stiffness_error = relative(last.stiffness, p.stiffness + p.stiffness_deviation),
            .bound_final = last.bound,
            .bound_0_halfway = bound_halfway,
            .largest_force = totals.largest_force,
            .saturated_share = ratio(totals.saturated, count(samples)),
            .diverged_at = samples > setup.steps ? nan : count(samples) * h};
}

// Runs the samples before `end` with their disturbances from `coming` on, and sums what metrics use.
template <Controller C>
void measure_part(typename Stepper<C>::Pending& state, const typename Stepper<C>::Coefficients& __restrict c,
                  std::int64_t end, const Vec2<double>* coming, MetricsSums<typename C::Value>& sums) {
    auto own = copied(sums);
    Stepper<C>::run_part(state, c, end, coming, [&](const auto& at) { own.add(at.signals, at.signals.report); });
    sums = own;
}

// The metrics of one run by itself, with the bits that it has in a lane (batch.hpp). `part`: as measure_part;
// `between_steps(state, coefficients)`: the common report before the coming step.
template <Controller C, class Params, class Part, class BetweenSteps>
Metrics measure_segments(const SetupOf<Params>& setup, const MetricsParams& params, FillNoise noise, Part&& part,
                         BetweenSteps&& between_steps) {
    using T = typename C::Value;
    using Loop = Stepper<C>;
    const auto number = [](const T& a) { return static_cast<double>(a); };
    const std::int64_t samples = setup.steps + 1, half = setup.steps / 2;
    const std::int64_t steady_from = first_steady_sample(params, setup);
    const auto coefficients = Loop::prepare(setup);
    auto state = Loop::begin(setup);
    const Disturbance disturbance(setup.disturbance, setup.common.step, noise);
    std::array<Vec2<double>, longest_segment> coming{};
    MetricsSums<T> sums{.error_bound_squared = T(params.error_bound * params.error_bound),
                        .surface_bound_squared = T(params.surface_bound * params.surface_bound),
                        .rate = T(setup.plant.rate),
                        .rate_bound = T(params.rate_tolerance * absolute(setup.plant.rate)),
                        .force_limit = T(setup.common.force_limit)};
    MetricsTotals totals{};
    CommonReport last{}, halfway{};
    const auto reported = [&] { return between_steps(state.controller, coefficients.controller); };
    while (state.step < samples && bounded(state.motion)) {
        const std::int64_t first = state.step, end = end_of_segment(first, steady_from, setup);
        if (first == half) {
            halfway = reported();
        }
        if (first == samples - 1) {
            last = reported();
        }
        disturbance.fill(first, std::span(coming).first(static_cast<std::size_t>(end - first)));
        part(state, coefficients, end, coming.data(), sums);
        totals.add(segment_of<T>(sums.segment, number), first, steady_from);
        sums.segment = {};
    }
    if (state.step < samples) {  // diverged: values known after its last sample
        last = reported();
    }
    return metric_values(params, setup, totals, last, (state.step <= half ? last : halfway).bound[0], state.step);
}
// The same of a typed controller. `part`: measure_part, or a copy of it for this processor.
template <Controller C, class Params>
Metrics measure_alone(const SetupOf<Params>& setup, const MetricsParams& params, FillNoise noise,
                      decltype(&measure_part<C>) part = &measure_part<C>) {
    const auto number = [](const typename C::Value& a) { return static_cast<double>(a); };
    return measure_segments<C>(setup, params, noise, part, [&](const auto& state, const auto& coefficients) {
        return CommonReport::of(C::report(state, coefficients), number);
    });
}

}  // namespace fracgyro
