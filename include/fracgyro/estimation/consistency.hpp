// 5  Consistency of an estimator (joint.hpp, composite.hpp) with its sensors, judged by its innovations r and their
//    stated variances S.
//
//    Each number is judged given the preceding numbers of the same sample: exact sensors move positions and velocities
//    together. Over a window of four periods the mean of r²/S is 1 if the model is right. An angular rate that moves
//    faster than the filter follows adds a known part: an error ε of Ω̂z adds g ε to r (joint.hpp: g is the column of
//    Ωz in U). Least squares over the window give
//
//        ε = Σ r g/S / Σ g²/S,    explained = (Σ r g/S)² / Σ g²/S,    excess = mean r²/S - explained
//
//    The filter is consistent while excess <= 1.25 + 3 times the mean of `explained` over eight windows: vehicles that
//    turn at the edge of the bandwidth leave 0.6 of `explained`, sensor faults 2.4 to 1,000 times of it. The stated
//    variance of Ω̂z is P max(1, excess) + the maximum of ε², its mean, and the ε² that would explain all of r²/S
//    beyond 1.25: for a rate that turns faster than the filter follows, ε is only a part.
//
//    A force that is later than the filter assumes: each change of the force enters a step too late, with an effect b
//    on the next r, and ℓ on it and all later ones (joint.hpp). A sample beyond eight deviations that is below four
//    times b is due to it, not to the sensor. From then on the filter adds the change of the force to its process
//    noise, and Ω̂z is not trusted, until Σ r ℓ/S has been within five deviations of 0 for four windows. A delay is
//    not noise and does not average out: meanwhile the stated deviation is eight times as large.
//
//    Disagreement: a motion is smooth and a failing sensor is not. A disagreement is three innovations in a row beyond
//    eight deviations, with a second difference beyond twenty among them; an inconsistency that lasts for four windows;
//    or estimates that have moved once it is over, by more than a rate that turned meanwhile may move them. The
//    estimates return to their values before and their variances to the prior. From then on D̂ and K̂ are compared with
//    the values before: Ω̂z is not trusted until they have agreed for four windows, nor when they disagree later, as
//    they may in a lasting fault. While they disagree they are learned again every 32 windows, or `longest` samples if
//    these are more. The joint filter trusts nothing for as many samples at first, during which a dynamic rate spoils D̂
//    and K̂ unseen. If they never agree, the plant has changed, which is accepted after `acceptance` samples. An
//    inconsistency whose excess is, within a factor of four, as large as one after which they were learned again is an
//    error of the model and does not trigger relearning: each relearning makes the estimate of Ωz jump.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>
#include <cstddef>

namespace fracgyro {

template <Scalar T, std::size_t parameters>
struct Consistency {
    using Row = std::array<T, parameters>;
    static constexpr double max_innovation = 8.0;    // deviations: noise never reaches it
    static constexpr double max_excess = 1.25;       // five deviations of a mean over a window
    static constexpr double max_unexplained = 3.0;   // times the part explained by a dynamic rate
    static constexpr double max_difference = 5.0;    // deviations of an estimate from that before a disagreement
    static constexpr double turn_share = 0.5;        // share of the part explained by a rate that may move estimates
    static constexpr double max_refused = 3.0;       // in a row
    static constexpr double max_bend = 20.0;         // deviations of a second difference: eight for white noise
    static constexpr double max_change = 4.0;        // ratio to an excess against which relearning does not help
    static constexpr double max_late = 4.0;          // times the effect of a late force, by which it explains a sample
    static constexpr double max_chance = 25.0;       // square of the deviations at which a delay shows
    static constexpr double relearning = 32.0;       // windows
    static constexpr double acceptance = 131'072.0;  // samples

    struct Coefficients {
        T limit{};                  // square of the maximum innovation, over its variance
        T weight{}, slow_weight{};  // weights of a sample in the means
        T sensors{}, per_sensor{};
        T unexplained{};                          // mean of `explained` without any motion
        T patience{}, agreement{}, relearning{};  // samples: of an inconsistency, of estimates that agree or do not
        T start{};                                // samples before any estimate is trusted
        T window{};                               // samples; not a count, which runs in parallel must share
    };
    struct Known {
        Row value{}, variance = filled(T(unknown));
    };
    struct Delay {
        T late{}, lost{};     // samples for which a delay is still suspected; 1: as of the last
        T along{}, square{};  // means of r ℓ/S and ℓ²/S
    };
    struct State {
        T squares = T(1.0), along{}, sensitivity{};  // means of r²/S, r g/S, g²/S
        T now{}, explained{};                        // part explained by ε, and its slow mean
        std::array<T, 4> last{}, rise{};             // residual, and its last change
        T beyond{}, jumped{};                        // samples beyond the limit in a row; 1: a jump is among them
        T refused{};                                 // 1: the last sample was rejected
        Delay delay{};
        T inconsistent{};           // 1: excess is beyond its limit
        T lasting{};                // inconsistent samples, less consistent ones
        std::array<T, 2> futile{};  // min and max excess with which relearning began
        T moved{}, most{};          // 1: not compared since; maximum explained by ε since
        T doubted{}, learning{};    // samples since the first disagreement, and since the last or the start
        T agreed{};                 // samples in a row
        T age{};                    // age of the window, samples
        Known before{}, recent{};   // estimates, one to two windows old and up to one
    };

    // `turn`: windows in the mean of `explained`; `start`: samples before anything is trusted; `longest`: maximum
    // number of samples for learning the estimates.
    static Coefficients prepare(double period, double step, std::size_t sensors, double turn, double start,
                                double longest) {
        const double window = clamp(4.0 * period / step, 16.0, 65536.0), count = static_cast<double>(sensors);
        return {.limit = T(max_innovation * max_innovation),
                .weight = T(1.0 / window),
                .slow_weight = T(1.0 / (turn * window)),
                .sensors = T(count),
                .per_sensor = T(1.0 / count),
                .unexplained = T(0.5 / (window * count)),
                .patience = T(4.0 * window),
                .agreement = T(4.0 * window),
                .relearning = T(minimum(relearning * window, longest)),
                .start = T(minimum(start * window, longest)),
                .window = T(window)};
    }

    static T excess(const State& state) { return state.squares - state.now; }
    // ε² now or its mean, without the contribution of noise.
    static T lag_variance(const State& state, const Coefficients& c) { return of_rate(state, c, T(0.0)); }
    // A rate that turns faster than the filter follows is explained only in part: the rest of r²/S may also be due to
    // it.
    static T variance(const State& state, const Coefficients& c, T stated) {
        const T if_late = if_less(T(0.0), state.delay.late, T(max_innovation * max_innovation), T(1.0));
        return if_late * (stated * maximum(excess(state), T(1.0))) + of_rate(state, c, state.squares - T(max_excess));
    }
    // 1 while the estimates may be trusted as far as the innovations show.
    static T sound(const State& state, const Coefficients& c) {
        const T yes = T(1.0), no = T(0.0), half = T(0.5);
        const T started = if_less(state.learning, c.start, no, yes);
        const T learned = if_less(state.learning, c.relearning, no, yes);
        const T agreed = if_less(state.agreed, c.agreement, no, yes);
        const T settled = if_less(state.before.variance[1], T(unknown), agreed, learned);
        const T known = if_less(state.doubted + state.moved * calm(state), half, started, settled);
        return if_less(state.inconsistent + late(state), half, known, no);
    }

    // 1 if the last sample was not learned from.
    static T refused(const State& state) { return state.refused; }

    // 1 while the force may be later than the filter assumes, and 1 if the last sample was the first to show it.
    static T late(const State& state) { return if_less(T(0.0), state.delay.late, T(1.0), T(0.0)); }
    static T lost(const State& state) { return state.delay.lost; }

    // One sample: residuals, their precisions 1/S, g, and the effect of one more step of delay: ℓ, and that of the last
    // change of the force. Returns 1 if it is learned from.
    template <std::size_t sensors>
    static T judge(State& state, const Coefficients& c, const std::array<T, sensors>& residual,
                   const std::array<T, sensors>& precision, const std::array<T, sensors>& sensitivity,
                   const std::array<T, sensors>& delayed = {}, const std::array<T, sensors>& kick = {}) {
        const T zero = T(0.0), one = T(1.0), limit = c.limit;
        const T lag = limit * lag_variance(state, c), suspects = late(state);
        T squares = zero, along = zero, gain = zero, far = zero, bent = zero, farther = zero, other = zero;
        T along_delay = zero, delay = zero;
        for (std::size_t i = 0; i < sensors; ++i) {
            const T weighted = sensitivity[i] * precision[i], square = residual[i] * residual[i] * precision[i];
            const T of_rate = sensitivity[i] * weighted, near = limit + lag * of_rate;
            far = if_less(square, near, far, one);  // also true for NaN
            const T late = kick[i] * kick[i] * precision[i];
            farther = if_less(square, near + limit * late, farther, one);
            other = if_less(square, maximum(near, T(max_late * max_late) * late), other, one);
            along_delay = along_delay + delayed[i] * residual[i] * precision[i];
            delay = delay + delayed[i] * delayed[i] * precision[i];
            squares = squares + square;
            along = along + residual[i] * weighted;
            gain = gain + of_rate;
            const T rise = residual[i] - state.last[i], bend = rise - state.rise[i];
            bent = if_less(T(max_bend * max_bend), bend * bend * precision[i], one, bent);
            state.last[i] = residual[i];
            state.rise[i] = rise;
        }
        state.delay.lost = far * (one - other) * (one - suspects);
        const T shown = state.delay.along * maximum(state.delay.along, zero);
        const T still = if_less(T(max_chance) * c.weight * state.delay.square, shown, suspects, zero);
        state.delay.late = if_less(zero, state.delay.lost + still, c.agreement, maximum(state.delay.late - one, zero));
        far = if_less(zero, state.delay.lost + suspects, farther, far);
        state.refused = maximum(if_less(state.beyond, T(max_refused), far, zero), state.delay.lost);
        const T learns = one - state.refused;
        const auto follow = [&](T& mean, T weight, T now) {  // a rejected square may be infinite
            mean = if_less(zero, learns, mean + weight * (now - mean), mean);
        };
        state.beyond = far * minimum(state.beyond + one, T(max_refused));
        state.jumped = far * maximum(state.jumped, bent);
        follow(state.delay.along, c.weight, along_delay);
        follow(state.delay.square, c.weight, delay);
        follow(state.squares, c.weight, c.per_sensor * squares);
        follow(state.along, c.weight, along);
        follow(state.sensitivity, c.weight, gain);
        state.now = c.per_sensor * (state.along * state.along) / maximum(state.sensitivity, T(vanishing));
        follow(state.explained, c.slow_weight, state.now);
        return learns;
    }

    // 1 if the samples disagree.
    static T disagrees(State& state, const Coefficients& c) {
        const T zero = T(0.0), one = T(1.0);
        const T limit = T(max_excess) + T(max_unexplained) * state.explained;
        state.inconsistent = if_less(excess(state), limit, zero, one);
        state.lasting = maximum(state.lasting + (state.inconsistent + state.inconsistent - one), zero);
        state.moved = maximum(state.moved, state.inconsistent);
        state.most = state.moved * maximum(state.most, state.explained);
        const T jumped = if_less(state.beyond, T(max_refused), zero, state.jumped);
        state.learning = minimum(state.learning + one, T(acceptance));
        state.age = if_less(state.age + one, c.window, state.age + one, zero);
        const T learned = if_less(state.learning, c.relearning, zero, one), much = excess(state);
        auto& [least, largest] = state.futile;
        const T less = if_less(much * T(max_change), least, one, zero);
        const T other = if_less(largest * T(max_change), much, one, less);
        const T lasts = if_less(state.lasting, c.patience, zero, learned * other);
        const T over = if_less(zero, state.lasting + (T(acceptance) - state.learning), zero, one);
        const T lower = if_less(zero, least, minimum(least, much), much);
        least = if_less(zero, lasts, lower, (one - over) * least);
        largest = if_less(zero, lasts, maximum(largest, much), (one - over) * largest);
        return maximum(jumped, lasts);
    }
    // 1 while the estimates are to be compared with their earlier values.
    static T watched(const State& state) { return maximum(state.doubted, state.moved); }
    // 1 if an estimate agrees with its value before an inconsistency.
    static T near(const State& state, std::size_t k, T estimate, T variance) {
        const T zero = T(0.0), one = T(1.0);
        const T difference = estimate - state.before.value[k], square = difference * difference;
        variance = (variance + state.before.variance[k]) *
                   (maximum(state.squares, one) + maximum(state.explained, T(turn_share) * state.most));
        return if_less(square, T(max_difference * max_difference) * variance, one, zero);
    }
    // Returns 1 on a disagreement with the estimates before an inconsistency that is over. near: agreement of the
    // compared ones.
    static T compare(State& state, const Coefficients& c, T near) {
        const T zero = T(0.0), one = T(1.0), quiet = calm(state);
        const T consistent = one - state.inconsistent;
        const T doubts = if_less(zero, state.doubted, one, zero);
        const T again = maximum(state.moved * quiet, if_less(state.learning, c.relearning, zero, doubts));
        const T disagrees = again * (one - near);
        state.agreed = near * consistent * (state.agreed + one);
        const T settled = if_less(state.agreed, c.agreement, zero, quiet);
        state.moved = state.moved * (one - settled);
        const T doubted = doubts * (state.doubted + one);
        state.doubted = doubted * if_less(doubted, T(acceptance), one, one - consistent);
        return disagrees;
    }
    // Starts doubting after a disagreement, in the runs for which `which` is 1, as if the innovations had matched the
    // model.
    static void doubt(State& state, T which) {
        const T zero = T(0.0), one = T(1.0), keep = one - which;
        state.squares = if_less(zero, which, one, state.squares);
        state.doubted = maximum(state.doubted, which);
        state.learning = keep * state.learning;
        state.along = keep * state.along;
        state.now = keep * state.now;
        state.explained = keep * state.explained;
        state.beyond = keep * state.beyond;
        state.inconsistent = keep * state.inconsistent;
        state.lasting = keep * state.lasting;
        state.moved = keep * state.moved;
        state.most = keep * state.most;
        state.agreed = keep * state.agreed;
    }

    // Stores the estimates once per window, for the next disagreement to return to, unless they may be wrong.
    // estimate(k): one estimate and its variance.
    template <class F>
    static void remember(State& state, const Coefficients& c, F&& estimate) {
        const T half = T(0.5), zero = T(0.0), one = T(1.0);
        if (always_less(half, state.age)) {
            return;
        }
        const T sure = if_less(state.doubted + state.moved + state.beyond, half, one, zero);
        const T due = if_less(state.age, half, if_less(state.learning, c.start, zero, sure), zero);
        const auto keep = [&](T& kept, T now) { kept = if_less(half, due, now, kept); };
        for (std::size_t k = 0; k < parameters; ++k) {
            const auto [value, variance] = estimate(k);
            keep(state.before.value[k], state.recent.value[k]);
            keep(state.before.variance[k], state.recent.variance[k]);
            keep(state.recent.value[k], value);
            keep(state.recent.variance[k], variance);
        }
    }

private:
    static constexpr double unknown = 1e9;
    static constexpr Row filled(T a) {
        Row row{};
        row.fill(a);
        return row;
    }
    static constexpr double vanishing = 1e-30;
    // ε² that causes `explained`, now or in the mean, or at least `least` of r²/S.
    static T of_rate(const State& state, const Coefficients& c, T least) {
        const T now = state.now - T(16.0) * c.unexplained, mean = state.explained - T(3.0) * c.unexplained;
        return c.sensors * maximum(maximum(now, mean), maximum(least, T(0.0))) /
               maximum(state.sensitivity, T(vanishing));
    }
    // 1 if only noise is present.
    static T calm(const State& state) {
        return if_less(state.squares + state.explained, T(max_excess), T(1.0), T(0.0));
    }
};

}  // namespace fracgyro
