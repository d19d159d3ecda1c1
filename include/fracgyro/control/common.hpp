// Parameters shared by all controllers of a loop.
#pragma once

#include "fracgyro/control/datasheet.hpp"
#include "fracgyro/control/reference.hpp"
#include "fracgyro/control/signals.hpp"
#include "fracgyro/core/axes.hpp"

namespace fracgyro {

// Parameters of the guard (hardware/guard.hpp).
struct GuardParams {
    bool checked = false;                                       // samples are checked against the nominal plant
    double plant_tolerance = 0.1;                               // relative deviation of the plant from the nominal one
    double force_tolerance = 0.0;                               // maximum disturbance, per axis
    double position_tolerance = 0.0, velocity_tolerance = 0.0;  // maximum sensor errors, per axis
    double patience = 0.0, saturation_patience = 0.0;           // samples; 0: no limit

    static constexpr std::string_view switches[] = {"false", "true"};
    static constexpr auto fields() {
        using P = GuardParams;
        constexpr Range samples{.low = 0.0, .high = 1e9, .whole = true};
        return Fields{
            choice("checked", &P::checked, switches,
                   "Samples are refused that the plant cannot have moved to since the last one, and those that are not "
                   "finite. The fields below say what it can; not set, they follow from the other tables. false: off."),
            field("plant_tolerance", &P::plant_tolerance, "1", at_least_0,
                  "Share by which stiffness, actuator and the sensors' scales may be other than nominal."),
            field("force_tolerance", &P::force_tolerance, "m*omega0^2*q0", at_least_0,
                  "Unit of force: largest disturbance on one axis."),
            field("position_tolerance", &P::position_tolerance, "q0", at_least_0,
                  "Unit q0: the sensor's largest error on one axis."),
            field("velocity_tolerance", &P::velocity_tolerance, "q0*omega0", at_least_0,
                  "Unit q0 omega0: the same of the velocity."),
            field("patience", &P::patience, "1", samples,
                  "Samples: after this many rejected in a row the force is only feedforward, and no sample is "
                  "accepted until four times as many agree. 0: off, the last force is held."),
            field("saturation_patience", &P::saturation_patience, "1", samples,
                  "Samples: after this many in a row at the force limit all estimates are reset.  0: off."),
        };
    }
};

// Parameters of the filter between sensors and controller (hardware/motion_filter.hpp).
struct FilterParams {
    double bandwidth = 0.0;  // at which the missing acceleration is estimated; 0: no filter
    Datasheet assumed{};

    bool on() const { return bandwidth > 0.0; }
};

// Parameters of the event trigger (hardware/trigger.hpp).
struct TriggerParams {
    double threshold = 0.0;  // a, of force
    double share = 0.0;      // b, of the force that acts

    bool on() const { return threshold > 0.0 || share > 0.0; }
};

// Nondimensional.
struct Common {
    double step = 1e-3;
    ReferenceParams reference{};
    PlantModel<double> nominal{};                                  // plant model assumed beforehand
    double force_limit = std::numeric_limits<double>::infinity();  // |u| on each axis; infinity: off
    GuardParams guard{};
    double observer_bandwidth = 0.0;  // bandwidth of the observer (hardware/observer.hpp); 0: the velocity is measured
    FilterParams filter{};
    TriggerParams trigger{};
    double compensation_bandwidth = 0.0;  // bandwidth of the disturbance observer (hardware/compensation.hpp); 0: off
    AxesParams pickoffs{};                // known errors, by which measurements are corrected (hardware/pickoffs.hpp)

    static constexpr auto fields() {
        using C = Common;
        return Fields{
            Inner{"reference", &C::reference},
            Inner{"adaptation", &C::nominal},
            field("force_limit", &C::force_limit, "m*omega0^2*q0", limit,
                  "Largest |u| per axis, unit m omega0^2 q0, > 0. inf: off."),
            Inner{"guard", &C::guard},
        };
    }
};

}  // namespace fracgyro
