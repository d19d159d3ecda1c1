// PID with feedforward of the nominal plant: a spring, a damper and an integral hold each axis on the reference.
//
// Use it when the plant is known within a few percent and only tracking counts. It is the baseline for all others.
//
//        u = (D̂₀ + 2Ω̂₀) ṙ + K̂₀ r + r̈ - ω² e - 2ζω ė - I        dI/dt = ωᵢ ω² e
//
//    with the feedforward at the held point (reference.hpp) and e = q - r on each axis; the index 0 marks the nominal
//    plant, which is not corrected. At the force limit I is frozen if it would wind up.
//
// Source: textbook.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/shared_fields.hpp"
#include "fracgyro/control/saturation.hpp"

namespace fracgyro {

struct PidParams {
    double natural_frequency = 200.0;  // ω
    double damping_ratio = 0.7;        // ζ
    double integral_frequency = 20.0;  // ωᵢ; 0: no integral action

    static constexpr auto fields() {
        using P = PidParams;
        return Fields{
            loop_frequency_field(&P::natural_frequency),
            field("damping_ratio", &P::damping_ratio, "1", above_0, "zeta, no unit, > 0: of the loop."),
            field("integral_frequency", &P::integral_frequency, "omega0", at_least_0,
                  "omega_i, unit omega0: integral action grows by omega_i omega_n^2 e. 0.0: off."),
        };
    }
};

template <Scalar T>
struct Pid {
    using Value = T;
    using Params = PidParams;
    using Report = EmptyReport;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Feedforward<T>::Coefficients nominal{};
        T position_gain{}, velocity_gain{}, integral_step{};
    };
    struct State {
        typename Reference<T>::State reference{};
        Vec2<T> integral{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const double square = p.natural_frequency * p.natural_frequency;
        return {.reference = Reference<T>::prepare(common.reference, common.step),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .nominal = Feedforward<T>::prepare(common.nominal),
                .position_gain = T(square),
                .velocity_gain = T(2.0 * p.damping_ratio * p.natural_frequency),
                .integral_step = T(common.step * p.integral_frequency * square)};
    }

    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State&, const Coefficients&) { return true; }  // numbers only
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        if (!keep_estimates) {
            state.integral = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        return step(state, c, measured, missing, c.nominal);
    }
    // Uses this plant instead of the nominal one.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing, const typename Feedforward<T>::Coefficients& plant) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference)};
        const ReferencePoint<T>& r = signals.reference;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        const Vec2<T> feedforward = Feedforward<T>::force(plant, Reference<T>::held(state.reference, c.reference));
        const Vec2<T> wanted =
            feedforward - c.position_gain * e.value - c.velocity_gain * e.derivative - state.integral;
        // I grows with e and moves the force against it.
        const T active = Saturation<T>::apply(signals, c.saturation, wanted, e.value);
        const T learns = T(missing == nullptr ? 1.0 : 0.0);
        state.integral = state.integral + ((learns * active) * c.integral_step) * e.value;
        return signals;
    }
};

}  // namespace fracgyro
