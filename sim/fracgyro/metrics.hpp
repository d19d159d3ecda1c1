// Metrics of one run gathered while it runs, in constant memory. python/fracgyro/metrics.py defines the same quantities
// on recorded runs; a test compares the two.
#pragma once

#include "loop.hpp"

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

class MetricsAccumulator {
public:
    MetricsAccumulator(const MetricsParams& p, const Setup& setup)
        : params_(p), setup_(setup), step_(setup.controller.step) {}

    template <Scalar T>
    void operator()(const Snapshot<T>& at) {
        const auto vec = [](const Vec2<T>& a) {
            return Vec2<double>{static_cast<double>(a.x), static_cast<double>(a.y)};
        };
        const Vec2<double> e = vec(at.signals.error.value);
        const Vec2<double> u = vec(at.signals.force);
        const Vec2<double> squares = e * e;
        const double time = static_cast<double>(at.step) * step_;
        const bool early = time < params_.transient;
        Window& window = early ? transient_ : steady_;
        window.add(squares);
        if (!(squares.x + squares.y <= params_.error_bound * params_.error_bound)) {
            error_outside_ = at.step;
        }
        const Vec2<double> surface = vec(at.signals.surface);
        if (!(norm(surface) <= params_.surface_bound)) {
            surface_outside_ = at.step;
        }
        const double rate = static_cast<double>(at.signals.estimates.rate);
        const double off = absolute(rate - setup_.plant.rate);
        if (!(off <= params_.rate_tolerance * absolute(setup_.plant.rate))) {
            rate_outside_ = at.step;
        }
        peak_rate_error_ = maximum(peak_rate_error_, off);
        if (!early) {
            rate_squares_ += off * off;
            // Second differences see what flips from sample to sample and not what is smooth.
            if (steady_.count > 2) {
                const Vec2<double> bend = (u - past_[0]) - (past_[0] - past_[1]);
                bend_ = bend_ + bend * bend;
            }
            steady_force_ = steady_force_ + u * u;
        }
        force_ = force_ + u * u;
        largest_force_ = maximum(largest_force_, maximum(absolute(u.x), absolute(u.y)));
        past_[1] = past_[0];
        past_[0] = u;
        if (2 * at.step <= setup_.steps) {
            bound_halfway_ = static_cast<double>(at.signals.estimates.bound[0]);
        }
        last_step_ = at.step;
        const auto& est = at.signals.estimates;
        last_rate_ = rate;
        last_damping_ = {double(est.damping.xx), double(est.damping.xy), double(est.damping.yy)};
        last_stiffness_ = {double(est.stiffness.xx), double(est.stiffness.xy), double(est.stiffness.yy)};
        last_bound_ = {double(est.bound[0]), double(est.bound[1]), double(est.bound[2])};
    }

    // In the order of metric_names. NaN: never settled, or an empty window.
    std::array<double, metric_names.size()> values(std::int64_t samples) const {
        constexpr double nan = std::numeric_limits<double>::quiet_NaN();
        const Vec2<double> transient = transient_.rms();
        const Vec2<double> steady = steady_.rms();
        const Window all{.sum = transient_.sum + steady_.sum, .count = transient_.count + steady_.count};
        const Vec2<double> whole = all.rms();
        const Vec2<double> effort = Window{.sum = force_, .count = all.count}.rms();
        const auto ratio = [&](double bend, double force) {
            const double count = static_cast<double>(steady_.count);
            return count > 2 ? std::sqrt((bend / (count - 2)) / (force / count)) : nan;
        };
        const auto settled = [&](std::int64_t outside) {
            return outside < last_step_ ? static_cast<double>(outside + 1) * step_ : nan;
        };
        const PlantParams& p = setup_.plant;
        const double diverged = samples > setup_.steps ? nan : static_cast<double>(samples) * step_;
        return {whole.x,
                whole.y,
                transient.x,
                transient.y,
                steady.x,
                steady.y,
                settled(error_outside_),
                settled(surface_outside_),
                ratio(bend_.x, steady_force_.x),
                ratio(bend_.y, steady_force_.y),
                effort.x,
                effort.y,
                last_rate_ - p.rate,
                std::sqrt(rate_squares_ / static_cast<double>(steady_.count)),
                peak_rate_error_,
                settled(rate_outside_),
                relative(last_damping_, p.damping + p.damping_deviation),
                relative(last_stiffness_, p.stiffness + p.stiffness_deviation),
                last_bound_[0],
                last_bound_[1],
                last_bound_[2],
                bound_halfway_,
                largest_force_,
                diverged};
    }

private:
    struct Window {
        Vec2<double> sum{};
        std::int64_t count = 0;
        void add(Vec2<double> squares) {
            sum = sum + squares;
            ++count;
        }
        Vec2<double> rms() const {
            const double n = static_cast<double>(count);  // 0/0 is NaN: an empty window has no RMS
            return {std::sqrt(sum.x / n), std::sqrt(sum.y / n)};
        }
    };
    // Frobenius norm of the error over that of the truth.
    static double relative(const Sym2<double>& estimate, const Sym2<double>& truth) {
        const auto square = [](const Sym2<double>& a) { return a.xx * a.xx + 2.0 * a.xy * a.xy + a.yy * a.yy; };
        return std::sqrt(square(estimate - truth) / square(truth));
    }

    MetricsParams params_;
    const Setup& setup_;
    double step_;
    Window transient_{}, steady_{};
    Vec2<double> force_{}, steady_force_{}, bend_{};
    std::array<Vec2<double>, 2> past_{};
    std::int64_t error_outside_ = -1, surface_outside_ = -1, rate_outside_ = -1, last_step_ = -1;
    double peak_rate_error_ = 0.0, rate_squares_ = 0.0, largest_force_ = 0.0, bound_halfway_ = 0.0;
    double last_rate_ = 0.0;
    Sym2<double> last_damping_{}, last_stiffness_{};
    std::array<double, 3> last_bound_{};
};

template <Scalar T>
std::array<double, metric_names.size()> measure(const Setup& setup, const MetricsParams& params) {
    MetricsAccumulator metrics(params, setup);
    std::int64_t samples = 0;
    with_controller<T>(setup.kind, [&]<class Controller>() { samples = run_loop<Controller>(setup, metrics); });
    return metrics.values(samples);
}

}  // namespace fracgyro
