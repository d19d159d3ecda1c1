// Feedback of the error and of earlier forces that has the least error for a given smoothness of the force:
// linear-quadratic control with a price on second differences.
//
//        u_f = -k_e e - k_v ė - k_1 p_1 - k_2 p_2 - ...
//
//    with p the values of u_f before. The gains are constant. They have the least sum of e² + |second difference of
//    u_f|² h⁴/(ω h)⁸ about the nominal plant, for a force of which a share comes a step later than stated.
//
//    Under a force limit, an error beyond `near` counts as 2 √(near |e|) - near: half the limit can brake the approach.
//
//    The gains are computed once in double precision. In units of the step, [e/h², ė/h] is of order 1 for a force of
//    order 1. Each axis has gains of its own, for a plant without coupling: within a step, coupling moves the mass very
//    little.
//
// Source: textbook; docs/decisions/0047 and 0049.
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/held_plant.hpp"
#include "fracgyro/core/riccati.hpp"

namespace fracgyro {

struct SmoothFeedbackParams {
    double loop_bandwidth = 0.75;  // ω h
    double delay_margin = 1.0;     // m

    static constexpr auto fields() {
        using P = SmoothFeedbackParams;
        return Fields{
            field(
                "loop_bandwidth", &P::loop_bandwidth, "1", {.low = 0.02, .high = 2.5},
                "omega h, no unit: bandwidth of the loop, in radians per step, 0.02 to 2.5. More follows closer, with "
                "more chattering. With delay_margin = 1.0 it is limited to 1.1, and less if a delay is stated."),
            field("delay_margin", &P::delay_margin, "1", {.low = 0.0, .high = 1.0},
                  "No unit, 0 to 1: robustness to one step of delay that the datasheet does not state. 1.0: it at most "
                  "doubles the error. 0.0: off, the least error if the stated delay is exact."),
        };
    }
};

struct SmoothFeedbackDesign {
    static constexpr std::size_t max_past = 9;  // for a delay of 8
    static constexpr std::size_t room = 2 + max_past;
    static constexpr double braking = 0.5;   // share of the force limit for the approach from afar
    using Gains = std::array<double, room>;  // for e, ė and earlier forces

    std::size_t past = 2;
    std::array<Gains, 2> axes{};

    // One step of delay more than stated makes a fast loop unstable, so that the feedback is designed for a force of
    // which a share comes a step later than stated. With these numbers and a margin of 1 such a step costs at most a
    // factor of 2 in error at every bandwidth and delay, at the least nominal error (docs/decisions/0047). Above the
    // usable bandwidth the loop with a late share would be unstable without such a step.
    static double usable(double bandwidth, double margin, double delay) {
        const double exact = 1.0 - margin;
        return minimum(bandwidth, (1.1 + 1.4 * exact * exact * exact) / (1.0 + 0.5 * margin * delay));
    }
    static double late_share(double bandwidth, double margin, double delay) {
        return margin * maximum(0.0, 1.0 - 0.29 / bandwidth) / (1.0 + 0.25 * delay);
    }

    [[gnu::noinline]] static SmoothFeedbackDesign prepare(const SmoothFeedbackParams& p, const Common& common,
                                                          std::int64_t stated_delay) {
        const auto delay = static_cast<std::size_t>(stated_delay);
        const auto steps = static_cast<double>(stated_delay);
        const double bandwidth = usable(p.loop_bandwidth, p.delay_margin, steps);
        const double late = late_share(bandwidth, p.delay_margin, steps);
        SmoothFeedbackDesign found{.past = delay + 1 < 2 ? 2 : delay + 1};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            found.axes[axis] =
                found.design(held_plant::one_axis(common.nominal, common.step, axis), bandwidth, late, delay);
            found.axes[axis][0] = found.axes[axis][0] / (common.step * common.step);
            found.axes[axis][1] = found.axes[axis][1] / common.step;
        }
        return found;
    }

private:
    // u_n = 2 u_(n-1) - u_(n-2) + v, and v is priced.
    Gains design(const Matrix<3>& plant, double bandwidth, double late, std::size_t delay) const {
        LeadingMatrix<room> a{.size = 2 + past}, weight{.size = a.size};
        Table<room, 1> b{};
        weight[0][0] = 1.0;
        for (std::size_t row = 0; row < 2; ++row) {
            a[row][0] = plant[row][0];
            a[row][1] = plant[row][1];
            const double push = plant[row][2], now = (1.0 - late) * push;
            if (delay == 0) {
                b[row][0] = now;
                a[row][2] = 2.0 * now;
                a[row][3] = -now;
            } else {
                a[row][1 + delay] = now;
            }
            a[row][2 + delay] += late * push;
        }
        b[2][0] = 1.0;
        a[2][2] = 2.0;
        a[2][3] = -1.0;
        for (std::size_t row = 3; row < a.size; ++row) {
            a[row][row - 1] = 1.0;
        }
        const double square = bandwidth * bandwidth, fourth = square * square;
        const std::array<double, 1> price{1.0 / (fourth * fourth)};
        const auto gain = riccati_gain(riccati(a, b, weight, price), b, price);
        Gains k{};
        for (std::size_t i = 0; i < a.size; ++i) {
            for (std::size_t j = 0; j < a.size; ++j) {
                k[j] += gain[0][i] * a[i][j];
            }
        }
        k[2] -= 2.0;
        k[3] += 1.0;
        return k;
    }
};

template <Scalar T>
struct SmoothFeedback {
    using Design = SmoothFeedbackDesign;
    using Forces = std::array<Vec2<T>, Design::max_past>;  // u_f, the last one first

    struct Coefficients {
        std::array<Vec2<T>, 2> error{};  // k_e, k_v
        Forces past{};                   // k_1, k_2, ...
        Vec2<T> near{};
        std::int32_t remembered = 2;
        bool brakes = false;
    };

    static Coefficients prepare(const SmoothFeedbackParams& p, const Common& common, std::int64_t delay) {
        const Design found = Design::prepare(p, common, delay);
        const auto gain = [&](std::size_t i) { return Vec2<T>{T(found.axes[0][i]), T(found.axes[1][i])}; };
        Coefficients c{.error = {gain(0), gain(1)},
                       .remembered = static_cast<std::int32_t>(found.past),
                       .brakes = common.force_limit < std::numeric_limits<double>::infinity()};
        for (std::size_t i = 0; i < found.past; ++i) {
            c.past[i] = gain(2 + i);
        }
        if (c.brakes) {
            const auto near = [&](std::size_t axis) {
                const double slope = found.axes[axis][0] / found.axes[axis][1];
                return 0.5 * Design::braking * common.force_limit / (slope * slope);
            };
            c.near = {T(near(0)), T(near(1))};
        }
        return c;
    }

    // u_f for this error.
    static Vec2<T> force(const Coefficients& c, const Sample<T>& e, const Forces& past) {
        const Vec2<T> near = c.brakes ? reachable(c, e.value) : e.value;
        Vec2<T> follows = -(c.error[0] * near + c.error[1] * e.derivative);
        for (std::size_t i = 0; i < static_cast<std::size_t>(c.remembered); ++i) {
            follows = follows - c.past[i] * past[i];
        }
        return follows;
    }
    // Adds the u_f that acts: less than the wanted one at the force limit, so that nothing winds up.
    static void remember(const Coefficients& c, Forces& past, const Vec2<T>& acts) {
        for (std::size_t i = static_cast<std::size_t>(c.remembered); i-- > 1;) {
            past[i] = past[i - 1];
        }
        past[0] = acts;
    }

private:
    static Vec2<T> reachable(const Coefficients& c, const Vec2<T>& error) {
        const Vec2<T> size = absolute(error);
        const Vec2<T> far = T(2.0) * square_root(c.near * size) - c.near;
        return with_sign_of(error, if_less(size, c.near, size, far));
    }
};

}  // namespace fracgyro
