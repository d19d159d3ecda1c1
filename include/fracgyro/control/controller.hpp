// The contract of a controller: functions over plain values. Params are set by a user, Coefficients follow from them
// once, State changes while running. Loop, record, metrics, FMU, firmware and browser take any type that fits, such as
// this one, which a test compiles:
//
//     template <Scalar T>
//     struct Proportional {
//         using Value = T;
//         using Report = EmptyReport;
//         struct Params { double gain = 1e4; };
//         struct Coefficients { typename Reference<T>::Coefficients reference{}; T gain{}; };
//         struct State { typename Reference<T>::State reference{}; };
//         static Coefficients prepare(const Params& p, const Common& common) {
//             return {Reference<T>::prepare(common.reference, common.step), T(p.gain)};
//         }
//         static Report report(const State&, const Coefficients&) { return {}; }
//         static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured) {
//             const auto r = Reference<T>::update(state.reference, c.reference);
//             const auto e = tracking_error(measured, r);
//             return {.reference = r, .error = e, .force = -(c.gain * e.value)};
//         }
//     };
#pragma once

#include "fracgyro/control/common.hpp"
#include "fracgyro/control/reports.hpp"
#include "fracgyro/control/signals.hpp"

namespace fracgyro {

template <class C>
concept Controller =
    std::is_trivially_copyable_v<typename C::State> &&
    requires(typename C::State& state, const typename C::State& known, const typename C::Coefficients& c,
             const typename C::Params& p, const Common& common, const Motion<typename C::Value>& measured) {
        // Called once, in double for every scalar.
        { C::prepare(p, common) } -> std::same_as<typename C::Coefficients>;
        // The force for the coming step, from the motion measured now. Called once every step.
        { C::step(state, c, measured) } -> std::same_as<Signals<typename C::Value, typename C::Report>>;
        // The report as known before the coming step.
        { C::report(known, c) } -> std::same_as<typename C::Report>;
        C::Report::fields();
    };

// A controller that estimates the angular rate.
template <class C>
concept SensesRate = Controller<C> && requires(typename C::Report r) { r.rate; };

// A controller that can miss a sample, forget and be restored. A guard and an observer require it.
template <class C>
concept Resumable =
    Controller<C> &&
    requires(typename C::State& state, const typename C::State& known, const typename C::Coefficients& c,
             const Motion<typename C::Value>& measured, const Sample<typename C::Value>* missing) {
        // `missing`: the error to assume without a measurement; nothing is learned from it.
        { C::step(state, c, measured, missing) } -> std::same_as<Signals<typename C::Value, typename C::Report>>;
        // Drops the memory of measurements, and the estimates unless they are kept. Time continues.
        C::start_over(state, /*keep_estimates=*/true);
        { C::steps(known) } -> std::same_as<std::uint64_t>;
        // True if every index and switch of a state has a permitted value.
        { C::sound(known, c) } -> std::same_as<bool>;
    };

// A controller that receives, after a step, the force to which a converter rounded its request.
template <class C>
concept KnowsForce = requires(typename C::State& state, const typename C::Coefficients& c,
                              const Vec2<typename C::Value>& force) { C::acted(state, c, force); };

// True unless the controller declares otherwise, as a controller behind an observer does.
template <class C>
inline constexpr bool measures_velocity = true;
template <class C>
    requires requires { C::measures_velocity; }
inline constexpr bool measures_velocity<C> = C::measures_velocity;

}  // namespace fracgyro
