// The adaptive sliding mode controller: steps 1 to 5 of the paper's Figure 2. Step 6, the plant, is in
// sim/fracgyro/plant.hpp.
#pragma once

#include "adaptation.hpp"
#include "belief.hpp"
#include "control.hpp"
#include "error.hpp"
#include "reference.hpp"
#include "surface.hpp"

namespace fracgyro {

// What a person sets. Nondimensional.
struct ControllerParams {
    double step = 1e-3;
    ReferenceParams reference{};
    SurfaceParams surface{};
    ControlParams control{};
    AdaptationParams adaptation{};
    GuardParams guard{};
    double observer_bandwidth = 0.0;  // of Observing (observer.hpp); 0: the velocity is measured
};

// What one step computes, for the plant and for the record.
template <Scalar T>
struct Signals {
    ReferencePoint<T> reference{};
    Sample<T> error{};
    Vec2<T> surface{};
    Estimates<T> estimates{};  // as they stood when the force was computed
    Vec2<T> force{};
    Vec2<T> excess{};  // what the force limit took from it
    RateQuality<T> rate_quality{};
};

template <Scalar T, template <class> class SurfaceOf, template <class> class AdaptationOf = Adaptation>
struct SlidingModeController {
    using Value = T;
    using SurfaceType = SurfaceOf<T>;
    using AdaptationType = AdaptationOf<T>;
    template <template <class> class Other>
    using Adapted = SlidingModeController<T, SurfaceOf, Other>;
    using Params = ControllerParams;
    static constexpr bool measures_velocity = true;

    struct Coefficients {
        typename Reference<T>::Coefficients reference{};
        typename SurfaceType::Coefficients surface{};
        typename Control<T>::Coefficients control{};
        typename AdaptationType::Coefficients adaptation{};
    };
    // A plain value: copy it to save, assign it to resume, bit for bit.
    struct State {
        typename Reference<T>::State reference{};
        typename SurfaceType::State surface{};
        typename AdaptationType::State adaptation{};
    };

    static Coefficients prepare(const Params& p) {
        return {.reference = Reference<T>::prepare(p.reference, p.step),
                .surface = SurfaceType::prepare(p.surface, p.step),
                .control = Control<T>::prepare(p.control, p.adaptation.printed_rate_law, p.step),
                .adaptation = AdaptationType::prepare(p.adaptation, p.step, largest_bound(p.control, p.step))};
    }

    static bool sound(const State& state, const Coefficients& c) {
        return SurfaceType::sound(state.surface, c.surface) && AdaptationType::sound(state.adaptation, c.adaptation);
    }

    // What is known before the coming step.
    static Estimates<T> estimates(const State& state, const Coefficients& c) {
        return AdaptationType::estimates(state.adaptation, c.adaptation);
    }
    static RateQuality<T> rate_quality(const State& state, const Coefficients& c) {
        return AdaptationType::quality(state.adaptation, c.adaptation);
    }

    static std::uint64_t steps(const State& state) { return state.reference.steps; }

    // Forgets what was measured, and what was learnt from it unless it is kept. Time goes on.
    static void start_over(State& state, bool keep_estimates) {
        // Constants: they are copied as they are, and not put together on the stack.
        static constexpr typename SurfaceType::State no_motion{};
        state.surface = no_motion;
        if (keep_estimates) {
            AdaptationType::rest(state.adaptation);
        } else {
            static constexpr typename AdaptationType::State nothing_learnt{};
            state.adaptation = nothing_learnt;
        }
    }

    // The force for the coming step, from the motion measured now. Called once every step. Where nothing was measured
    // the error is taken to be `missing`, and the estimates rest.
    static Signals<T> step(State& state, const Coefficients& c, const Motion<T>& measured,
                           const Sample<T>* missing = nullptr) {
        Signals<T> signals{.reference = Reference<T>::update(state.reference, c.reference),  // 1
                           .estimates = estimates(state, c),
                           .rate_quality = rate_quality(state, c)};
        const ReferencePoint<T>& r = signals.reference;
        const Motion<T> motion = missing == nullptr ? measured
                                                    : Motion<T>{.position = r.position + missing->value,
                                                                .velocity = r.velocity + missing->rate};
        const Sample<T>& error = signals.error = tracking_error(motion, signals.reference);      // 2
        const SurfacePoint<T> surface = SurfaceType::evaluate(state.surface, c.surface, error);  // 3
        signals.surface = surface.s;
        Sizes<T> sizes = sizes_of(motion, surface.s);
        const auto& believed = AdaptationType::believed(state.adaptation, c.adaptation, signals.estimates);
        signals.force = Control<T>::force(c.control, believed, motion, signals.reference, surface, sizes);  // 4
        Vec2<T> learnt_from = surface.s;
        if (c.control.limited) {
            const Vec2<T> wanted = signals.force;
            signals.force = Control<T>::within_limit(c.control, wanted);
            signals.excess = wanted - signals.force;
            // The laws move the force against s: s·Δu <= 0. Where it is beyond the limit that way, they would wind up.
            const T unwinding = signals.excess.x * surface.s.x + signals.excess.y * surface.s.y;
            const T active = if_less(unwinding, T(0.0), T(0.0), T(1.0));
            learnt_from = active * surface.s;
            sizes.surface = active * sizes.surface;
        }
        SurfaceType::advance(state.surface, c.surface, error);
        if (missing == nullptr) {
            AdaptationType::update(state.adaptation, c.adaptation, motion, learnt_from, sizes, signals.force);  // 5
        } else {
            AdaptationType::rest(state.adaptation);
        }
        return signals;
    }
};

}  // namespace fracgyro
