// Fault-tolerant wrapper of a controller, for hardware: whatever the sensors deliver, step() returns a finite force
// within the limit, in bounded time, and recovers when they deliver motion again. The force is only as right as the
// accepted samples (plausibility.hpp).
//
//    Without a sample the last force is held, the estimates pause, and the last error is assumed, so that the reference
//    and the fractional memory stay in time. Before the first good sample the force is 0 and time does not start.
//
//    If no sample is accepted for long, the memory of motions is dropped, the estimates are kept, and the force is that
//    of a motion on the reference. After `saturation_patience` samples at the force limit, or if the force is not
//    finite, the estimates are dropped too and the controller starts over with the next sample. Time continues.
#pragma once

#include "fracgyro/control/controller.hpp"
#include "fracgyro/core/saved.hpp"
#include "fracgyro/hardware/plausibility.hpp"

namespace fracgyro {

template <Resumable Controller>
struct Guard {
    using T = typename Controller::Value;
    using Value = T;
    using Params = typename Controller::Params;
    using Report = typename Controller::Report;
    static constexpr bool measures_velocity = fracgyro::measures_velocity<Controller>;
    using Sensed = Plausibility<T, measures_velocity>;

    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Sensed::Coefficients plausibility{};
        std::uint32_t saturation_patience = 0;
    };
    struct State {
        typename Controller::State controller{};
        typename Sensed::State plausibility{};
        Sample<T> error{};  // the last measured error, and the acting force
        Vec2<T> force{};
        Kept<T, std::uint32_t> saturated = 0;  // samples in a row
        Kept<T, bool> going = false;           // there is an error to continue from
        Status status = Status::ok;
    };

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.controller = Controller::prepare(p, common),
                .plausibility = Sensed::prepare(common.guard, common.nominal, common.step),
                .saturation_patience = static_cast<std::uint32_t>(common.guard.saturation_patience)};
    }

    static bool sound(const State& state, const Coefficients& c) {
        return Controller::sound(state.controller, c.controller) && fracgyro::sound(state.plausibility.settled) &&
               fracgyro::sound(state.plausibility.doubted) && fracgyro::sound(state.going) &&
               fracgyro::sound(state.status);
    }

    static Report report(const State& state, const Coefficients& c) {
        return Controller::report(state.controller, c.controller);
    }
    static std::uint64_t steps(const State& state) { return Controller::steps(state.controller); }

    // The force is also state.force; the verdict on the sample is state.status.
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured) {
        using Answer = typename Sensed::Answer;
        const Answer answer =
            Sensed::judge(state.plausibility, c.plausibility, measured, state.force, state.going, state.status);
        const bool accepted = answer == Answer::accepted;
        if (answer == Answer::none) {
            if (steps(state) == 0) {  // time has not started
                return {.report = report(state, c)};
            }
            let_go(state);
        }
        Signals<T, Report> signals =
            Controller::step(state.controller, c.controller, measured, accepted ? nullptr : &state.error);
        bool failed = !(sum(signals.force) + sum(signals.excess) < T(std::numeric_limits<double>::infinity()));
        if (accepted && !failed) {
            state.error = signals.error;
            state.going = true;
            failed = saturates_for_long(state, c, signals);
        }
        if (failed) {
            Controller::start_over(state.controller, false);
            state.going = false;
            state.status = Status::restarted;
        } else if (answer != Answer::missed) {
            state.force = signals.force;
        }
        signals.force = state.force;
        return signals;
    }
    // The force that acts after step() where a converter rounds the one that it gave: for controllers that use it.
    static void acted([[maybe_unused]] State& state, [[maybe_unused]] const Coefficients& c,
                      [[maybe_unused]] const Vec2<T>& force) {
        if constexpr (KnowsForce<Controller>) {
            if (steps(state) > 0 && state.status != Status::restarted) {
                Controller::acted(state.controller, c.controller, force);
            }
        }
    }

private:
    static T sum(const Vec2<T>& a) { return absolute(a.x()) + absolute(a.y()); }

    static void let_go(State& state) {
        if (state.going) {
            Controller::start_over(state.controller, true);
        }
        state.going = false;
        state.error = {};
        state.plausibility.doubted = true;
        state.status = Status::lost;
    }

    static bool saturates_for_long(State& state, const Coefficients& c, const Signals<T, Report>& signals) {
        const bool saturated = T(0.0) < sum(signals.excess);
        if (saturated) {
            state.status = Status::saturated;
        }
        if (c.saturation_patience == 0) {
            return false;
        }
        state.saturated = saturated ? state.saturated + 1 : 0;
        if (state.saturated < c.saturation_patience) {
            return false;
        }
        state.saturated = 0;
        return true;
    }
};

}  // namespace fracgyro
