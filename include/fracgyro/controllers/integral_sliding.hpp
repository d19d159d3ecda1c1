// Integral sliding mode on a linear surface, with a disturbance observer: two integrators that the measured velocity
// feeds, so that the noise of the position hardly reaches the force.
//
// Use it when positions and velocities are measured, only tracking counts, and an unknown delay or few operations
// matter.
//
//        u = û - λ ė - κ s - I - d̂        s = ė + λ e        dI/dt = ωᵢ κ s
//        û = (D̂₀ + 2Ω̂₀)(ṙ + ė) + K̂₀ (r + e) + r̈
//
//    with the reference at the held point (reference.hpp), d̂ of disturbance_observer.hpp, and the nominal plant, which
//    is not corrected. With exact sensors it is a PID; in noise, the integrals of the velocity carry the position that
//    a PID takes from the sensor. At the force limit I is frozen if it would wind up; d̂ follows the acting force.
//
// Source: textbook; docs/decisions/0051.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/disturbance_observer.hpp"
#include "fracgyro/control/feedforward.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/control/shared_fields.hpp"

namespace fracgyro {

struct IntegralSlidingParams {
    double surface_gain = 30.0;         // λ
    double reaching_rate = 90.0;        // κ
    double integral_rate = 20.0;        // ωᵢ; 0: no integral action
    double observer_frequency = 250.0;  // L; 0: no observer

    static constexpr auto fields() {
        using P = IntegralSlidingParams;
        return Fields{
            surface_gain_field(&P::surface_gain),
            reaching_rate_field(&P::reaching_rate),
            field("integral_rate", &P::integral_rate, "omega0", at_least_0,
                  "omega_i, unit omega0: integral action grows by omega_i kappa s. 0.0: off."),
            field("disturbance_observer", &P::observer_frequency, "omega0", at_least_0,
                  "L, unit omega0: bandwidth at which the force that the nominal plant lacks is estimated from the "
                  "velocity; L times run.step at most about 0.3. 0.0: off."),
        };
    }
};

template <Scalar T>
struct IntegralSliding {
    using Value = T;
    using Params = IntegralSlidingParams;
    using Report = EmptyReport;
    using Observed = DisturbanceObserver<T>;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename Saturation<T>::Coefficients saturation{};
        typename Feedforward<T>::Coefficients nominal{};
        typename Observed::Coefficients observer{};
        T surface_gain{}, reaching_gain{}, integral_step{};
    };
    struct State {
        typename Reference<T>::State reference{};
        typename Observed::State observer{};
        Vec2<T> integral{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.reference = Reference<T>::prepare(common.reference, common.step),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .nominal = Feedforward<T>::prepare(common.nominal),
                .observer = Observed::prepare(p.observer_frequency, common.step),
                .surface_gain = T(p.surface_gain),
                .reaching_gain = T(p.reaching_rate),
                .integral_step = T(common.step * p.integral_rate * p.reaching_rate)};
    }

    static Report report(const State&, const Coefficients&) { return {}; }
    static bool sound(const State& state, const Coefficients&) { return Observed::sound(state.observer); }
    static std::uint64_t steps(const State& state) { return state.reference.steps; }
    static void start_over(State& state, bool keep_estimates) {
        Observed::start_over(state.observer, keep_estimates);
        if (!keep_estimates) {
            state.integral = {};
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference)};
        const ReferencePoint<T>& r = signals.reference;
        const Sample<T>& e = signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;
        if (missing == nullptr) {
            Observed::correct(state.observer, c.observer, e);
        }
        const Vec2<T> s = e.derivative + c.surface_gain * e.value;
        ReferencePoint<T> there = Reference<T>::held(state.reference, c.reference);
        there.position = there.position + e.value;
        there.velocity = there.velocity + e.derivative;
        const Vec2<T> keeps = Feedforward<T>::force(c.nominal, there);
        const Vec2<T> wanted =
            keeps - c.surface_gain * e.derivative - c.reaching_gain * s - state.integral - state.observer.force;
        // I grows with s and moves the force against it.
        const T active = Saturation<T>::apply(signals, c.saturation, wanted, s);
        if (missing == nullptr) {
            state.integral = state.integral + (active * c.integral_step) * s;
            Observed::predict(state.observer, c.observer, e, signals.force - keeps);
        } else {
            Observed::pause(state.observer);
        }
        return signals;
    }
};

}  // namespace fracgyro
