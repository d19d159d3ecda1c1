// Lock-in: demodulates positions each step; a Kalman filter computes once in n steps.
//
// Use it when a microcontroller must estimate the rate from positions: a thirtieth of the joint filter's work. The
// reference is a sine on each axis.
//
//    Each step, with the reference r and n steps in a span:
//
//        u = P r + Q ṙ        sums of e r and e ṙ, with e = y - r of one axis and r, ṙ of the other
//
//    The sums, rotated to the middle of the span, are its statistics: projections of the error of each axis on the line
//    of the other, by which Ωz couples the axes. Up to 256 steps they lose nothing of θ = (Ωz, D, K, K̇/K).
//
//    A force a Im(w e^(iφ)) at the frequency of axis b, φ its phase half a step after a sample, is the number w. The
//    force that keeps a plant on the reference is
//
//        w_ab = Σ_c G_b,ac [K_cb - δ_cb ω_b² + iω_b (D + 2Ω)_cb]
//
//    with G for the hold, near 1. On the reference a force that lacks w_ab there adds Im(X_ab w_ab) to z after the span
//    and to its statistics, X_ab = R_ab a_b e^(iφ), R_ab a constant; so the same X is the sensitivity to D, by -ω Re X,
//    and K, by -Im X. With A the map of z over a span and H its statistics:
//
//        z' = A z + Im Σ X w + noise        s = H z + Im Σ X w + noise
//
//    A is corrected to first order for the estimates. P = U diag(d) Uᵀ (core/covariance.hpp), z before θ. Forces within
//    a span move its statistics too; their correlation with the effect on z' is neglected.
//
//    The work is divided among the steps of a span, in the order of LockInFilter::work: span k is learned from during
//    span k + 1, which ends with the force of span k + 2.
//
//    Products of errors are neglected: an error of K over half a span, times the innovation and z, counts as noise of a
//    statistic. Statistics beyond eight deviations are not learned from, unless the last three spans had some. The
//    stated deviation grows with the mean of their squares and with the error of Ω̂z that explains them, as in
//    consistency.hpp; if they are too large for long, D, K and Ωz are learned again.
//
// Source: ours; docs/decisions/0057.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/controllers/lock_in_filter.hpp"

namespace fracgyro {

template <Scalar T>
struct LockIn {
    using Value = T;
    using Params = LockInParams;
    using Report = LearnedPlantReport<T>;
    using Coefficients = LockInModel<T>;
    using Filter = LockInFilter<T>;
    static constexpr bool measures_velocity = false, estimates_motion = true, drives_sines = true;

    struct State {
        typename Reference<T>::State reference{};
        SineCosine2<T> exact{};  // sines of the next step at which they are exact
        typename Coefficients::Modulation modulation{};
        typename Filter::State filter{};
        std::int32_t slot = 0;  // step of the span
        bool started = false;
    };

    static Coefficients prepare(const Params& p, const Common& common) { return Coefficients::prepare(p, common); }

    static Report report(const State& state, const Coefficients& c) {
        const auto& x = state.filter.plant;
        const auto& a = state.filter.agreement;
        return {{.damping = c.nominal.damping + Sym2<T>{x[1], x[2], x[3]},
                 .stiffness = c.nominal.stiffness + Sym2<T>{x[4], x[5], x[6]},
                 .rate = c.nominal.rate + x[0]},
                a.deviation,
                a.trusted,
                a.refused};
    }
    static bool sound(const State& state, const Coefficients& c) {
        return fracgyro::sound(state.started) && Filter::sound(state.filter) && state.slot >= 0 && state.slot < c.steps;
    }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    // The motion is unknown; D, K and Ωz have the prior's uncertainty, about the estimates if they are kept.
    static void start_over(State& state, bool keep_estimates) {
        state.started = false;
        if (!keep_estimates) {
            state.filter.plant = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        const Report known = report(state, c);
        const bool fresh = !state.started;
        if (fresh) {
            start(state, c);
        }
        // Exact sines are found ahead, in two steps without another task, and are those of Reference::update.
        const auto phase = static_cast<std::int32_t>(state.reference.steps % Reference<T>::exact_every);
        if (phase == 0) {
            state.reference.at = state.exact;
        }
        const ReferencePoint<T> r = Reference<T>::follow(state.reference, c.reference);
        const bool begins = state.slot == 0;
        if (begins) {
            begin_span(state, c, r, fresh);
        }
        const Vec2<T> e = missing == nullptr ? measured.position - r.position : missing->value;
        auto& now = state.filter.now;
        if (missing == nullptr) {
            now.sine = now.sine + swapped(e) * r.position;
            now.cosine = now.cosine + swapped(e) * r.velocity;
        } else {
            now.seen = false;
        }
        const auto& m = state.modulation;
        const Vec2<T> wanted = (r.position.x() * m.position[0] + r.position.y() * m.position[1]) +
                               (r.velocity.x() * m.velocity[0] + r.velocity.y() * m.velocity[1]);
        if (phase >= exact_ahead) {
            find_exact(state, c, phase == exact_ahead);
        } else if (phase > 0 && !begins && state.filter.task < Filter::tasks) {
            Filter::work(state.filter, c);
        }
        state.slot = state.slot + 1 < c.steps ? state.slot + 1 : 0;
        Signals<T, Report> signals{.reference = r, .error = {.value = e}, .report = known};
        Saturation<T>::apply(signals, c.force.saturation, wanted, e);
        return signals;
    }

private:
    static constexpr std::int32_t exact_ahead = static_cast<std::int32_t>(Reference<T>::exact_every) - 2;

    // The force is that of the nominal plant until the estimates are known.
    static void start(State& state, const Coefficients& c) {
        state.filter.force.acting = state.filter.force.designed = c.force.first;
        state.filter.force.coming = c.force.first_modulation;
        if (state.reference.steps == 0) {
            state.exact = c.turns.begin;
        }
        state.slot = 0;
        state.started = true;
    }
    static void begin_span(State& state, const Coefficients& c, const ReferencePoint<T>& r, bool fresh) {
        auto& force = state.filter.force;
        force.acted = force.acting;
        force.acting = force.designed;
        state.modulation = force.coming;
        Filter::begin(state.filter, c, r, fresh);
    }
    [[gnu::noinline, gnu::flatten]] static void find_exact(State& state, const Coefficients& c, bool of_x) {
        const auto& p = c.reference.phases;
        const std::size_t axis = of_x ? 0 : 1;
        const auto steps = state.reference.steps + (of_x ? 1U : 0U);
        const auto found = PhaseOf<T>::sine_cosine(p.start[axis] + steps * p.increment[axis]);
        auto& [sine, cosine] = state.exact;
        sine = of_x ? Vec2<T>{found.sine, sine.y()} : Vec2<T>{sine.x(), found.sine};
        cosine = of_x ? Vec2<T>{found.cosine, cosine.y()} : Vec2<T>{cosine.x(), found.cosine};
    }
};

}  // namespace fracgyro
