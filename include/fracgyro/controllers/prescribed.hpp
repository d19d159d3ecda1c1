// Adaptive control with prescribed performance: the error stays within a bound that shrinks on a given course, as a
// barrier there pushes it back.
//
// Use it when you study prescribed bounds; it is a spring and damper that stiffen as the bound shrinks.
//
//        ρ = (ρ₀ - ρ_∞) e^(-τ t) + ρ_∞        H = e/ρ        ε = ln((1 + H)/(1 - H))/(2ξ)
//        α = ṙ - τ (1 - ρ_∞/ρ) e - B φ(ε)        B = ξ ρ (1 - H²)        φ = 2^(-3/4) k₁ sig(ε, ½) + ¼ k₂ ε³
//        u = (D̂ + 2Ω̂) v + K̂ q + dα/dt - ε/B - c z - 2^(-3/4) k₃ sig(z, ½) - ¼ k₄ z³        z = v - α
//
//    on each axis, with q, v and r̈ of the force moved along the reference to the held point (feedforward.hpp). Near
//    zero it is a spring of the frequency 1/(ξ ρ) and the damper c: a bound below the error that these leave is
//    exceeded. The estimates follow the laws (44), with z instead of s. At the final bound z is nearly ė, from which
//    they learn nothing of a lasting error.
//
//    Sampled, the spring of the barrier is limited to a frequency of 1/(2h): ξ is at least 2h/ρ_∞, and B of ε/B at
//    least 2h. No damper takes more than z in a step. If the error reaches the bound, |H| > 1 - 2⁻¹⁰, or the force its
//    limit, the bound is widened to 1.2 |e|, with the spring that it had, and shrinks from there.
//
//    A funnel has a gain that grows towards the bound instead of the barrier, and one for the velocity:
//
//        u = (D̂ + 2Ω̂) v + K̂ q + r̈ - k_e² e - k_v ė        k_e = 1/(ξ (ρ - |e|))        k_v = c ν ρ_∞/(ν ρ - |ė|)
//
//    with the same spring at zero, k_e at most 1/(2h) and k_v at most 0.8/h. It needs no model; the laws (44) have
//    ė + τ (1 - ρ_∞/ρ) e.
//
// Source: 2023, doi 10.1049/cth2.12484 (abstract and code read); the funnel after doi 10.1137/100799903
// (abstract read, gains from memory); docs/decisions/0053.
#pragma once

#include "fracgyro/controllers/adaptive.hpp"

namespace fracgyro {

enum class BarrierShape { logarithm, funnel };

struct PrescribedParams {
    BarrierShape shape = BarrierShape::logarithm;
    double bound_start = 1.0, bound_final = 0.01, bound_rate = 5.0;  // ρ₀, ρ_∞, τ
    double barrier_scale = 0.5;                                      // ξ
    double barrier_root = 1e-3, barrier_cube = 1e-3;                 // k₁, k₂
    double damper_root = 1.0, damper_cube = 1.0;                     // k₃, k₄
    double damper = 300.0;                                           // c
    double velocity_bound = 20.0;                                    // ν
    AdaptationParams adaptation{};                                   // the bounds are not used

    static constexpr std::string_view shapes[] = {"logarithm", "funnel"};
    static constexpr auto fields() {
        using P = PrescribedParams;
        return Fields{
            choice(
                "barrier_shape", &P::shape, shapes,
                "logarithm: a spring from the logarithm of the distance to the bound. funnel: gains of the error and "
                "of its rate that grow towards their bounds."),
            field("bound_start", &P::bound_start, "q0", above_0,
                  "rho0, unit q0, > 0: bound of |e| at the start, where it is at least 1.2 |e|."),
            field("bound_final", &P::bound_final, "q0", above_0,
                  "rho_inf, unit q0, > 0: bound of |e| at last, below bound_start."),
            field("bound_rate", &P::bound_rate, "omega0", above_0,
                  "tau, unit omega0, > 0: rate at which the bound shrinks."),
            field("barrier_scale", &P::barrier_scale, "1/(q0*omega0)", above_0,
                  "xi, unit 1/(q0 omega0), > 0: near e = 0 the barrier is a spring of the frequency 1/(xi rho). At "
                  "least 2 run.step/bound_final is used."),
            field("barrier_root", &P::barrier_root, "q0^0.5*omega0^1.5", at_least_0,
                  "k1, unit q0^0.5 omega0^1.5: of |epsilon|^(1/2), for a fixed time. 0.0: off."),
            field("barrier_cube", &P::barrier_cube, "1/(q0^2*omega0)", at_least_0,
                  "k2, unit 1/(q0^2 omega0): of epsilon^3, for a fixed time. 0.0: off."),
            field("damper_root", &P::damper_root, "q0^0.5*omega0^1.5", at_least_0,
                  "k3, unit q0^0.5 omega0^1.5: of |z|^(1/2), for a fixed time. 0.0: off."),
            field("damper_cube", &P::damper_cube, "1/(q0^2*omega0)", at_least_0,
                  "k4, unit 1/(q0^2 omega0): of z^3, for a fixed time. 0.0: off."),
            field("damper", &P::damper, "omega0", at_least_0, "c, unit omega0: damper of z. 0.0: off, as published."),
            field("velocity_bound", &P::velocity_bound, "omega0", above_0,
                  "nu, unit omega0, > 0: bound of |de/dt| over that of |e|, of a funnel."),
            Inner{"adaptation", &P::adaptation, AdaptationParams::plant_fields()},
        };
    }
};

template <Scalar T>
struct PrescribedReport : PlantReport<T> {
    Vec2<T> error_bound{}, frequency{};  // ρ, 1/(ξ ρ)
    T widened{}, left{};

    static constexpr auto fields() {
        using R = PrescribedReport;
        return joined(Fields{momentary(channel("error_bound", &R::error_bound, "q0", "bound of the error, rho")),
                             momentary(channel("barrier_frequency", &R::frequency, "omega0",
                                               "frequency of the barrier's spring at no error, 1/(xi rho)"))},
                      PlantReport<T>::fields(),
                      Fields{channel("bound_widened", &R::widened, "1", "1 while the bound is wider than prescribed"),
                             channel("bound_left", &R::left, "1", "1 from when the error was first beyond its bound")});
    }
};

template <Scalar T>
struct Prescribed {
    using Value = T;
    using Params = PrescribedParams;
    using Report = PrescribedReport<T>;
    using Base = Adaptive<T>;

    struct Coefficients {
        typename Base::Coefficients base{};
        T start{}, last{}, rate{}, decay{};         // ρ₀, ρ_∞, τ, e^(-τ h)
        T scale{}, inverse_twice{};                 // ξ, 1/(2ξ)
        T barrier_root{}, barrier_cube{};           // 2^(-3/4) k₁, ¼ k₂
        T damper_root{}, damper_cube{}, damper{};   // 2^(-3/4) k₃, ¼ k₄, c
        T shortest{}, half_rate{}, inverse_step{};  // 2h, 1/(2h), 1/h
        T velocity{}, gain{}, nearest{};            // ν, c ν ρ_∞, and the least of ν ρ - |ė|
        bool funnel = false;
    };
    struct State {
        typename Base::State base{};
        Vec2<T> bound{}, prescribed{};  // ρ of the coming step, and its course from the start
        T left{};
        Kept<T, bool> started = false;
    };

    static constexpr double most = 1.0 - 1.0 / 1024.0;

    static Coefficients prepare(const Params& p, const Common& common) {
        const double h = common.step, root = 0.59460355750136053336;  // 2^(-3/4)
        const double scale = maximum(p.barrier_scale, 2.0 * h / p.bound_final);
        const double gain = p.damper * p.velocity_bound * p.bound_final;
        return {.base = Base::prepare(p.adaptation, common),
                .start = T(maximum(p.bound_start, p.bound_final)),
                .last = T(p.bound_final),
                .rate = T(p.bound_rate),
                .decay = T(exponential(-p.bound_rate * h)),
                .scale = T(scale),
                .inverse_twice = T(0.5 / scale),
                .barrier_root = T(root * p.barrier_root),
                .barrier_cube = T(0.25 * p.barrier_cube),
                .damper_root = T(root * p.damper_root),
                .damper_cube = T(0.25 * p.damper_cube),
                .damper = T(p.damper),
                .shortest = T(2.0 * h),
                .half_rate = T(0.5 / h),
                .inverse_step = T(1.0 / h),
                .velocity = T(p.velocity_bound),
                .gain = T(gain),
                .nearest = T(maximum(1.25 * h * gain, 1e-12)),
                .funnel = p.shape == BarrierShape::funnel};
    }

    static Report report(const State& state, const Coefficients& c) {
        const Vec2<T> wider = state.bound - state.prescribed;
        return {{Base::report(state.base, c.base)},
                {},
                {},
                if_less(T(0.0), maximum(wider.x(), wider.y()), T(1.0), T(0.0)),
                state.left};
    }
    static bool sound(const State& state, const Coefficients&) { return fracgyro::sound(state.started); }
    static std::uint64_t steps(const State& state) { return state.base.reference.steps; }
    // The bound starts over from the next error.
    static void start_over(State& state, bool keep_estimates) {
        Base::start_over(state.base, keep_estimates);
        state.bound = state.prescribed = {};
        state.started = false;
        if (!keep_estimates) {
            state.left = T(0.0);
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.report = report(state, c)};
        const Motion<T> motion = Base::begin(state.base, c.base, signals, measured, missing);
        const Sample<T>& e = signals.error;
        const ReferencePoint<T> held = Reference<T>::held(state.base.reference, c.base.reference);
        const Vec2<T> size = absolute(e.value);
        if (missing == nullptr) {
            follow(state, c, size);
        }
        const Vec2<T> bound = signals.report.error_bound = maximum(state.bound, c.last);
        const Vec2<T> course = maximum(state.prescribed, c.last);
        signals.report.frequency = reciprocal(c.scale * course);
        const Push push = c.funnel ? of_funnel(c, e, bound, course) : of_barrier(c, e, bound, course);
        const Vec2<T>& z = push.z;
        const Vec2<T> wanted =
            plant_force<T>(signals.report, moved(motion, signals.reference, held), held.acceleration) + push.turns -
            push.spring - push.damper;
        const T active = Saturation<T>::apply(signals, c.base.saturation, wanted, z);
        state.bound = shrunk(c, state.bound);
        state.prescribed = shrunk(c, state.prescribed);
        if (missing == nullptr) {
            const Vec2<T> zero{}, room = T(1.2) * size;
            const Vec2<T> wider = if_less(state.bound, room, room, state.bound);
            state.bound = if_less(zero, absolute(signals.excess), wider, state.bound);
            Base::learn(state.base, c.base, motion, active * z);
        }
        return signals;
    }

private:
    // Signal of the laws and of the force, and the parts of the force: dα/dt - r̈, spring and damper.
    struct Push {
        Vec2<T> z{}, turns{}, spring{}, damper{};
    };
    static Push of_barrier(const Coefficients& c, const Sample<T>& e, const Vec2<T>& bound, const Vec2<T>& course) {
        const Vec2<T> one{T(1.0), T(1.0)};
        const Vec2<T> width = c.scale * course;  // ξ ρ
        const Vec2<T> inverse = reciprocal(bound), wider = bound * reciprocal(course);
        const Vec2<T> share = clamp(inverse * e.value, T(-most), T(most));  // H
        const Vec2<T> space = one - share * share;
        const Vec2<T> barrier = width * space;  // B
        const Vec2<T> epsilon = c.inverse_twice * (wider * logarithms((one + share) * reciprocal(one - share)));
        const Vec2<T> shrinks = c.rate * (one - c.last * inverse);  // -dρ/dt/ρ
        const Vec2<T> distance = absolute(epsilon), root = square_root(distance), square = epsilon * epsilon;
        const Vec2<T> phi = with_sign_of(epsilon, c.barrier_root * root) + c.barrier_cube * (square * epsilon);
        const Vec2<T> closes = e.derivative + shrinks * e.value;
        const Vec2<T> z = closes + barrier * phi;

        // dφ/dt = slope dε/dt, B dε/dt = closes and dH/dt = closes/ρ.
        const Vec2<T> floored = maximum(root, T(0.0316227766016837933));
        const Vec2<T> steep = (T(0.5) * c.barrier_root) * reciprocal(floored) + (T(3.0) * c.barrier_cube) * square;
        const Vec2<T> slope = if_less(steep, c.half_rate * one, steep, c.half_rate * one);
        const Vec2<T> narrows = (c.rate * c.last) * (shrinks * inverse);  // -d(shrinks)/dt
        const Vec2<T> widens =
            -(shrinks * barrier) - (T(2.0) * c.scale) * (share * (closes * (course * inverse)));  // dB/dt
        const Vec2<T> speed = absolute(z);
        const Vec2<T> damps =
            c.damper * speed + c.damper_root * square_root(speed) + c.damper_cube * (speed * speed * speed);
        const Vec2<T> stops = c.inverse_step * speed;
        return {.z = z,
                .turns = narrows * e.value - shrinks * e.derivative - slope * closes - widens * phi,
                .spring = epsilon * reciprocal(maximum(barrier, c.shortest)),
                .damper = with_sign_of(z, if_less(damps, stops, damps, stops))};
    }
    // A bound that was widened keeps its spring.
    static Push of_funnel(const Coefficients& c, const Sample<T>& e, const Vec2<T>& bound, const Vec2<T>& course) {
        const Vec2<T> one{T(1.0), T(1.0)}, most_of_all = c.half_rate * one;
        const Vec2<T> inverse = reciprocal(bound), room = maximum(one - inverse * absolute(e.value), T(1.0 - most));
        const Vec2<T> gain = reciprocal(c.scale * course * room);
        const Vec2<T> limited = if_less(gain, most_of_all, gain, most_of_all);
        const Vec2<T> slack = maximum(c.velocity * bound - absolute(e.derivative), c.nearest);
        return {.z = e.derivative + c.rate * (one - c.last * inverse) * e.value,
                .spring = limited * (limited * e.value),
                .damper = c.gain * (reciprocal(slack) * e.derivative)};
    }
    static Vec2<T> shrunk(const Coefficients& c, const Vec2<T>& bound) {
        const Vec2<T> last{c.last, c.last};
        return last + c.decay * (bound - last);
    }
    // Starts or widens the bound for this |e|.
    static void follow(State& state, const Coefficients& c, const Vec2<T>& size) {
        const Vec2<T> room = T(1.2) * size;
        if (!state.started) {
            state.bound = state.prescribed = maximum(room, c.start);
            state.started = true;
        }
        state.bound = if_less(T(most) * state.bound, size, room, state.bound);
        const Vec2<T> beyond = size - state.prescribed;
        state.left = if_less(maximum(beyond.x(), beyond.y()), T(0.0), state.left, T(1.0));
    }
    static Vec2<T> logarithms(const Vec2<T>& a) { return {logarithm(a.x()), logarithm(a.y())}; }
};

}  // namespace fracgyro
