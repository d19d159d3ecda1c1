// 5  The estimates and the laws that move them, eq. (44), with optional projection, leakage and dead zone.
//
//        dD̂/dt = -½ M (v sᵀ + s vᵀ)        dK̂/dt = -½ N (q sᵀ + s qᵀ)
//        dΩ̂z/dt = P (s₁ v₂ - s₂ v₁)         corrected: dΩ̂ᵀ/dt = -P (v sᵀ - s vᵀ), which is skew as Ω̂ is
//        dΩ̂ᵀ/dt = -P (v sᵀ + s vᵀ)          printed: symmetric, so that the skew part of Ω̂ never moves
//        db̂₀/dt = x₀ ‖s‖,  db̂₁/dt = x₁ ‖s‖ ‖q‖,  db̂₂/dt = x₂ ‖s‖ ‖v‖
//
//    M, N, P are multiples of the identity: any other matrix would destroy the symmetry of D̂ and K̂.
//    What is stored is the deviation from the initial value, so that single precision does not lose small increments.
#pragma once

#include "error.hpp"

namespace fracgyro {

// Everything the controller believes about the plant. As in the law (35), Ω̂ = [[0, -rate], [rate, 0]] + rate_symmetric.
template <Scalar T>
struct Estimates {
    Sym2<T> damping{}, stiffness{};
    T rate{};
    Sym2<T> rate_symmetric{};  // stays 0 unless the law is the printed one
    std::array<T, 3> bound{};  // b̂₀, b̂₁, b̂₂

    friend constexpr Estimates operator+(const Estimates& a, const Estimates& b) {
        return {.damping = a.damping + b.damping,
                .stiffness = a.stiffness + b.stiffness,
                .rate = a.rate + b.rate,
                .rate_symmetric = a.rate_symmetric + b.rate_symmetric,
                .bound = {a.bound[0] + b.bound[0], a.bound[1] + b.bound[1], a.bound[2] + b.bound[2]}};
    }
    friend constexpr Estimates operator*(T f, const Estimates& a) {
        return {.damping = f * a.damping,
                .stiffness = f * a.stiffness,
                .rate = f * a.rate,
                .rate_symmetric = f * a.rate_symmetric,
                .bound = {f * a.bound[0], f * a.bound[1], f * a.bound[2]}};
    }
};

// How well the angular rate is known: both 0 where only the laws below move it, which do not say.
template <Scalar T>
struct RateQuality {
    T deviation{};  // standard deviation of Ω̂z
    T trusted{};    // 1 where the motion tells Ωz from the other parameters
};

// ‖q‖, ‖v‖ and ‖s‖, which the force and the laws share.
template <Scalar T>
struct Sizes {
    T position{}, velocity{}, surface{};
};
template <Scalar T>
Sizes<T> sizes_of(const Motion<T>& motion, const Vec2<T>& surface) {
    return {.position = norm(motion.position), .velocity = norm(motion.velocity), .surface = norm(surface)};
}

struct AdaptationParams {
    bool adaptive = true;  // false: the initial estimates are kept
    bool printed_rate_law = false;
    double damping_gain = 150.0, stiffness_gain = 150.0, rate_gain = 150.0;  // M, N, P
    std::array<double, 3> bound_gain{1.0, 1.6, 1.6};                         // x₀, x₁, x₂
    Estimates<double> initial{};
    double leakage = 0.0;     // 1/time: estimates return to their initial values at this rate; 0 off
    double dead_zone = 0.0;   // the laws rest while ‖s‖ is below it; 0 off
    double projection = 0.0;  // largest deviation, as a fraction of the family's largest initial entry; 0 off
    bool composite = false;   // least squares beside the laws (composite.hpp), and what it forgets:
    double forgetting = 0.0, rate_forgetting = 0.0;  // 1/time: all parameters; Ωz besides; 0 nothing
};

template <Scalar T>
struct Adaptation {
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

    // `largest_bound`: the largest ρ that the force is given, which no b̂ grows beyond; infinity: off.
    static Coefficients prepare(const AdaptationParams& p, double step,
                                double largest_bound = std::numeric_limits<double>::infinity()) {
        const double h = p.adaptive ? step : 0.0;
        const auto largest = [](const Sym2<double>& a) {
            return maximum(absolute(a.xx), maximum(absolute(a.xy), absolute(a.yy)));
        };
        const auto& i = p.initial;
        const bool projected = p.projection > 0.0, bounded = largest_bound < std::numeric_limits<double>::infinity();
        const double most = p.projection * maximum(i.bound[0], maximum(i.bound[1], i.bound[2]));
        const auto bound_limit = [&](double from) {
            const double growth = maximum(largest_bound - from, 0.0);
            return T(projected ? minimum(most, growth) : growth);
        };
        const auto sym2 = [](const Sym2<double>& a) { return Sym2<T>{T(a.xx), T(a.xy), T(a.yy)}; };
        return {.initial = {.damping = sym2(i.damping),
                            .stiffness = sym2(i.stiffness),
                            .rate = T(i.rate),
                            .rate_symmetric = sym2(i.rate_symmetric),
                            .bound = {T(i.bound[0]), T(i.bound[1]), T(i.bound[2])}},
                .damping_gain = T(h * p.damping_gain),
                .stiffness_gain = T(h * p.stiffness_gain),
                .rate_gain = T(h * p.rate_gain),
                .bound_gain = {T(h * p.bound_gain[0]), T(h * p.bound_gain[1]), T(h * p.bound_gain[2])},
                .keep = T(1.0 - h * p.leakage),
                .dead_zone = T(p.dead_zone),
                .printed = p.printed_rate_law,
                .leaking = p.leakage > 0.0,
                .resting = p.dead_zone > 0.0,
                .projected = projected,
                .bounded = projected || bounded,
                .damping_limit = T(p.projection * largest(i.damping)),
                .stiffness_limit = T(p.projection * largest(i.stiffness)),
                .rate_limit = T(p.projection * absolute(i.rate)),
                .bound_limit = {bound_limit(i.bound[0]), bound_limit(i.bound[1]), bound_limit(i.bound[2])}};
    }

    static bool sound(const State&, const Coefficients&) { return true; }  // all of it is numbers

    // What is told, and what the force is computed with: the same.
    static Estimates<T> estimates(const State& state, const Coefficients& c) { return c.initial + state.deviation; }
    static const Estimates<T>& believed(const State&, const Coefficients&, const Estimates<T>& told) { return told; }
    static RateQuality<T> quality(const State&, const Coefficients&) { return {}; }

    // One Euler step of the laws.
    static void update(State& state, const Coefficients& c, const Motion<T>& motion, const Vec2<T>& surface,
                       const Sizes<T>& sizes, const Vec2<T>& /*force*/ = {}) {
        const Vec2<T>& q = motion.position;
        const Vec2<T>& v = motion.velocity;
        Vec2<T> s = surface;
        T size = sizes.surface;
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
            d.rate = d.rate + c.rate_gain * (s.x * v.y - s.y * v.x);
        }
        d.bound = {d.bound[0] + c.bound_gain[0] * size, d.bound[1] + c.bound_gain[1] * (size * sizes.position),
                   d.bound[2] + c.bound_gain[2] * (size * sizes.velocity)};
        if (c.projected) {
            project(d, c);
        }
        if (c.bounded) {
            for (std::size_t k = 0; k < d.bound.size(); ++k) {
                d.bound[k] = minimum(d.bound[k], c.bound_limit[k]);
            }
        }
    }
    // Nothing was measured.
    static void rest(State&) {}

private:
    static void project(Estimates<T>& d, const Coefficients& c) {
        const auto within = [](T a, T limit) { return clamp(a, -limit, limit); };
        const auto all = [&](const Sym2<T>& a, T limit) {
            return Sym2<T>{within(a.xx, limit), within(a.xy, limit), within(a.yy, limit)};
        };
        d.damping = all(d.damping, c.damping_limit);
        d.stiffness = all(d.stiffness, c.stiffness_limit);
        d.rate = within(d.rate, c.rate_limit);
        d.rate_symmetric = all(d.rate_symmetric, c.rate_limit);
    }
};

}  // namespace fracgyro
