// Adaptive sliding mode control, on any surface and with any adaptation: steps 1 to 5 of the paper's Figure 2. Step 6,
// the plant, is in include/fracgyro/plant/gyroscope.hpp.
//
//        u = (D̂ + 2Ω̂) v + K̂ q + r̈ - drift - ρ s/max(‖s‖, δ)
//        ρ = b̂₀ + b̂₁ ‖q‖ + b̂₂ ‖v‖
//
//    The force cancels the known part of ds/dt and drives s to zero (switching.hpp). D̂, K̂, Ω̂z and the bounds b̂
//    follow the laws (44), which s drives (gradient.hpp), optionally with least squares (composite.hpp), or a Kalman
//    filter that models the sensors' noise (joint.hpp).
//
// Source: the paper, Complexity 2020, 8542961, doi 10.1155/2020/8542961.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/control/saturation.hpp"
#include "fracgyro/control/surfaces.hpp"
#include "fracgyro/control/switching.hpp"
#include "fracgyro/estimation/composite.hpp"
#include "fracgyro/estimation/gradient.hpp"
#include "fracgyro/estimation/joint.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

// Parameters set by the user. Nondimensional.
struct SlidingModeParams {
    SurfaceParams surface{};
    SwitchingParams control{};
    AdaptationParams adaptation{};
    Datasheet datasheet{};

    ExponentialSum& kernel() { return surface.kernel; }
    const ExponentialSum& kernel() const { return surface.kernel; }
    static constexpr auto fields() {
        using P = SlidingModeParams;
        return Fields{Inner{"controller", &P::surface}, Inner{"controller", &P::control},
                      Inner{"adaptation", &P::adaptation}, Inner{"datasheet", &P::datasheet}};
    }
};

namespace detail {
template <template <class> class SurfaceOf, std::size_t Capacity>
struct SizedSurface {
    template <class T>
    using Of = typename SurfaceOf<T>::template Sized<Capacity>;
};
}  // namespace detail

template <Scalar T, template <class> class SurfaceOf, template <class> class AdaptationOf = GradientAdaptation>
struct SlidingModeController {
    using Value = T;
    using SurfaceType = SurfaceOf<T>;
    using AdaptationType = AdaptationOf<T>;
    using Params = SlidingModeParams;
    using Report = typename AdaptationType::Report;
    static constexpr bool has_memory = SurfaceType::has_memory;
    // True if the adaptation also estimates the motion, which the surface and the force then use.
    static constexpr bool estimates_motion = requires { AdaptationType::estimates_motion; };
    static constexpr bool measures_velocity = fracgyro::measures_velocity<AdaptationType>;
    // Room for `Capacity` exponentials.
    template <std::size_t Capacity>
    using Sized = SlidingModeController<T, detail::SizedSurface<SurfaceOf, Capacity>::template Of, AdaptationOf>;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename SurfaceType::Coefficients surface{};
        typename Switching<T>::Coefficients control{};
        typename Saturation<T>::Coefficients saturation{};
        typename AdaptationType::Coefficients adaptation{};
    };
    // A plain value: copy it to save, assign it to resume, bit for bit.
    struct State {
        typename Reference<T>::State reference{};
        typename SurfaceType::State surface{};
        typename AdaptationType::State adaptation{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        const double h = common.step;
        const auto adaptation = [&] {
            if constexpr (estimates_motion) {
                return AdaptationType::prepare(p.adaptation, p.datasheet, common);
            } else {
                return AdaptationType::prepare(p.adaptation, common.nominal, h, largest_bound(p.control, h));
            }
        };
        const bool held = p.control.feedforward == ForceTime::held;
        return {.reference = Reference<T>::prepare(common.reference, h, held ? p.datasheet.delay : 0),
                .surface = SurfaceType::prepare(p.surface, h, position_share(p.datasheet, common)),
                .control = Switching<T>::prepare(p.control, p.adaptation.rate_law, h),
                .saturation = Saturation<T>::prepare(common.force_limit),
                .adaptation = adaptation()};
    }

    static bool sound(const State& state, const Coefficients& c) {
        return SurfaceType::sound(state.surface, c.surface) && AdaptationType::sound(state.adaptation, c.adaptation);
    }

    static Report report(const State& state, const Coefficients& c) {
        return AdaptationType::report(state.adaptation, c.adaptation);
    }

    static std::uint64_t steps(const State& state) { return state.reference.steps; }

    // Drops the memory of measurements, and the estimates unless they are kept. Time continues.
    static void start_over(State& state, bool keep_estimates) {
        // Constants, which are copied as they are and not assembled on the stack.
        static constexpr typename SurfaceType::State no_motion{};
        state.surface = no_motion;
        if constexpr (estimates_motion) {
            AdaptationType::Filter::start_over(state.adaptation, keep_estimates);
        } else if (keep_estimates) {
            AdaptationType::rest(state.adaptation);
        } else if constexpr (requires { AdaptationType::start_over(state.adaptation); }) {
            AdaptationType::start_over(state.adaptation);
        } else {
            static constexpr typename AdaptationType::State nothing_learned{};
            state.adaptation = nothing_learned;
        }
    }

    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        Signals<T, Report> signals{.reference = Reference<T>::update(state.reference, c.reference),  // 1
                                   .report = report(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        signals.error = missing == nullptr ? tracking_error(measured, r) : *missing;  // 2
        Sample<T> error = signals.error;
        if constexpr (estimates_motion) {
            if (missing == nullptr) {
                AdaptationType::Filter::correct(state.adaptation, c.adaptation.filter, measured, r);
            }
            error = state.adaptation.error;
            signals.error = measures_velocity ? signals.error : error;
        }
        const Motion<T> motion =
            missing == nullptr && !estimates_motion
                ? measured
                : Motion<T>{.position = r.position + error.value, .velocity = r.velocity + error.derivative};
        const SurfaceInput<T> input{.reference = r, .measured = missing == nullptr};
        const SurfacePoint<T> surface = SurfaceType::evaluate(state.surface, c.surface, error, input);  // 3
        signals.report.surface = surface.s;
        Norms<T> norms = norms_of(motion, surface.s);
        const auto& estimates = control_estimates(state, c, signals.report);
        signals.force = Switching<T>::force(c.control, estimates, motion, signals.reference, surface, norms);  // 4
        if (c.control.held) {
            signals.force = signals.force + Switching<T>::of_hold(c.control, estimates, r,
                                                                  Reference<T>::held(state.reference, c.reference));
        }
        Vec2<T> learned_from = surface.s;
        if (c.saturation.limited) {
            // The laws move the force against s.
            const Vec2<T> wanted = signals.force;
            const T active = Saturation<T>::apply(signals, c.saturation, wanted, surface.s);
            learned_from = active * surface.s;
            norms.surface = active * norms.surface;
        }
        SurfaceType::advance(state.surface, c.surface, error, input, signals.excess);
        if constexpr (estimates_motion) {  // 5
            const Vec2<T>& acts = missing == nullptr ? signals.force : state.adaptation.force;
            AdaptationType::Filter::predict(state.adaptation, c.adaptation.filter, r, acts, missing == nullptr);
        } else if (missing == nullptr) {
            AdaptationType::update(state.adaptation, c.adaptation, motion, learned_from, norms, signals.force);
        } else {
            AdaptationType::rest(state.adaptation);
        }
        return signals;
    }

    // For the filter of the motion, the force that acts.
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force)
        requires estimates_motion
    {
        AdaptationType::Filter::acted(state.adaptation, c.adaptation.filter, force);
    }

private:
    static decltype(auto) control_estimates(const State& state, const Coefficients& c, const Report& known) {
        if constexpr (estimates_motion) {
            return static_cast<const Estimates<T>&>(known);
        } else {
            return AdaptationType::control_estimates(state.adaptation, c.adaptation, known);
        }
    }
};

// The joint filter needs no observer.
template <Scalar T, template <class> class SurfaceOf>
struct FromPositions<SlidingModeController<T, SurfaceOf, JointAdaptation>> {
    using Type = SlidingModeController<T, SurfaceOf, JointFromPositions>;
};

}  // namespace fracgyro
