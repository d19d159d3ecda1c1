// Known pick-offs: measurements are brought back to the axes of the plant before anything else uses them.
//
// Use it when `fracgyro identify` or a rate table found the ratio of the pick-offs, or their angle.
//
//        q = R(β̂) diag(1/(1 + ĝx), 1/(1 + ĝy)) y
//
//    y is measured along axes turned by β, with gains of 1 + g; the same for the velocity. Observer, filter and law
//    receive q. The guard is in front, and judges y.
//
// Source: docs/decisions/0052.
#pragma once

#include "fracgyro/hardware/compensation.hpp"

namespace fracgyro {

// The correction in the precision of the controller.
template <Scalar T>
struct Pickoffs {
    struct Coefficients {
        AxesMap<T> map{};
        bool on = false;
    };

    static Coefficients prepare(const Common& common) {
        const AxesMap<double> map = seen_from(common.pickoffs);
        return {.map = {cast<T>(map.x), cast<T>(map.y)}, .on = common.pickoffs.on()};
    }
    static Motion<T> correct(const Coefficients& c, const Motion<T>& measured) {
        return {.position = c.map(measured.position), .velocity = c.map(measured.velocity)};
    }
};

// A controller that receives corrected measurements.
template <Resumable Controller>
struct Corrected {
    using Value = typename Controller::Value;
    using T = Value;
    using Params = typename Controller::Params;
    using Report = typename Controller::Report;
    static constexpr bool measures_velocity = fracgyro::measures_velocity<Controller>;

    struct Coefficients {
        typename Controller::Coefficients controller{};
        typename Pickoffs<T>::Coefficients pickoffs{};
    };
    using State = typename Controller::State;

    static Coefficients prepare(const Params& p, const Common& common) {
        return {.controller = Controller::prepare(p, common), .pickoffs = Pickoffs<T>::prepare(common)};
    }
    static bool sound(const State& state, const Coefficients& c) { return Controller::sound(state, c.controller); }
    static Report report(const State& state, const Coefficients& c) { return Controller::report(state, c.controller); }
    static std::uint64_t steps(const State& state) { return Controller::steps(state); }
    static void start_over(State& state, bool keep_estimates) { Controller::start_over(state, keep_estimates); }
    static Signals<T, Report> step(State& state, const Coefficients& c, const Motion<T>& measured,
                                   const Sample<T>* missing = nullptr) {
        if (!c.pickoffs.on) {
            return Controller::step(state, c.controller, measured, missing);
        }
        return Controller::step(state, c.controller, Pickoffs<T>::correct(c.pickoffs, measured), missing);
    }
    static void acted(State& state, const Coefficients& c, const Vec2<T>& force)
        requires KnowsForce<Controller>
    {
        Controller::acted(state, c.controller, force);
    }
};

// The controller for the sensors of a device: with measurements corrected or not, its force sent by events or not, and
// with or without a disturbance observer.
template <Resumable Controller, bool positions_only, bool filtered, bool triggered, bool corrected,
          bool compensated = false>
struct ForDevice {
    using Acting = std::conditional_t<compensated, Compensated<Controller>, Controller>;
    using Sending = std::conditional_t<triggered, Triggered<Acting>, Acting>;
    using Sensing = typename ForSensors<Sending, positions_only, filtered>::Type;
    using Type = std::conditional_t<corrected, Corrected<Sensing>, Sensing>;
};

// Calls visit.template operator()<C>() with that type.
template <Resumable Controller, class Visit>
void for_device(const Common& common, Visit&& visit) {
    const auto corrected = [&]<class Sensing>() {
        if (common.pickoffs.on()) {
            visit.template operator()<Corrected<Sensing>>();
        } else {
            visit.template operator()<Sensing>();
        }
    };
    const auto sent = [&]<class Acting>() {
        if (common.trigger.on()) {
            for_sensors<Triggered<Acting>>(common, corrected);
        } else {
            for_sensors<Acting>(common, corrected);
        }
    };
    if (common.compensation_bandwidth > 0.0) {
        sent.template operator()<Compensated<Controller>>();
    } else {
        sent.template operator()<Controller>();
    }
}

}  // namespace fracgyro
