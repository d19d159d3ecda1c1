// What a controller is. Nothing else is asked of one: the loop, the record, the metrics, FMU, firmware and browser take
// any type that fits. It is a set of functions over plain values: Params is what a person sets, Coefficients what
// follows from it once, State what changes while running.
#pragma once

#include "fracgyro/control/plausibility.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/core/fields.hpp"
#include "fracgyro/control/signals.hpp"

namespace fracgyro {

// What all controllers of a loop have in common. Nondimensional.
struct Common {
    double step = 1e-3;
    ReferenceParams reference{};
    PlantModel<double> nominal{};                                  // what is known of the plant beforehand
    double force_limit = std::numeric_limits<double>::infinity();  // |u| on each axis; infinity: off
    GuardParams guard{};
    double observer_bandwidth = 0.0;  // of Observing (observer.hpp); 0: the velocity is measured

    static constexpr auto fields() {
        using C = Common;
        return std::tuple{
            Inner{"reference", &C::reference},
            Inner{"adaptation", &C::nominal},
            field("force_limit", &C::force_limit, "m*omega0^2*q0", limit,
                  "Largest |u| per axis, unit m omega0^2 q0, > 0. inf: off."),
            Inner{"guard", &C::guard},
        };
    }
};

// Of a controller that reports nothing besides its force.
struct EmptyReport {
    static constexpr std::tuple<> fields() { return {}; }
};

// Of all that hold the error by a spring and a damper.
template <class Member>
constexpr auto loop_frequency_field(Member member) {
    return field("natural_frequency", member, "omega0", above_0,
                 "omega_n, unit omega0, > 0: of the loop. omega_n times run.step must stay below about 0.6.");
}

// The force that keeps the nominal plant on the reference: (D̂₀ + 2Ω̂₀) ṙ + K̂₀ r + r̈.
template <Scalar T>
struct Feedforward {
    struct Coefficients {
        Sym2<T> damping{}, stiffness{};
        T twice_rate{};
    };
    static Coefficients prepare(const PlantModel<double>& nominal) {
        const auto sym2 = [](const Sym2<double>& a) { return Sym2<T>{T(a.xx()), T(a.xy()), T(a.yy())}; };
        return {.damping = sym2(nominal.damping),
                .stiffness = sym2(nominal.stiffness),
                .twice_rate = T(2.0 * nominal.rate)};
    }
    static Vec2<T> force(const Coefficients& c, const ReferencePoint<T>& r) {
        const Vec2<T> coriolis = c.twice_rate * turned(r.velocity);
        return c.damping * r.velocity + coriolis + c.stiffness * r.position + r.acceleration;
    }
};

template <class C>
concept Controller =
    std::is_trivially_copyable_v<typename C::State> &&
    requires(typename C::State& state, const typename C::State& known, const typename C::Coefficients& c,
             const typename C::Params& p, const Common& common, const Motion<typename C::Value>& measured) {
        // Once, in double whatever the scalar.
        { C::prepare(p, common) } -> std::same_as<typename C::Coefficients>;
        // The force for the coming step, from the motion measured now. Called once every step.
        { C::step(state, c, measured) } -> std::same_as<Signals<typename C::Value, typename C::Report>>;
        // What it reports besides, as it stands before the coming step.
        { C::report(known, c) } -> std::same_as<typename C::Report>;
        C::Report::fields();
    };

// All that a rate sensor needs.
template <class C>
concept SensesRate = Controller<C> && requires(typename C::Report r) { r.rate; };

// A controller that can do without a sample, forget and be restored: what a guard and an observer need, and only they.
template <class C>
concept Resumable =
    Controller<C> &&
    requires(typename C::State& state, const typename C::State& known, const typename C::Coefficients& c,
             const Motion<typename C::Value>& measured, const Sample<typename C::Value>* missing) {
        // `missing`: the error that is assumed as nothing was measured; what is learnt rests.
        { C::step(state, c, measured, missing) } -> std::same_as<Signals<typename C::Value, typename C::Report>>;
        // Forgets what was measured, and what was learnt from it unless it is kept. Time goes on.
        C::start_over(state, /*keep_estimates=*/true);
        { C::steps(known) } -> std::same_as<std::uint64_t>;
        // Whether all indices and switches in a state are ones that it could have.
        { C::sound(known, c) } -> std::same_as<bool>;
    };

// Unless it says that it does not, as one behind an observer.
template <class C>
inline constexpr bool measures_velocity = true;
template <class C>
    requires requires { C::measures_velocity; }
inline constexpr bool measures_velocity<C> = C::measures_velocity;

}  // namespace fracgyro
