// 5  The estimates and the laws that move them, eq. (44), with optional projection, leakage and dead zone.
//
//        dD̂/dt = -½ M (v sᵀ + s vᵀ)        dK̂/dt = -½ N (q sᵀ + s qᵀ)
//        dΩ̂z/dt = P (s₁ v₂ - s₂ v₁)         corrected: dΩ̂ᵀ/dt = -P (v sᵀ - s vᵀ), which is skew as Ω̂ is
//        dΩ̂ᵀ/dt = -P (v sᵀ + s vᵀ)          printed: symmetric, so that the skew part of Ω̂ never moves
//        db̂₀/dt = x₀ ‖s‖,  db̂₁/dt = x₁ ‖s‖ ‖q‖,  db̂₂/dt = x₂ ‖s‖ ‖v‖
//
//    M, N, P are multiples of the identity: any other matrix would destroy the symmetry of D̂ and K̂.
//    The stored state is the deviation from the initial value, so that single precision does not lose small increments.
#pragma once

#include "fracgyro/control/reports.hpp"
#include "fracgyro/control/signals.hpp"
#include "fracgyro/estimation/adaptation.hpp"

namespace fracgyro {

template <Scalar T>
struct GradientAdaptation {
    struct Coefficients {
        Estimates<T> initial{};
        T damping_gain{}, stiffness_gain{}, rate_gain{};  // times the step
        std::array<T, 3> bound_gain{};
        T keep{}, dead_zone{};  // keep = 1 - step·leakage
        bool printed = false, leaking = false, resting = false, projected = false, bounded = false;
        T damping_limit{}, stiffness_limit{}, rate_limit{};
        std::array<T, 3> bound_limit{};  // b̂ only grows
    };
    struct State {
        Estimates<T> deviation{};
    };

    using Report = AdaptiveReport<T>;

    // Starts the estimates from the nominal plant. `largest_bound`: the maximum ρ of the force, beyond which no b̂
    // grows; infinity: off.
    static Coefficients prepare(const AdaptationParams& p, const PlantModel<double>& nominal, double step,
                                double largest_bound = std::numeric_limits<double>::infinity()) {
        const double h = p.adaptive ? step : 0.0;
        const auto largest = [](const Sym2<double>& a) {
            return maximum(absolute(a.xx()), maximum(absolute(a.xy()), absolute(a.yy())));
        };
        const std::array<double, 3>& from = p.initial_bound;
        const bool projected = p.projection > 0.0, bounded = largest_bound < std::numeric_limits<double>::infinity();
        const double most = p.projection * maximum(from[0], maximum(from[1], from[2]));
        const auto bound_limit = [&](double start) {
            const double growth = maximum(largest_bound - start, 0.0);
            return T(projected ? minimum(most, growth) : growth);
        };
        return {.initial = {.damping = cast<T>(nominal.damping),
                            .stiffness = cast<T>(nominal.stiffness),
                            .rate = T(nominal.rate),
                            .bound = {T(from[0]), T(from[1]), T(from[2])}},
                .damping_gain = T(h * p.damping_gain),
                .stiffness_gain = T(h * p.stiffness_gain),
                .rate_gain = T(h * p.rate_gain),
                .bound_gain = {T(h * p.bound_gain[0]), T(h * p.bound_gain[1]), T(h * p.bound_gain[2])},
                .keep = T(1.0 - h * p.leakage),
                .dead_zone = T(p.dead_zone),
                .printed = p.rate_law == RateLaw::printed,
                .leaking = p.leakage > 0.0,
                .resting = p.dead_zone > 0.0,
                .projected = projected,
                .bounded = projected || bounded,
                .damping_limit = T(p.projection * largest(nominal.damping)),
                .stiffness_limit = T(p.projection * largest(nominal.stiffness)),
                .rate_limit = T(p.projection * absolute(nominal.rate)),
                .bound_limit = {bound_limit(from[0]), bound_limit(from[1]), bound_limit(from[2])}};
    }

    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only

    static Estimates<T> estimates(const State& state, const Coefficients& c) {
        Estimates<T> found = c.initial + state.deviation;
        if (!c.printed) {
            found.rate_symmetric = {};  // always 0: nothing to add
        }
        return found;
    }
    // The reported estimates, which the force uses too.
    static Report report(const State& state, const Coefficients& c) { return {estimates(state, c)}; }
    static const Estimates<T>& control_estimates(const State&, const Coefficients&, const Report& reported) {
        return reported;
    }

    // One Euler step of the laws.
    static void update(State& state, const Coefficients& c, const Motion<T>& motion, const Vec2<T>& surface,
                       const Norms<T>& norms, const Vec2<T>& /*force*/ = {}) {
        const Vec2<T>& q = motion.position;
        const Vec2<T>& v = motion.velocity;
        Vec2<T> s = surface;
        T size = norms.surface;
        if (c.resting) {
            const T active = if_less(size, c.dead_zone, T(0.0), T(1.0));
            s = active * s;
            size = active * size;
        }
        const Sym2<T> vs = symmetric_product(v, s);
        const Sym2<T> qs = symmetric_product(q, s);
        Estimates<T>& d = state.deviation;
        if (c.leaking) {
            d = c.keep * d;
        }
        d.damping = d.damping - c.damping_gain * vs;
        d.stiffness = d.stiffness - c.stiffness_gain * qs;
        if (c.printed) {
            d.rate_symmetric = d.rate_symmetric - (T(2.0) * c.rate_gain) * vs;
        } else {
            d.rate = d.rate + c.rate_gain * cross(s, v);
        }
        d.bound = {d.bound[0] + c.bound_gain[0] * size, d.bound[1] + c.bound_gain[1] * (size * norms.position),
                   d.bound[2] + c.bound_gain[2] * (size * norms.velocity)};
        if (c.projected) {
            project(d, c);
        }
        if (c.bounded) {
            for (std::size_t k = 0; k < d.bound.size(); ++k) {
                d.bound[k] = minimum(d.bound[k], c.bound_limit[k]);
            }
        }
    }
    // Nothing changes without a measurement.
    static void rest(State&) {}

private:
    static void project(Estimates<T>& d, const Coefficients& c) {
        const auto within = [](T a, T limit) { return clamp(a, -limit, limit); };
        const auto all = [&](const Sym2<T>& a, T limit) {
            return Sym2<T>{clamp(a.diagonal, -limit, limit), within(a.xy(), limit)};
        };
        d.damping = all(d.damping, c.damping_limit);
        d.stiffness = all(d.stiffness, c.stiffness_limit);
        d.rate = within(d.rate, c.rate_limit);
        d.rate_symmetric = all(d.rate_symmetric, c.rate_limit);
    }
};

}  // namespace fracgyro
