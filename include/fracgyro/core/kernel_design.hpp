// Kernel design: the constants of a fractional operator in fixed memory.
//
// The kernel of I^(1-α) and of the Caputo derivative D^α, 0 < α < 1, eq. (7), is
//
//     k(t) = t^(-α)/Γ(1-α) = sin(πα)/π ∫ s^(α-1) exp(-s t) ds over [0, ∞).
//
// `design` replaces it on [shortest, longest] by Σ weights·exp(-poles·t), all weights and poles positive (each
// exponential is a stable first-order lag), with nearly the fewest exponentials that keep the relative error below a
// tolerance. The best sum of n exponentials is the one whose relative error takes its maximum with alternating sign at
// 2n+1 times (Braess, "Nonlinear approximation theory", 1986), and is found as follows.
//
//     1. start: an analytic estimate of the optimal poles and weights, and of the times.
//     2. level: equal error at the 2n+1 times, by Levenberg-Marquardt in (log weight, log pole).
//     3. exchange: the times become the extrema of the error (Remez), until the error is level to 2 %.
//     4. certify: a bound on the error over the continuous range, not only at samples.
//
// A design takes milliseconds and is made once, beforehand. It calls only the functions of elementary.hpp, and all sums
// are in a fixed order: the same arguments give the same bits on every processor.
//
// Inside, time runs over [1, R]; x = log t in [0, log R]; the kernel is t^(-α).
#pragma once

#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/exponential_sum.hpp"
#include "fracgyro/core/kernel_certificate.hpp"
#include "fracgyro/core/kernel_start.hpp"

namespace fracgyro {

class KernelDesign {
public:
    static constexpr std::size_t max_terms = 80;
    static constexpr double earliest = 1e-200, latest = 1e200;  // range of `shortest`
    static constexpr double largest_ratio = 1e10;               // maximum of longest/shortest
    static constexpr double smallest_tolerance = 1e-11, largest_tolerance = 1e-1;

    std::size_t count = 0;  // number of exponentials; 0: none were found, or the arguments are outside the ranges above
    double error = 0.0;     // proven bound on |sum/kernel - 1| over the range
    std::array<double, max_terms> poles{}, weights{};  // poles ascending

    // Fewest positive exponentials, to within one.
    void design(double order, double shortest, double longest, double tolerance) {
        count = 0;
        if (!(0.0 < order && order < 1.0 && earliest <= shortest && shortest <= latest && shortest < longest &&
              longest <= largest_ratio * shortest && smallest_tolerance <= tolerance &&
              tolerance <= largest_tolerance)) {
            return;
        }
        order_ = order;
        excess_ = (longest - shortest) / shortest;
        span_ = logarithm_of_one_plus(excess_);
        // An order far below the tolerance gets the exponentials of a larger order, a hundredth of the tolerance away:
        // its own poles would be so slow that the integral, a difference divided by the pole, would drown in rounding.
        // The certified error is still against the order itself.
        shape_ = maximum(order, 0.01 * tolerance / (1.0 + span_));
        // Minimax errors are log(error) = log(α) + 0.65 + 1.5 α - decay·count, to within 0.5 or so (a fit); the decay
        // is Zolotarev's for wide ranges, and the decay of polynomial interpolation for narrow ones.
        const double decay =
            maximum(9.86960440108935861883 / (quarter_period(excess_) + 0.25), 2.0 * logarithm(8.0 / span_));
        const double estimate = (logarithm(shape_ / tolerance) + 0.65 + 1.5 * shape_) / decay;
        std::size_t n = estimate > 1.0 ? whole_above(estimate) : 1;
        double bound = n <= max_terms ? certified(n) : std::numeric_limits<double>::infinity();
        while (bound > tolerance) {
            if (++n > max_terms) {
                return;
            }
            bound = certified(n);
        }
        keep(n, bound, shortest);
        const double per_term = exponential(0.8 * decay);
        while (n > 1 && bound * per_term <= tolerance) {  // one exponential fewer may suffice: try it
            bound = certified(--n);
            if (bound > tolerance) {
                return;
            }
            keep(n, bound, shortest);
        }
    }

private:
    static constexpr std::size_t most_times = 2 * max_terms + 1;
    static constexpr std::size_t pieces = 12;  // pieces of the grid between two alternation times
    using PerTerm = std::array<double, max_terms>;

    struct Sum {
        PerTerm log_weight{}, log_pole{}, weight{}, pole{};
        double level = 0.0;
    };

    double order_ = 0.0, shape_ = 0.0;
    double excess_ = 0.0, span_ = 0.0;  // R - 1, log R
    std::size_t n_ = 0;                 // exponentials
    Sum sum_{}, best_{};
    std::array<double, most_times> log_times_{};
    std::array<double, pieces * most_times> grid_{}, errors_{};
    // [damping; Jacobian], the damping upper triangular; the last column is the right side, then the result.
    using Row = std::array<double, most_times + 1>;
    std::array<Row, most_times> triangle_{}, jacobian_{};

    static std::size_t whole_above(double positive) {
        const auto whole = static_cast<std::size_t>(positive);
        return whole + (static_cast<double>(whole) < positive ? 1 : 0);
    }

    double certified(std::size_t n) {
        n_ = n;
        minimax();
        return certified_error(order_, span_, n_, best_.pole.data(), best_.weight.data());
    }

    void keep(std::size_t n, double bound, double shortest) {
        count = n;
        error = bound;
        const double unit = (1.0 - order_) / (gamma_from_one_to_two(2.0 - order_) * power(shortest, order_));
        for (std::size_t j = 0; j < n; ++j) {
            poles[j] = best_.pole[j] / shortest;
            weights[j] = best_.weight[j] * unit;
        }
    }

    // -- 2 ------------------------------------------------------------------------------------------------------------

    void take_exponentials() {
        for (std::size_t j = 0; j < n_; ++j) {
            sum_.weight[j] = exponential(sum_.log_weight[j]);
            sum_.pole[j] = exponential(sum_.log_pole[j]);
        }
    }

    // w_j t^α exp(-s_j t) and s_j t of each exponential; the relative error is the sum of the first, less 1, which is
    // returned.
    double terms(double log_time, double* term, double* decay) const {
        const double time = exponential(log_time), grown = exponential(shape_ * log_time);
        for (std::size_t j = 0; j < n_; ++j) {
            decay[j] = sum_.pole[j] * time;
            term[j] = sum_.weight[j] * grown * exponential(-decay[j]);
        }
        double total = 0.0;
        for (std::size_t j = 0; j < n_; ++j) {
            total += term[j];
        }
        return total - 1.0;
    }

    // Solves error(t_i) = (-1)^i level at 2n+1 times for weights, poles and level, with damping proportional to the
    // residual: quadratic convergence, and no motion along the directions that the data cannot see. (Their singular
    // values fall to level²; a plain Newton step along them is rounding error divided by nearly nothing.)
    void level() {
        const std::size_t unknowns = 2 * n_ + 1;
        PerTerm decay;
        for (int iteration = 0; iteration < 24; ++iteration) {
            take_exponentials();
            double squares = 0.0;
            for (std::size_t i = 0; i < unknowns; ++i) {
                Row& row = jacobian_[i];
                const double sign = i % 2 == 0 ? 1.0 : -1.0;
                const double residual = terms(log_times_[i], row.data(), decay.data()) - sign * sum_.level;
                for (std::size_t j = 0; j < n_; ++j) {
                    row[n_ + j] = -row[j] * decay[j];
                }
                row[unknowns - 1] = -sign;
                row[unknowns] = -residual;
                squares += residual * residual;
            }
            const double size = square_root(squares / static_cast<double>(unknowns));
            if (size <= maximum(1e-2 * absolute(sum_.level), 1e-15)) {
                return;
            }
            for (std::size_t k = 0; k < unknowns; ++k) {
                triangle_[k] = {};
                triangle_[k][k] = k + 1 < unknowns ? 1e-2 * size : 0.0;
            }
            solve_least_squares(unknowns);
            double largest = 1e-300;
            for (std::size_t k = 0; k + 1 < unknowns; ++k) {
                largest = maximum(largest, absolute(triangle_[k][unknowns]));
            }
            const double share = minimum(1.0, 1.0 / largest);  // at most a factor e per step
            for (std::size_t j = 0; j < n_; ++j) {
                sum_.log_weight[j] += share * triangle_[j][unknowns];
                sum_.log_pole[j] += share * triangle_[n_ + j][unknowns];
            }
            sum_.level += share * triangle_[unknowns - 1][unknowns];
        }
        take_exponentials();
    }

    // Least squares by QR of [triangle; jacobian] with Householder reflections: not normal equations, which square the
    // condition number. Each reflection leaves the rows of the triangle below its own unchanged. The solution is left
    // in the triangle's last column.
    void solve_least_squares(std::size_t unknowns) {
        Row projection;
        for (std::size_t k = 0; k < unknowns; ++k) {
            Row& top = triangle_[k];
            double below = 0.0;
            for (std::size_t i = 0; i < unknowns; ++i) {
                below += jacobian_[i][k] * jacobian_[i][k];
            }
            const double length = square_root(top[k] * top[k] + below);
            const double head =
                top[k] + with_sign_of(top[k], length);  // pivot of the reflected vector; its rest is the column
            if (!(length > 0.0)) {
                continue;
            }
            const double factor = 2.0 / (head * head + below);
            for (std::size_t c = k + 1; c <= unknowns; ++c) {
                projection[c] = head * top[c];
            }
            for (std::size_t i = 0; i < unknowns; ++i) {
                const Row& row = jacobian_[i];
                const double part = row[k];
                for (std::size_t c = k + 1; c <= unknowns; ++c) {
                    projection[c] += part * row[c];
                }
            }
            for (std::size_t c = k + 1; c <= unknowns; ++c) {
                projection[c] *= factor;
                top[c] -= head * projection[c];
            }
            for (std::size_t i = 0; i < unknowns; ++i) {
                Row& row = jacobian_[i];
                const double part = row[k];
                for (std::size_t c = k + 1; c <= unknowns; ++c) {
                    row[c] -= part * projection[c];
                }
            }
            top[k] = -with_sign_of(top[k], length);
        }
        for (std::size_t k = unknowns; k-- > 0;) {
            double& result = triangle_[k][unknowns];
            for (std::size_t c = k + 1; c < unknowns; ++c) {
                result -= triangle_[k][c] * triangle_[c][unknowns];
            }
            result /= triangle_[k][k];
        }
    }

    // -- 3 ------------------------------------------------------------------------------------------------------------

    // Exponentials of nearly the minimum maximum relative error.
    void minimax() {
        start_times(excess_, span_, n_, log_times_.data());
        start_terms(shape_, span_, n_, sum_.log_weight.data(), sum_.log_pole.data());
        sum_.level = 0.0;
        best_ = sum_;
        double least = std::numeric_limits<double>::infinity();
        for (int exchange = 0; exchange < 5; ++exchange) {
            level();
            const auto [highest, lowest] = to_extrema();
            if (highest < least) {
                best_ = sum_;
                least = highest;
            }
            if (highest <= 1.02 * lowest || lowest == 0.0) {
                break;
            }
        }
    }

    struct Levels {
        double highest{}, lowest{};
    };
    // Moves the times to the 2n+1 extrema of the error, and finds the maximum and minimum of its levels there. If the
    // error does not have exactly 2n-1 interior extrema, the minimum is 0 and the times stay.
    Levels to_extrema() {
        const std::size_t intervals = 2 * n_, last = intervals * pieces;
        PerTerm term, decay;
        Levels levels;
        for (std::size_t g = 0; g <= last; ++g) {
            const std::size_t i = g / pieces;
            const double part = static_cast<double>(g % pieces) / double{pieces};
            grid_[g] = g == last ? log_times_[intervals] : log_times_[i] + (log_times_[i + 1] - log_times_[i]) * part;
            errors_[g] = terms(grid_[g], term.data(), decay.data());
            if (!(absolute(errors_[g]) < std::numeric_limits<double>::infinity())) {
                return {.highest = std::numeric_limits<double>::infinity()};
            }
            levels.highest = maximum(levels.highest, absolute(errors_[g]));
        }
        std::array<double, most_times> vertices;
        std::size_t found = 0;
        double least = minimum(absolute(errors_[0]), absolute(errors_[last]));
        for (std::size_t g = 1; g < last; ++g) {
            const double before = errors_[g] - errors_[g - 1], after = errors_[g + 1] - errors_[g];
            if (!(before * after < 0.0)) {
                continue;
            }
            if (++found >= intervals) {
                return levels;
            }
            const double left = grid_[g] - grid_[g - 1], right = grid_[g + 1] - grid_[g];
            const double slope_left = before / left, slope_right = after / right;
            vertices[found] = grid_[g] - (slope_left * right + slope_right * left) / (2.0 * (slope_right - slope_left));
            least = minimum(least, absolute(errors_[g]));
        }
        if (found + 1 != intervals) {
            return levels;
        }
        levels.lowest = least;
        for (std::size_t i = 1; i <= found; ++i) {
            log_times_[i] = vertices[i];
        }
        return levels;
    }
};

// The kernel of I^(1-order) for samples `step` apart over `duration`, at least 10 steps; without exponentials for
// orders 0 and 1. For other orders a count of 0 means that none meet the tolerance within the ranges above.
inline ExponentialSum designed_kernel(KernelDesign& workspace, double order, double step, double duration,
                                      double tolerance) {
    ExponentialSum kernel{.order = order, .gamma = gamma_from_one_to_two(2.0 - order)};
    if (order == 0.0 || order == 1.0) {
        kernel.gamma = 1.0;
        return kernel;
    }
    workspace.design(order, step, maximum(duration, 10.0 * step), tolerance);
    if (workspace.count <= ExponentialSum::capacity) {
        kernel.count = workspace.count;
        kernel.error = workspace.error;
        for (std::size_t j = 0; j < kernel.count; ++j) {
            kernel.poles[j] = workspace.poles[j];
            kernel.weights[j] = workspace.weights[j];
        }
    }
    return kernel;
}

}  // namespace fracgyro
