// A controller with a part around it that changes its force: event trigger, disturbance observer.
#pragma once

#include "fracgyro/hardware/motion_filter.hpp"

namespace fracgyro {

// True for a part that needs the velocity, also of a controller that does not.
template <class Part>
inline constexpr bool needs_velocity = requires { requires Part::needs_velocity; };

// The part has step(state, coefficients, measured, missing, controller), as MotionFilter. A controller that asks for
// the acting force receives that of the part.
template <Resumable Controller, class Part>
struct Around {
    using Value = typename Controller::Value;
    using T = Value;
    using Params = typename Controller::Params;
    using Report = typename Controller::Report;
    static constexpr bool measures_velocity = needs_velocity<Part> || fracgyro::measures_velocity<Controller>;

    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Part::Coefficients part{};
    };
    struct State {
        typename Controller::State controller{};
        typename Part::State part{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.controller = Controller::prepare(p, common), .part = Part::prepare(common)};
    }
    static bool sound(const State& state, const Coefficients& c) {
        return Controller::sound(state.controller, c.controller) && Part::sound(state.part);
    }
    static Report report(const State& state, const Coefficients& c) {
        return Controller::report(state.controller, c.controller);
    }
    static std::uint64_t steps(const State& state) { return Controller::steps(state.controller); }
    static void start_over(State& state, bool keep_estimates) {
        Controller::start_over(state.controller, keep_estimates);
        Part::start_over(state.part, keep_estimates);
    }
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        const Signals<T, Report> signals = Part::step(
            state.part, c.part, measured, missing != nullptr,
            [&](const Motion<T>& seen) { return Controller::step(state.controller, c.controller, seen, missing); });
        if constexpr (KnowsForce<Controller>) {
            if (missing == nullptr) {  // otherwise the guard holds the last one
                Controller::acted(state.controller, c.controller, signals.force);
            }
        }
        return signals;
    }
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force)
        requires(KnowsForce<Part> || KnowsForce<Controller>)
    {
        if constexpr (KnowsForce<Part>) {
            Part::acted(state.part, c.part, force);
        }
        if constexpr (KnowsForce<Controller>) {
            Controller::acted(state.controller, c.controller, force);
        }
    }
};

namespace detail {

// The controller behind an observer, which has to stay in front of all parts, as it knows the force that acts.
template <class Controller>
struct Unobserved {
    static constexpr bool observed = false;
    using Type = Controller;
};
template <class Controller>
struct Unobserved<Observing<Controller>> {
    static constexpr bool observed = true;
    using Type = Controller;
};

}  // namespace detail

template <Resumable Controller, class Part>
struct FromPositions<Around<Controller, Part>> {
    using Known = detail::Unobserved<typename FromPositions<Controller>::Type>;
    using Inner = Around<typename Known::Type, Part>;
    using Type = std::conditional_t<Known::observed || needs_velocity<Part>, Observing<Inner>, Inner>;
};
template <Resumable Controller, class Part>
inline constexpr bool takes_filter<Around<Controller, Part>> = takes_filter<Controller>;

}  // namespace fracgyro
