// Motion filter: a constant Kalman filter of the nominal plant between the sensors and a controller, which receives the
// estimated position and velocity in place of the measured ones.
//
// Use it when the sensors are noisy and the controller has no filter of its own.
//
//    Each step: correct by the measured position q and velocity v, or only the position; then predict with the nominal
//    plant over a step, exactly, under the force u that acts after the known delay:
//
//        z = z⁻ + L_z [q - q⁻, v - v⁻]        f = f⁻ + L_f [q - q⁻, v - v⁻]        z = [q, v]
//        z⁻ = F z + G (u + f)        f⁻ = f
//
//    f is the acceleration missing from the nominal plant: for the gains (filter_design.hpp) a random walk, which is
//    followed at the bandwidth `bandwidth` if the sensors allow it. The noise is that of the datasheet.
//
// Source: textbook; docs/decisions/0048.
#pragma once

#include "fracgyro/hardware/filter_design.hpp"
#include "fracgyro/hardware/observer.hpp"

namespace fracgyro {

template <Scalar T, bool velocity_measured>
struct MotionFilter {
    static constexpr std::size_t max_delay = 8;
    static constexpr bool measures_velocity = velocity_measured;
    using Gain = FilterGain<T, velocity_measured ? 2 : 1>;

    struct Coefficients {
        std::array<Matrix2<T>, 4> map{};   // F - 1, whose digits a float keeps: q of q, q of v, v of q, v of v
        std::array<Matrix2<T>, 2> push{};  // G
        Gain position{}, velocity{}, acceleration{};
        std::int32_t delay = 0;
    };
    struct State {
        Motion<T> motion{};                      // predicted for the coming sample
        Vec2<T> acceleration{};                  // f
        Vec2<T> force{};                         // the last one sent
        std::array<Vec2<T>, max_delay> under{};  // forces sent before, which still have to act, the last one first
        Kept<T, bool> started = false;
    };

    static Coefficients prepare(const Common& common) {
        const double h = common.step;
        const FilterParams& p = common.filter;
        std::array<filter_design::Gains, 2> axes{};
        for (std::size_t axis = 0; axis < 2; ++axis) {
            axes[axis] = filter_design::gains(held_plant::one_axis(common.nominal, h, axis), h,
                                              common.nominal.stiffness, p.assumed, p.bandwidth, {}, velocity_measured);
        }
        Matrix<6> map = held_plant::without_units(held_plant::both_axes(common.nominal, h), h);
        for (std::size_t i = 0; i < 4; ++i) {
            map[i][i] -= 1.0;
        }
        const auto block = [&](std::size_t row, std::size_t column) { return held_plant::block<T>(map, row, column); };
        return {.map = {block(0, 0), block(0, 2), block(2, 0), block(2, 2)},
                .push = {block(0, 4), block(2, 4)},
                .position = Gain::prepare(axes, 0),
                .velocity = Gain::prepare(axes, 1),
                .acceleration = Gain::prepare(axes, 2),
                .delay = static_cast<std::int32_t>(clamp<std::int64_t>(p.assumed.delay, 0, max_delay))};
    }
    static bool sound(const State& state) { return fracgyro::sound(state.started); }

    // Drops the motion, and with it f. Forces that have yet to act remain.
    static void start_over(State& state, bool keep_forces) {
        State fresh{};
        if (keep_forces) {
            fresh.force = state.force;
            fresh.under = state.under;
        }
        state = fresh;
    }

    // One step of a controller behind the filter: step(motion) is called with the motion as estimated. Without a
    // measurement the last force is held, and the filter predicts.
    template <class Step>
    static auto step(State& state, const Coefficients& c, const Motion<T>& measured, bool missing, Step&& controller) {
        if (!missing) {
            correct(state, c, measured);
        }
        const auto signals = controller(missing ? measured : state.motion);
        if (!missing || !state.started) {
            state.force = signals.force;
        }
        predict(state, c);
        return signals;
    }

    // The force that the last step requested acts as this one.
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        const Vec2<T> more = force - state.force;
        state.force = force;
        if (c.delay > 0) {
            state.under[0] = force;
            return;
        }
        state.motion.position = state.motion.position + c.push[0] * more;
        state.motion.velocity = state.motion.velocity + c.push[1] * more;
    }

private:
    // The first sample starts the filter, at rest if only positions are measured.
    static void correct(State& state, const Coefficients& c, const Motion<T>& measured) {
        Motion<T>& z = state.motion;
        if (!state.started) {
            z = {.position = measured.position};
            if constexpr (velocity_measured) {
                z.velocity = measured.velocity;
            }
            state.started = true;
            return;
        }
        const Vec2<T> q = measured.position - z.position, v = measured.velocity - z.velocity;
        z.position = z.position + c.position.times(q, v);
        z.velocity = z.velocity + c.velocity.times(q, v);
        state.acceleration = state.acceleration + c.acceleration.times(q, v);
    }

    static void predict(State& state, const Coefficients& c) {
        const auto delay = static_cast<std::size_t>(c.delay);
        const Vec2<T> acts = (delay == 0 ? state.force : state.under[delay - 1]) + state.acceleration;
        for (std::size_t i = delay; i-- > 0;) {
            state.under[i] = i == 0 ? state.force : state.under[i - 1];
        }
        const Motion<T> z = state.motion;
        state.motion = {.position = z.position + (c.map[0] * z.position + c.map[1] * z.velocity + c.push[0] * acts),
                        .velocity = z.velocity + (c.map[2] * z.position + c.map[3] * z.velocity + c.push[1] * acts)};
    }
};

// A controller behind the filter.
template <Resumable Controller, bool velocity_measured>
struct Filtered {
    using Value = typename Controller::Value;
    using T = Value;
    using Params = typename Controller::Params;
    using Report = typename Controller::Report;
    using Filter = MotionFilter<T, velocity_measured>;
    static constexpr bool measures_velocity = velocity_measured;

    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Filter::Coefficients filter{};
    };
    struct State {
        typename Controller::State controller{};
        typename Filter::State filter{};
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.controller = Controller::prepare(p, common), .filter = Filter::prepare(common)};
    }
    static bool sound(const State& state, const Coefficients& c) {
        return Controller::sound(state.controller, c.controller) && Filter::sound(state.filter);
    }
    static Report report(const State& state, const Coefficients& c) {
        return Controller::report(state.controller, c.controller);
    }
    static std::uint64_t steps(const State& state) { return Controller::steps(state.controller); }
    static void start_over(State& state, bool keep_estimates) {
        Controller::start_over(state.controller, keep_estimates);
        Filter::start_over(state.filter, keep_estimates);
    }
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        return Filter::step(state.filter, c.filter, measured, missing != nullptr, [&](const Motion<T>& seen) {
            return Controller::step(state.controller, c.controller, seen, missing);
        });
    }
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force) {
        Filter::acted(state.filter, c.filter, force);
        if constexpr (KnowsForce<Controller>) {
            Controller::acted(state.controller, c.controller, force);
        }
    }
};

// True for controllers that take motions as they are: for positions only they would be behind the observer. The others
// estimate the motion themselves, and a filter before them would contradict their models.
template <Resumable Controller>
inline constexpr bool takes_filter = std::is_same_v<typename FromPositions<Controller>::Type, Observing<Controller>>;

// The controller for the sensors of a device: behind the filter, behind the observer, or neither.
template <Resumable Controller, bool positions_only, bool filtered>
struct ForSensors {
    using Type = Controller;
};
template <Resumable Controller>
struct ForSensors<Controller, true, false> {
    using Type = typename FromPositions<Controller>::Type;
};
template <Resumable Controller>
    requires(!takes_filter<Controller>)
struct ForSensors<Controller, true, true> {
    using Type = typename FromPositions<Controller>::Type;
};
template <Resumable Controller, bool positions_only>
    requires takes_filter<Controller>
struct ForSensors<Controller, positions_only, true> {
    using Type = Filtered<Controller, !positions_only>;
};

// Calls visit.template operator()<C>() with that type.
template <Resumable Controller, class Visit>
void for_sensors(const Common& common, Visit&& visit) {
    const bool positions_only = common.observer_bandwidth > 0.0;
    if constexpr (takes_filter<Controller>) {
        if (common.filter.on()) {
            if (positions_only) {
                visit.template operator()<typename ForSensors<Controller, true, true>::Type>();
            } else {
                visit.template operator()<typename ForSensors<Controller, false, true>::Type>();
            }
            return;
        }
    }
    if (positions_only) {
        visit.template operator()<typename ForSensors<Controller, true, false>::Type>();
    } else {
        visit.template operator()<Controller>();
    }
}

}  // namespace fracgyro
