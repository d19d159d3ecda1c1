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

#include "fields.hpp"
#include "signals.hpp"

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

// ‖q‖, ‖v‖ and ‖s‖, which the force and the laws share.
template <Scalar T>
struct Sizes {
    T position{}, velocity{}, surface{};
};
template <Scalar T>
Sizes<T> sizes_of(const Motion<T>& motion, const Vec2<T>& surface) {
    return {.position = norm(motion.position), .velocity = norm(motion.velocity), .surface = norm(surface)};
}

enum class AdaptationKind { gradient, composite };
enum class RateLaw { skew, printed };

struct AdaptationParams {
    AdaptationKind kind = AdaptationKind::gradient;  // composite: the laws and least squares (composite.hpp)
    bool adaptive = true;                            // false: the initial estimates are kept
    RateLaw rate_law = RateLaw::skew;
    double damping_gain = 150.0, stiffness_gain = 150.0, rate_gain = 150.0;  // M, N, P
    std::array<double, 3> bound_gain{1.0, 1.6, 1.6};                         // x₀, x₁, x₂
    std::array<double, 3> initial_bound{0.1, 0.2, 0.3};                      // b̂₀, b̂₁, b̂₂
    double leakage = 0.0;     // 1/time: estimates return to their initial values at this rate; 0 off
    double dead_zone = 0.0;   // the laws rest while ‖s‖ is below it; 0 off
    double projection = 0.0;  // largest deviation, as a fraction of the family's largest initial entry; 0 off
    double forgetting = 0.0, rate_forgetting = 0.0;  // of least squares, 1/time: all parameters; Ωz besides; 0 nothing

    // Which of the adaptations runs.
    constexpr AdaptationKind runs() const { return adaptive ? kind : AdaptationKind::gradient; }

    static constexpr std::string_view kinds[] = {"gradient", "composite"}, switches[] = {"false", "true"},
                                      rate_laws[] = {"skew", "printed"};
    static constexpr auto adaptive_field() {
        return in_table("controller",
                        choice("adaptive", &AdaptationParams::adaptive, switches,
                               "Estimates replace true values, (35). false: off, all known, (20), (34)."));
    }
    // Of the laws for D, K and Ωz.
    static constexpr auto law_fields() {
        using P = AdaptationParams;
        return std::tuple{
            field("damping_gain", &P::damping_gain, "m/q0^2", above_0,
                  "M, > 0: speed of the D estimate. Towards 0.0: off."),
            field("stiffness_gain", &P::stiffness_gain, "m*omega0^2/q0^2", above_0,
                  "N, > 0: speed of the K estimate. Towards 0.0: off."),
            field("rate_gain", &P::rate_gain, "1/q0^2", above_0,
                  "P, > 0: speed of the Omega_z estimate. Towards 0.0: off."),
        };
    }
    static constexpr auto robustness_fields() {
        using P = AdaptationParams;
        return std::tuple{
            field("leakage", &P::leakage, "omega0", at_least_0,
                  "Unit omega0: rate at which estimates leak back to their initial values. 0.0: off."),
            field("dead_zone", &P::dead_zone, "q0*omega0", at_least_0,
                  "Unit of s: adaptation is frozen while ||s|| is below. 0.0: off."),
            field("projection", &P::projection, "1", at_least_0,
                  "Every estimate is kept within this fraction of its family's largest initial entry about its initial "
                  "value. 0.0: off."),
        };
    }
    static constexpr auto fields() {
        using P = AdaptationParams;
        return std::tuple_cat(
            std::tuple{
                adaptive_field(),
                in_table("controller",
                         choice("rate_law", &P::rate_law, rate_laws,
                                "Law of the Omega_z estimate, (44): skew, P (s1 v2 - s2 v1); printed: off, it never "
                                "moves.")),
                choice("kind", &P::kind, kinds,
                       "gradient: the laws (44); composite: with least squares on the plant's equation, which "
                       "gives D, K, Omega_z and its standard deviation. controller.adaptive false: off."),
            },
            law_fields(),
            std::tuple{
                field("bound_gain", &P::bound_gain, "m*omega0^2, m*omega0^2/q0^2, m/q0^2", above_0,
                      "[x0, x1, x2], > 0: speed of the bound estimates (12). Towards 0.0: off."),
                fixed(field("initial_bound", &P::initial_bound, "m*omega0^2*q0, m*omega0^2, m*omega0", at_least_0,
                            "[b0, b1, b2] at t = 0, units of (12), >= 0: initial switching gain. Zeros: none.")),
            },
            robustness_fields(),
            std::tuple{
                field("forgetting", &P::forgetting, "omega0", at_least_0,
                      "Unit omega0: rate at which composite's least squares forget, all parameters alike. 0.0: off."),
                field("rate_forgetting", &P::rate_forgetting, "omega0", at_least_0,
                      "Unit omega0: rate at which they forget Omega_z besides, which is their bandwidth for it: a fast "
                      "rate, a noisy estimate. 0.0: off, Omega_z is taken for constant."),
            });
    }
};

// What a controller with adaptation reports. Estimates are those known when the force was computed.
template <Scalar T>
struct AdaptiveReport : Estimates<T> {
    Vec2<T> surface{};

    static constexpr auto fields() {
        using R = AdaptiveReport;
        return std::tuple{
            channel("surface", &R::surface, "q0*omega0", "sliding surface s"),
            channel("damping_estimate", &R::damping, "m*omega0", "estimate of the damping D"),
            channel("stiffness_estimate", &R::stiffness, "m*omega0^2", "estimate of the stiffness K"),
            channel("rate_estimate", &R::rate, "omega0", "estimate of the angular rate: skew part of Omega"),
            channel("rate_symmetric_estimate", &R::rate_symmetric, "omega0",
                    "symmetric part of the estimate of Omega; not zero under the printed law only"),
            channel("bound_estimate", &R::bound, "m*omega0^2*q0, m*omega0^2, m*omega0",
                    "estimates of the bounds b0, b1, b2"),
        };
    }
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

    using Report = AdaptiveReport<T>;

    // From the nominal plant the estimates start. `largest_bound`: the largest ρ that the force is given, which no b̂
    // grows beyond; infinity: off.
    static Coefficients prepare(const AdaptationParams& p, const PlantModel<double>& nominal, double step,
                                double largest_bound = std::numeric_limits<double>::infinity()) {
        const double h = p.adaptive ? step : 0.0;
        const auto largest = [](const Sym2<double>& a) {
            return maximum(absolute(a.xx), maximum(absolute(a.xy), absolute(a.yy)));
        };
        const std::array<double, 3>& from = p.initial_bound;
        const bool projected = p.projection > 0.0, bounded = largest_bound < std::numeric_limits<double>::infinity();
        const double most = p.projection * maximum(from[0], maximum(from[1], from[2]));
        const auto bound_limit = [&](double start) {
            const double growth = maximum(largest_bound - start, 0.0);
            return T(projected ? minimum(most, growth) : growth);
        };
        const auto sym2 = [](const Sym2<double>& a) { return Sym2<T>{T(a.xx), T(a.xy), T(a.yy)}; };
        return {.initial = {.damping = sym2(nominal.damping),
                            .stiffness = sym2(nominal.stiffness),
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

    static bool sound(const State&, const Coefficients&) { return true; }  // all of it is numbers

    static Estimates<T> estimates(const State& state, const Coefficients& c) { return c.initial + state.deviation; }
    // What is reported, and what the force is computed with: the same.
    static Report report(const State& state, const Coefficients& c) { return {estimates(state, c)}; }
    static const Estimates<T>& control_estimates(const State&, const Coefficients&, const Report& reported) {
        return reported;
    }

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
