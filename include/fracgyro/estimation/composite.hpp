// 5  Composite adaptation: the laws (44), driven by s, plus least squares on the plant's equation, driven by the
//    prediction error over one step. No acceleration is measured.
//
//    Eq. (9) over one step of length h, with u and d held, ∫v dt = Δq exactly and ∫q dt by Hermite's rule, whose error
//    is h⁵/720 q'''':
//
//        Δv = h (u + d) - (D + 2Ω) Δq - K ∫q dt,      ∫q dt = h/2 (q₀ + q₁) + h²/12 (v₀ - v₁)
//
//    Dividing by h, with v̄ = Δq/h, q̄ = ∫q dt/h, and estimates instead of true values, leaves
//
//        r = Δv/h - u + (D̂ + 2Ω̂) v̄ + K̂ q̄ = d + row(v̄, q̄)·θ̃,      θ = (Ωz, Dxx, Dxy, Dyy, Kxx, Kxy, Kyy)
//
//    one residual per axis. But v̄ contains h/2 d: rows made of v̄ would be correlated with the noise, which would bias
//    D̂ by h σ²/(2 v²). They are made of v̄ - h/2 E(d) instead, in effect the mean velocity predicted at the start of
//    the step. The part E(d) = r/α of r is noise; the rest, large at first, is the estimates' own error: α = 1 + row P
//    rowᵀ, for which the value of the last step is used.
//
//    The influence of one sample is bounded: once the estimates are trusted, residuals are judged by consistency.hpp,
//    with the deviation σ̂ √α and, for the rate, the row's first entry. In a disagreement the estimates and σ̂ return
//    to their values before it, and P to the prior. Growing residuals are not mistaken for noise: σ̂ is at most its
//    value before they grew, which is kept even when the guard starts the controller over.
//
//    The force uses the laws' part, which is the loop's integral action, and after Ω̂z is first trusted the sum of both
//    parts. The reported D, K and Ωz are the least-squares part only (docs/decisions/0016).
#pragma once

#include "fracgyro/control/reports.hpp"
#include "fracgyro/core/rls.hpp"
#include "fracgyro/core/saved.hpp"
#include "fracgyro/estimation/consistency.hpp"
#include "fracgyro/estimation/gradient.hpp"

namespace fracgyro {

template <Scalar T>
struct CompositeAdaptation {
    using Laws = GradientAdaptation<T>;
    using Squares = RecursiveLeastSquares<T, 7>;
    using Row = typename Squares::Row;
    using Agreement = Consistency<T, 8>;  // agreement of θ, and of the mean square of d

    static constexpr std::size_t parameters = 7;

    // Ωz is trusted while the other parameters inflate its variance by at most this factor, the prior contributes at
    // most this share of the information on it, and its standard deviation is below this fraction of the natural
    // frequency.
    static constexpr double largest_inflation = 10.0, largest_share = 0.01, largest_deviation = 0.01;
    static constexpr double least_noise = 1e-30;  // divisor instead of 0
    static constexpr double unknown_noise = 1.0;  // variance assumed for unknown noise; 0: it is known

    struct Coefficients {
        typename Laws::Coefficients laws{};
        T step{}, inverse_step{};
        T forgetting{}, rate_forgetting{};  // times the step
        bool forgets = false;
        T trusted_variance{};  // maximum variance of a trusted Ω̂z
        typename Agreement::Coefficients consistency{};
    };
    struct State {
        typename Laws::State laws{};
        typename Squares::State squares{};
        T rate_information = T(1.0 / Squares::prior);  // 1/P_00 with all other parameters known
        T noise{}, draws{};                            // mean square of d on one axis, and its number of samples
        Motion<T> motion{};                            // at the last sample, and the force since
        Vec2<T> force{};
        Vec2<T> left{};  // 1/α on each axis in the last step
        T adopted{};     // 1 once Ω̂z has been trusted
        typename Agreement::State agreement{};
        Kept<T, bool> measured = false;  // a last sample exists
    };

    using Report = CompositeReport<T>;

    static Coefficients prepare(const AdaptationParams& p, const PlantModel<double>& nominal, double step,
                                double largest_bound = std::numeric_limits<double>::infinity()) {
        const auto& k = nominal.stiffness;
        return {.laws = Laws::prepare(p, nominal, step, largest_bound),
                .step = T(step),
                .inverse_step = T(1.0 / step),
                .forgetting = T(step * p.forgetting),
                .rate_forgetting = T(step * p.rate_forgetting),
                .forgets = p.forgetting > 0.0,
                .trusted_variance = T(largest_deviation * largest_deviation * 0.5 * (k.xx() + k.yy())),
                .consistency =
                    Agreement::prepare(6.28318530717958647692 / natural_frequency(k), step, 2, 2.0, 0.0, 8192.0)};
    }

    static bool sound(const State& state, const Coefficients& /*c*/) { return fracgyro::sound(state.measured); }

    // Only b̂ comes from the laws.
    static Estimates<T> estimates(const State& state, const Coefficients& c) {
        Estimates<T> found = c.laws.initial + as_estimates(state.squares.value);
        for (std::size_t i = 0; i < found.bound.size(); ++i) {
            found.bound[i] = found.bound[i] + state.laws.deviation.bound[i];
        }
        return found;
    }
    static Report report(const State& state, const Coefficients& c) {
        return {{estimates(state, c)},
                square_root(Agreement::variance(state.agreement, c.consistency, variance(state, 0))),
                trusted(state, c),
                Agreement::refused(state.agreement)};
    }
    // Estimates used by the force.
    static Estimates<T> control_estimates(const State& state, const Coefficients& c, const Report& /*reported*/) {
        return Laws::estimates(state.laws, c.laws) + state.adopted * as_estimates(state.squares.value);
    }
    // 1 if Ω̂z is trusted. Never with NaN: every comparison fails.
    static T trusted(const State& state, const Coefficients& c) {
        const T p = Squares::variance(state.squares, 0);
        const T no = T(0.0);
        T good = if_less(p * state.rate_information, T(largest_inflation), T(1.0), no);
        good = if_less(p, T(largest_share * Squares::prior), good, no);
        good = if_less(state.noise * p, c.trusted_variance, good, no);
        good = good * Agreement::sound(state.agreement, c.consistency);
        return state.measured ? good : no;
    }

    static void update(State& state, const Coefficients& c, const Motion<T>& motion, const Vec2<T>& surface,
                       const Norms<T>& norms, const Vec2<T>& force) {
        if (state.measured) {
            forget(state, c);
            compare(state, c, motion);
            if (!always_less(T(0.5), state.adopted)) {
                state.adopted = maximum(state.adopted, trusted(state, c));
            }
        }
        state.motion = motion;
        state.force = force;
        state.measured = true;
        Laws::update(state.laws, c.laws, motion, surface, norms, force);
    }
    // Without a measurement no step begins or ends.
    static void rest(State& state) { state.measured = false; }
    // Drops the estimates but keeps the noise variance: a lasting fault would otherwise be mistaken for noise.
    static void start_over(State& state) {
        static constexpr State nothing_learned{};
        const typename Agreement::Known before = state.agreement.before;
        const T doubted = known(state);
        state = nothing_learned;
        state.agreement.before = before;
        Agreement::doubt(state.agreement, doubted);
    }

private:
    static Estimates<T> as_estimates(const Row& x) {
        return {.damping = {x[1], x[2], x[3]}, .stiffness = {x[4], x[5], x[6]}, .rate = x[0]};
    }

    // Compares the step from the last sample to this one with its prediction.
    static void compare(State& state, const Coefficients& c, const Motion<T>& now) {
        const Motion<T>& last = state.motion;
        const Vec2<T> v = c.inverse_step * (now.position - last.position);
        const Vec2<T> q =
            T(0.5) * (last.position + now.position) + (T(1.0 / 12.0) * c.step) * (last.velocity - now.velocity);
        const Vec2<T> a = c.inverse_step * (now.velocity - last.velocity);
        const Estimates<T> e = c.laws.initial + as_estimates(state.squares.value);
        const Vec2<T> coriolis = T(2.0) * (e.rate * turned(v));
        const Vec2<T> r = (a - state.force) + (e.damping * v + coriolis) + e.stiffness * q;

        const T zero = T(0.0), one = T(1.0);
        // While relearning, the last step carries no information on this one: with the prior, α is at most this.
        const T least = one / (one + T(Squares::prior) * (T(5.0) * squared_norm(v) + squared_norm(q)));
        const auto share = [&](T last) {
            const T now =
                if_less(state.agreement.learning, c.consistency.window, if_less(zero, last, least, zero), last);
            return if_less(zero, state.agreement.doubted, now, last);
        };
        const T inverse = maximum(state.adopted, known(state)) / maximum(expected_noise(state), T(least_noise));
        const Vec2<T> precision{inverse * share(state.left.x()), inverse * share(state.left.y())};
        const T learns =
            Agreement::template judge<2>(state.agreement, c.consistency, {r.x(), r.y()}, {precision.x(), precision.y()},
                                         {T(-2.0) * v.y(), T(2.0) * v.x()});
        agree(state, c);
        if (always_less(learns, one)) {
            return;  // below, one run of several may still rest: all-zero rows carry no information
        }

        // Before the estimates are adopted, r may be an estimation error, a thousand times the noise, which would spoil
        // the rows.
        const auto learned = [&](T x) { return if_less(zero, learns, x, zero); };
        const auto both = [&](const Vec2<T>& x) { return Vec2<T>{learned(x.x()), learned(x.y())}; };
        const Vec2<T> w = both(v - (T(0.5) * c.step * state.adopted) * (state.left * r));
        const Vec2<T> p = both(q);
        const Row x{T(-2.0) * w.y(), w.x(), w.y(), zero, p.x(), p.y(), zero};
        const Row y{T(2.0) * w.x(), zero, w.x(), w.y(), zero, p.x(), p.y()};
        const Row before = state.squares.value;
        const T left_x = learn(state, x, learned(r.x()), learns);
        T second = learned(r.y());  // with the estimates after the first row
        for (std::size_t j = 0; j < y.size(); ++j) {
            second = second + y[j] * (state.squares.value[j] - before[j]);
        }
        const T left_y = learn(state, y, second, learns);
        state.left = {if_less(zero, learns, left_x, state.left.x()), if_less(zero, learns, left_y, state.left.y())};
        state.rate_information = state.rate_information + T(4.0) * squared_norm(w);
    }
    // Handles disagreement and doubt after a sample was judged.
    static void agree(State& state, const Coefficients& c) {
        const T half = T(0.5);
        typename Agreement::State& a = state.agreement;
        T disagrees = Agreement::disagrees(a, c.consistency);
        if (!always_less(maximum(disagrees, Agreement::watched(a)), half)) {
            for (auto* each : {&a.before, &a.recent}) {  // persistent noise is accepted like a changed plant
                T& known = each->variance[parameters];
                known = if_less(a.doubted + T(1.0), T(Agreement::acceptance), known, T(unknown_noise));
            }
            T near = T(1.0);
            for (std::size_t k = 1; k < parameters; ++k) {
                near = near * Agreement::near(a, k, state.squares.value[k], variance(state, k));
            }
            disagrees = maximum(disagrees, Agreement::compare(a, c.consistency, near));
            learn_again(state, disagrees);
        }
        Agreement::remember(a, c.consistency, [&](std::size_t k) {
            return k < parameters ? std::array{state.squares.value[k], variance(state, k)}
                                  : std::array{state.noise, T(0.0)};
        });
    }
    // Mean square of d for judging residuals: the value before they disagreed, lest a fault pass for noise.
    static T expected_noise(const State& state) {
        const T before = state.agreement.before.value[parameters];
        return if_less(T(0.0), known(state), minimum(state.noise, before), state.noise);
    }
    // 1 if estimates from before a disagreement exist.
    static T known(const State& state) {
        return if_less(state.agreement.before.variance[parameters], T(unknown_noise), T(1.0), T(0.0));
    }
    // Restarts from the estimates before a disagreement and the prior, in the runs for which it is 1.
    static void learn_again(State& state, T disagrees) {
        const T zero = T(0.0);
        const auto instead = [&](T& a, T b) { a = if_less(zero, disagrees, b, a); };
        for (T& u : state.squares.u_factor) {
            instead(u, zero);
        }
        for (std::size_t k = 0; k < state.squares.value.size(); ++k) {
            instead(state.squares.d_factor[k], T(Squares::prior));
            instead(state.squares.value[k], state.agreement.before.value[k]);
        }
        instead(state.rate_information, T(1.0 / Squares::prior));
        instead(state.noise, expected_noise(state));
        state.left = (T(1.0) - disagrees) * state.left;  // any value may follow
        Agreement::doubt(state.agreement, disagrees);
    }
    // Variance of an estimate according to the model.
    static T variance(const State& state, std::size_t k) { return state.noise * Squares::variance(state.squares, k); }
    static double natural_frequency(const Sym2<double>& k) {
        return maximum(square_root(0.5 * absolute(k.xx() + k.yy())), 1e-3);
    }

    static T learn(State& state, const Row& row, T residual, T learns) {
        const T left = Squares::update(state.squares, row, residual);
        // Mean with weights 1/α, which exclude the residuals caused by the estimates' own errors.
        state.draws = state.draws + learns * left;
        state.noise = state.noise + learns * ((left / state.draws) * (left * residual * residual - state.noise));
        return left;
    }

    // Bounded gain (Slotine & Li 1991, 8.7.6): forgetting is slower the less is known, and never exceeds the prior.
    static void forget(State& state, const Coefficients& c) {
        const T one = T(1.0), zero = T(0.0);
        if (c.forgets) {
            T trace = zero;
            for (std::size_t i = 0; i < state.squares.value.size(); ++i) {
                trace = trace + Squares::variance(state.squares, i);
            }
            const T ceiling = T(static_cast<double>(state.squares.value.size()) * Squares::prior);
            const T growth = c.forgetting * maximum(zero, one - trace / ceiling);
            Squares::inflate(state.squares, one + growth);
            state.rate_information = state.rate_information / (one + growth);
            state.draws = state.draws / (one + growth);
        }
        const T p = Squares::variance(state.squares, 0);
        const T moved = c.rate_forgetting * maximum(zero, one - p / T(Squares::prior)) * p;
        Squares::inflate_first(state.squares, moved);
        state.rate_information = state.rate_information / (one + moved * state.rate_information);
    }
};

}  // namespace fracgyro
