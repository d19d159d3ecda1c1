// 5  Joint adaptation: one Kalman filter of the motion and of D, K and Ωz, driven by the innovation. It models the
//    sensors' noise, needs no velocity, and passes its estimate of the motion to the surface and the force. It is an
//    extended Kalman filter, and here a recursive prediction error method (L. Ljung and T. Söderström, "Theory and
//    practice of recursive identification", 1983, ch. 3).
//
//    State: z = [e, ė], the motion less the reference, and θ̃ = (Ωz, Dxx, Dxy, Dyy, Kxx, Kxy, Kyy, K̇/K) less the
//    nominal plant. With q = r + e and r̈ = -ω² r on each axis, eq. (9) is
//
//        ë = u + d - C (ṙ + ė) - K e - (K - ω²) r,      C = D + 2Ω
//
//    in which no large terms cancel near resonance, so that single precision is enough.
//
//    Predict   z by the Taylor series of this equation at the present estimates, the force held: exact to rounding,
//              whatever the estimates, so that nothing has to be linearized again. P by z' = A z + B (φ θ̃ + d), with
//              A the nominal map, corrected to first order, and φ the contribution of the parameters to the force.
//    Correct   by one measured number after another. The gain needs no measurement, so it is computed beforehand.
//
//    P = U diag(d) Uᵀ (core/covariance.hpp), z before θ̃, in units of the variance of the measured position. Without
//    noise of its own θ̃ keeps its part of U and d, which makes a step cheap: the columns of U_zθ advance by A U_zθ + B
//    φ U_θ, and z's part is orthogonalized, by modified Gram-Schmidt on the rows of [A U_z, B] (Bierman 1977, ch. VI).
//
//    If Ωz or the others drift, their variance grows by w² h/I each step, and by no more than the prior: w = 2πf is the
//    required bandwidth, I the information on it per unit of time in a motion on the reference. While D and K are
//    learned, w of Ωz is 30 times as large: the lag of Ωz behind a turning vehicle would otherwise be mistaken for
//    them.
//
//    With `covariance_steps` = m > 1 this is a filter of m steps: z is predicted each step, P over all m at once, and
//    the filter learns from the mean of m residuals, at the end. The work on P is divided among the steps.
//
//    K drifts at a rate of its own, the last entry of θ̃, the same on both axes: a ramp is followed without lag. The
//    datasheet states its size; an unexpected drift ends in a beat at the mode split, where it is the same force as a
//    rate.
//
//    A delay that the filter is not given: the sum of changes of the force over a span enters with the force late by
//    one step. Its effect on z is ℓ <- A ℓ - B Δu, corrected like z; if consistency.hpp finds it in the innovations, P
//    grows by B Δu² Bᵀ each span, and the motion is found again by the next samples.
//
//    consistency.hpp decides which samples are learned from and when Ω̂z is trusted.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/core/covariance.hpp"
#include "fracgyro/core/saved.hpp"
#include "fracgyro/estimation/composite.hpp"
#include "fracgyro/estimation/joint_model.hpp"

namespace fracgyro {

template <Scalar T, bool velocity_measured>
struct JointFilter {
    using Coefficients = JointModel<T, velocity_measured>;
    static constexpr std::size_t motions = Coefficients::motions, parameters = Coefficients::parameters,
                                 sensors = Coefficients::sensors, size = motions + parameters, rate = motions;
    using Covariance = FactoredCovariance<T, size>;
    using Four = typename Coefficients::Four;
    using Row = typename Coefficients::Row;

    using Agreement = Consistency<T, parameters>;

    // Values of composite.hpp.
    static constexpr double largest_inflation = 10.0, largest_share = 0.01;
    static constexpr double rate_haste = 1000.0;     // factor on the drift variance of Ωz, while D and K are learned
    static constexpr std::size_t longest_delay = 8;  // maximum delay, steps
    // Tasks on P: prediction of its cross part in two halves and of its part of z, and correction by each number.
    static constexpr std::int32_t tasks = 3 + static_cast<std::int32_t>(sensors);

    struct State {
        Sample<T> error{};  // z, predicted for the coming sample; corrected while a step is computed
        Row plant{};        // θ̃
        typename Covariance::State covariance{};
        std::array<Vec2<T>, longest_delay> waiting{};  // forces not yet acting, in a ring
        Vec2<T> force{}, acting{}, change{};           // the last requested one; the one of a span ago, and its change
        Four sum{};                                    // sum of residuals
        std::array<Four, motions> map{};               // A at the present estimates
        std::array<Row, 2> pulls{};                    // φ, for each axis
        std::array<typename Covariance::Gain, sensors> gain{};
        std::array<T, sensors> precision{}, sensitivity{};  // precision of the innovations; sensitivity to Ωz
        Four turned{};                                      // contribution of Ωz to the motion
        Four lag{};                                         // effect of one more step of delay on the motion
        std::array<T, sensors> delayed{};                   // and on the innovations
        typename Agreement::State agreement{};
        std::uint32_t steps = 0, spans = 0;
        std::int32_t slot = 0;  // step of the span
        bool started = false, learned = false;
    };

    static bool sound(const State& state, const Coefficients& c) {
        return fracgyro::sound(state.started) && fracgyro::sound(state.learned) && state.slot >= 0 &&
               state.slot < c.slots;
    }

    static PlantModel<T> plant(const State& state, const Coefficients& c) {
        const Row& x = state.plant;
        return {.damping = c.nominal.damping + Sym2<T>{x[1], x[2], x[3]},
                .stiffness = c.nominal.stiffness + Sym2<T>{x[4], x[5], x[6]},
                .rate = c.nominal.rate + x[0]};
    }
    static T rate_deviation(const State& state, const Coefficients& c) {
        const T stated = variance(state, c, 0);
        return square_root(Agreement::variance(state.agreement, c.consistency, stated));
    }
    // 1 if Ω̂z is trusted: the motion separates it from the other parameters, and the measurements agree with the
    // model. Its variance with all other parameters known is its d, as it is the first of them. The limit on the
    // prior's share also bounds its deviation: a tenth of the prior's is 0.5 % of the natural frequency. Never with
    // NaN: every comparison fails.
    static T trusted(const State& state, const Coefficients& c) {
        const T p = Covariance::variance(state.covariance, rate);
        const T no = T(0.0);
        T good = if_less(p, T(largest_inflation) * state.covariance.d_factor[rate], T(1.0), no);
        good = if_less(p, T(largest_share) * c.prior.plant[0], good, no);
        good = good * Agreement::sound(state.agreement, c.consistency);
        return state.learned ? good : no;
    }
    static T refused(const State& state) { return Agreement::refused(state.agreement); }

    // Drops the motion, and the estimates of the plant unless they are kept.
    static void start_over(State& state, bool keep_estimates) {
        state.started = false;
        if (!keep_estimates) {
            state.learned = false;
            state.plant = {};
            state.agreement = {};
        }
    }

    // Corrects by the measurement. The first one starts the filter, at rest if no velocity is measured.
    static void correct(State& state, const Coefficients& c, const Motion<T>& measured, const ReferencePoint<T>& r) {
        const Sample<T> seen = tracking_error(measured, r);
        if (!state.started) {
            start(state, c);
            state.error = {.value = seen.value, .derivative = velocity_measured ? seen.derivative : -r.velocity};
            return;
        }
        std::array<T, sensors> residual{}, innovation{}, kick{};
        Four moved{};  // correction by the preceding numbers
        for (std::size_t i = 0; i < sensors; ++i) {
            kick[i] = (i < 2 ? c.half_square : c.span) * (i % 2 == 0 ? state.change.x() : state.change.y());
            residual[i] = number(seen, i) - number(state.error, i);
            innovation[i] = i == 0 ? residual[i] : residual[i] - of_mean(c, i, moved);
            for (std::size_t k = 0; k < motions && i + 1 < sensors; ++k) {
                moved[k] = moved[k] + state.gain[i].move[k] * innovation[i];
            }
        }
        const T learns = Agreement::judge(state.agreement, c.consistency, innovation, state.precision,
                                          state.sensitivity, state.delayed, kick);
        agree(state, c);
        lose(state, c, Agreement::lost(state.agreement));
        for (std::size_t i = 0; i < sensors; ++i) {
            state.sum[i] = state.sum[i] + if_less(T(0.0), learns, residual[i], T(0.0));
        }
        if (state.slot + 1 < c.slots) {
            return;
        }
        moved = {};
        for (std::size_t i = 0; i < sensors; ++i) {
            const T new_part = c.share * state.sum[i] - of_mean(c, i, moved);
            const auto& gain = state.gain[i].move;
            for (std::size_t k = 0; k < motions; ++k) {
                moved[k] = moved[k] + gain[k] * new_part;
            }
            for (std::size_t k = 0; k < parameters; ++k) {
                state.plant[k] = state.plant[k] + gain[motions + k] * new_part;
            }
        }
        state.error.value = state.error.value + Vec2<T>{moved[0], moved[1]};
        state.error.derivative = state.error.derivative + Vec2<T>{moved[2], moved[3]};
    }

    // Predicts the next sample under the force requested at this one, with or without a measurement.
    static void predict(State& state, const Coefficients& c, const ReferencePoint<T>& r, const Vec2<T>& asked,
                        bool seen) {
        Vec2<T> force = asked;
        if (c.delay > 0) {
            Vec2<T>& place = state.waiting[state.steps % static_cast<std::uint32_t>(c.delay)];
            force = place;
            place = asked;
        }
        ++state.steps;
        state.force = asked;
        if (state.learned && !state.started) {  // the motion was lost, and with it the agreement
            Agreement::doubt(state.agreement, T(1.0));
        }
        if (++state.slot >= c.slots) {
            state.slot = 0;
            ++state.spans;
            state.sum = {};
        }

        const Row& x = state.plant;
        const Sym2<T> damping_error{x[1], x[2], x[3]}, stiffness_error{x[4], x[5], x[6]};
        const Sym2<T> damping = c.nominal.damping + damping_error, stiffness = c.nominal.stiffness + stiffness_error;
        const Sym2<T> detuning = c.detuning + stiffness_error;
        const T twice_rate = T(2.0) * (c.nominal.rate + x[0]);
        const auto pull = [&](const Sample<T>& e, const Sample<T>& along) {
            const Vec2<T> v = e.derivative + along.derivative;
            return damping * v + twice_rate * turned(v) + (stiffness * e.value + detuning * along.value);
        };
        Sample<T> e = state.error, along{.value = r.position, .derivative = r.velocity};
        const Vec2<T> acceleration = force - pull(e, along);

        if (due(state, c, 0)) {
            // Contribution of the parameters to the force, with the mean motion over the span.
            const T half = T(0.5) * c.span, zero = T(0.0), two = T(2.0);
            const Vec2<T> v = along.derivative + e.derivative + half * (acceleration - c.square * along.value);
            const Vec2<T> q = along.value + e.value + half * (along.derivative + e.derivative);
            state.pulls[0] = {two * v.y(), -v.x(), -v.y(), zero, -q.x(), -q.y(), zero, zero};
            state.pulls[1] = {-(two * v.x()), zero, -v.x(), -v.y(), zero, -q.x(), -q.y(), zero};
            if (state.spans % 4 == 1) {
                state.map = corrected_map(c, damping_error, stiffness_error, two * x[0]);
            }
            spread(state, c, 0, parameters - 3);
        }
        if (due(state, c, 1)) {
            spread(state, c, parameters - 3, parameters);
            for (std::size_t i = 0; i < c.ramp.size(); ++i) {  // K advances by its drift
                T& u = state.covariance.u_factor[Covariance::column(size - 1) + motions + 4 + i];
                u = u + c.ramp[i];
            }
        }
        if (due(state, c, 2)) {
            orthogonalize(state, c, force);
        }
        for (std::size_t i = 0; i < sensors; ++i) {
            if (due(state, c, 3 + static_cast<std::int32_t>(i))) {
                foresee(state, c, i, seen);
            }
        }

        // The Taylor series: e and along are the terms of order n.
        Sample<T> sum = e;
        Vec2<T> derivative = acceleration;
        for (std::int32_t n = 0; n < c.terms; ++n) {
            const T factor = c.over[static_cast<std::size_t>(n)];
            e = {.value = factor * e.derivative, .derivative = factor * derivative};
            along = {.value = factor * along.derivative, .derivative = -(factor * (c.square * along.value))};
            sum = {.value = sum.value + e.value, .derivative = sum.derivative + e.derivative};
            derivative = -pull(e, along);
        }
        state.error = sum;
        const T drift = c.share * state.plant[parameters - 1];
        for (std::size_t i = 0; i < c.ramp.size(); ++i) {
            state.plant[4 + i] = state.plant[4 + i] + drift * c.ramp[i];
        }
    }

    // The force requested last acts as this one, to which a converter rounded it. Call it after `predict`.
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        const Vec2<T> more = force - state.force;
        state.force = force;
        if (c.delay > 0) {
            state.waiting[(state.steps - 1) % static_cast<std::uint32_t>(c.delay)] = force;
            return;
        }
        state.error.value = state.error.value + (c.over[0] * c.over[1]) * more;
        state.error.derivative = state.error.derivative + c.over[0] * more;
    }

private:
    // Variance of an estimate according to the model.
    static T variance(const State& state, const Coefficients& c, std::size_t k) {
        return c.noise.variance * Covariance::variance(state.covariance, motions + k);
    }

    static void start(State& state, const Coefficients& c) {
        state.covariance = {};
        for (std::size_t i = 0; i < motions; ++i) {
            state.covariance.d_factor[i] = c.prior.motion[i];
        }
        for (std::size_t k = 0; k < parameters; ++k) {
            state.covariance.d_factor[motions + k] = c.prior.plant[k];
        }
        state.plant = state.agreement.before.value;
        state.gain = {};
        state.lag = {};
        state.delayed = {};
        state.precision = {};  // any value may follow
        state.slot = c.slots - 1;
        state.sum = {};
        state.started = state.learned = true;
    }

    // True if a task belongs to this step: they are divided among the steps of a span, in their order.
    static bool due(const State& state, const Coefficients& c, std::int32_t task) {
        return state.slot == (c.slots < tasks ? task * c.slots / tasks : task);
    }

    // Number i of the mean over the span, for a motion at its end.
    static T of_mean(const Coefficients& c, std::size_t i, const Four& x) {
        return c.slots == 1 ? x[i]
                            : c.mean[i][0] * x[0] + c.mean[i][1] * x[1] + c.mean[i][2] * x[2] + c.mean[i][3] * x[3];
    }
    static T number(const Sample<T>& a, std::size_t i) {
        const Vec2<T>& pair = i < 2 ? a.value : a.derivative;
        return i % 2 == 0 ? pair.x() : pair.y();
    }

    // Handles disagreement and doubt after a sample was judged.
    static void agree(State& state, const Coefficients& c) {
        typename Agreement::State& a = state.agreement;
        const T half = T(0.5);
        T disagrees = Agreement::disagrees(a, c.consistency);
        if (!always_less(Agreement::watched(a), half)) {
            for (std::size_t i = 0; i < c.ramp.size(); ++i) {  // K has advanced by its drift
                T& before = a.before.value[4 + i];
                before = before + c.share * a.before.value[parameters - 1] * c.ramp[i];
            }
            const std::size_t k = 1 + state.steps % 6, slope = parameters - 1;
            T uncertain = variance(state, c, k);
            if (k >= 4) {
                const T spans = c.share * a.doubted, gone = spans * c.ramp[k - 4];
                uncertain =
                    uncertain + gone * gone * (a.before.variance[slope] + spans * c.noise.variance * c.drift[slope]);
            }
            disagrees = maximum(disagrees,
                                Agreement::compare(a, c.consistency, Agreement::near(a, k, state.plant[k], uncertain)));
        }
        if (!always_less(disagrees, half)) {
            forget(state, c, disagrees);
        }
        Agreement::remember(a, c.consistency,
                            [&](std::size_t k) { return std::array{state.plant[k], variance(state, c, k)}; });
    }
    // Returns to the estimates before a disagreement, with the initial uncertainty of the plant and an unknown motion,
    // in the runs for which it is 1.
    static void forget(State& state, const Coefficients& c, T disagrees) {
        const auto instead = [&](T& a, T b) { a = if_less(T(0.0), disagrees, b, a); };
        for (T& u : state.covariance.u_factor) {
            instead(u, T(0.0));
        }
        for (std::size_t k = 0; k < parameters; ++k) {
            instead(state.covariance.d_factor[motions + k], c.prior.plant[k]);
            instead(state.plant[k], state.agreement.before.value[k]);
        }
        lose(state, c, disagrees);
        Agreement::doubt(state.agreement, disagrees);
    }
    // Makes the motion unknown, in the runs for which `which` is 1.
    static void lose(State& state, const Coefficients& c, T which) {
        const T zero = T(0.0), keep = T(1.0) - which;
        const auto instead = [&](T& a, T b) { a = if_less(zero, which, b, a); };
        for (std::size_t j = 1; j < size; ++j) {
            for (std::size_t i = 0; i < j && i < motions; ++i) {
                instead(state.covariance.u_factor[Covariance::column(j) + i], zero);
            }
        }
        for (std::size_t i = 0; i < motions; ++i) {
            instead(state.covariance.d_factor[i], c.prior.unknown[i]);
            instead(state.lag[i], zero);
        }
        for (std::size_t i = 0; i < sensors; ++i) {
            for (T& k : state.gain[i].move) {
                instead(k, zero);
            }
            state.precision[i] = keep * state.precision[i];
            state.delayed[i] = keep * state.delayed[i];
            state.sum[i] = keep * state.sum[i];
        }
    }

    using Map = std::array<Four, motions>;

    static Four through(const Map& a, const Four& x) {
        Four y;
        for (std::size_t i = 0; i < motions; ++i) {
            y[i] = (a[i][0] * x[0] + a[i][1] * x[1]) + (a[i][2] * x[2] + a[i][3] * x[3]);
        }
        return y;
    }

    // Columns of the cross part of U over one span: by A, and by the contribution of the parameters to the force.
    static void spread(State& state, const Coefficients& c, std::size_t begin, std::size_t end) {
        auto& u = state.covariance.u_factor;
        for (std::size_t j = begin; j < end; ++j) {
            T* const column = &u[Covariance::column(motions + j)];
            T x = state.pulls[0][j], y = state.pulls[1][j];  // column of φ U_θ
            for (std::size_t k = 0; k < j; ++k) {
                x = x + state.pulls[0][k] * column[motions + k];
                y = y + state.pulls[1][k] * column[motions + k];
            }
            const Four moved = through(state.map, {column[0], column[1], column[2], column[3]});
            column[0] = moved[0] + c.half_square * x;
            column[1] = moved[1] + c.half_square * y;
            column[2] = moved[2] + c.span * x;
            column[3] = moved[3] + c.span * y;
        }
    }

    // Computes the gain of one number of the span, which from now on counts as measured; 0 if none follows.
    static void foresee(State& state, const Coefficients& c, std::size_t i, bool seen) {
        auto& gain = state.gain[i];
        if (!seen) {
            gain.move = {};
            return;
        }
        if (i == 0) {
            const T* const column = &state.covariance.u_factor[Covariance::column(rate)];
            state.turned = {column[0], column[1], column[2], column[3]};
        }
        state.sensitivity[i] = of_mean(c, i, state.turned);
        state.delayed[i] = of_mean(c, i, state.lag);
        gain = c.slots == 1 ? Covariance::measure(state.covariance, i, c.noise.measured[i])
                            : Covariance::measure(state.covariance, c.mean[i], c.noise.measured[i]);
        for (std::size_t k = 0; k < motions; ++k) {
            state.turned[k] = state.turned[k] - gain.move[k] * state.sensitivity[i];
            state.lag[k] = state.lag[k] - gain.move[k] * state.delayed[i];
        }
        state.precision[i] = T(1.0) / (c.noise.variance * (gain.variance + c.noise.more[i]));
    }

    // The part of z: U and d of [A U_z, B] with the weights of its columns, row by row from the last.
    static void orthogonalize(State& state, const Coefficients& c, const Vec2<T>& force) {
        auto& u = state.covariance.u_factor;
        auto& d = state.covariance.d_factor;
        const T zero = T(0.0);
        std::array<Four, motions + 2> w{};
        std::array<T, motions + 2> weight{};
        for (std::size_t j = 0; j < motions; ++j) {
            Four column{};
            for (std::size_t i = 0; i < j; ++i) {
                column[i] = u[Covariance::column(j) + i];
            }
            column[j] = T(1.0);
            w[j] = through(state.map, column);
            weight[j] = d[j];
        }
        w[4] = {c.half_square, zero, c.span, zero};
        w[5] = {zero, c.half_square, zero, c.span};
        const Vec2<T> change = c.share * (force - state.acting);
        state.change = change;
        state.acting = force;
        const T doubt = c.of_force * Agreement::late(state.agreement);
        weight[4] = c.noise.force + doubt * (change.x() * change.x());
        weight[5] = c.noise.force + doubt * (change.y() * change.y());
        state.lag = through(state.map, state.lag);
        state.lag = {state.lag[0] - c.half_square * change.x(), state.lag[1] - c.half_square * change.y(),
                     state.lag[2] - c.span * change.x(), state.lag[3] - c.span * change.y()};
        for (std::size_t i = motions; i-- > 0;) {
            std::array<T, motions + 2> weighted;
            T sum = zero;
            for (std::size_t j = 0; j < w.size(); ++j) {
                weighted[j] = weight[j] * w[j][i];
                sum = sum + weighted[j] * w[j][i];
            }
            d[i] = sum;
            const T inverse = T(1.0) / maximum(sum, T(Covariance::vanishing));
            for (std::size_t k = 0; k < i; ++k) {
                T shared = zero;
                for (std::size_t j = 0; j < w.size(); ++j) {
                    shared = shared + weighted[j] * w[j][k];
                }
                const T factor = shared * inverse;
                u[Covariance::column(i) + k] = factor;
                for (std::size_t j = 0; j < w.size(); ++j) {
                    w[j][k] = w[j][k] - factor * w[j][i];
                }
            }
        }

        // In turn, with the noise of the spans in between.
        const std::uint32_t turn = state.spans % 8;
        if (turn % 2 == 0) {
            const T haste = if_less(state.agreement.learning, c.consistency.relearning, T(rate_haste), T(1.0));
            drift(state, c, 0, T(2.0) * haste);
        } else if (turn == 3 && c.walking > 0) {
            drift(state, c, c.walks[state.spans / 8 % c.walking], T(8.0 * c.walking));
        }
    }

    static void drift(State& state, const Coefficients& c, std::size_t j, T spans) {
        const T prior = c.prior.plant[j], known = Covariance::variance(state.covariance, motions + j) / prior;
        const T grows = minimum(spans * c.drift[j], prior) * maximum(T(0.0), T(1.0) - known);
        Covariance::add(state.covariance, motions + j, grows);
    }

    // A at the present estimates: to first order the difference from the nominal plant is a force by the mean motion
    // over the span, which is ½ (1 + A) z.
    static Map corrected_map(const Coefficients& c, const Sym2<T>& damping, const Sym2<T>& stiffness, T twice_rate) {
        const Four on_x{stiffness.xx(), stiffness.xy(), damping.xx(), damping.xy() - twice_rate};
        const Four on_y{stiffness.xy(), stiffness.yy(), damping.xy() + twice_rate, damping.yy()};
        Map a = c.map;
        for (std::size_t j = 0; j < motions; ++j) {
            T x = on_x[j], y = on_y[j];
            for (std::size_t k = 0; k < motions; ++k) {
                x = x + on_x[k] * c.map[k][j];
                y = y + on_y[k] * c.map[k][j];
            }
            x = T(0.5) * x;
            y = T(0.5) * y;
            a[0][j] = a[0][j] - c.half_square * x;
            a[1][j] = a[1][j] - c.half_square * y;
            a[2][j] = a[2][j] - c.span * x;
            a[3][j] = a[3][j] - c.span * y;
        }
        return a;
    }
};

// The joint filter as an adaptation of the sliding-mode controller. The bounds b̂ stay at their initial values.
template <Scalar T, bool velocity_measured>
struct JointAdaptationOf {
    using Filter = JointFilter<T, velocity_measured>;
    using Report = CompositeReport<T>;
    static constexpr bool measures_velocity = velocity_measured, estimates_motion = true;

    struct Coefficients {
        typename Filter::Coefficients filter{};
        std::array<T, 3> bound{};
    };
    using State = typename Filter::State;

    static Coefficients prepare(const AdaptationParams& p, const Datasheet& said, const Common& common) {
        const std::array<double, 3>& b = p.initial_bound;
        return {.filter = Filter::Coefficients::prepare(p, said, common), .bound = {T(b[0]), T(b[1]), T(b[2])}};
    }
    static bool sound(const State& state, const Coefficients& c) { return Filter::sound(state, c.filter); }

    static Report report(const State& state, const Coefficients& c) {
        const PlantModel<T> found = Filter::plant(state, c.filter);
        return {{{.damping = found.damping, .stiffness = found.stiffness, .rate = found.rate, .bound = c.bound}},
                Filter::rate_deviation(state, c.filter),
                Filter::trusted(state, c.filter),
                Filter::refused(state)};
    }
};
template <Scalar T>
using JointAdaptation = JointAdaptationOf<T, true>;
template <Scalar T>
using JointFromPositions = JointAdaptationOf<T, false>;

}  // namespace fracgyro
