// The gyroscope with a moving rate or a non-ideal device, and runs with it: slower, and only in double precision.
// Without any of these effects its samples are those of loop.hpp, bit for bit.
#pragma once

#include "fracgyro/plant/imperfections.hpp"
#include "fracgyro/sim/recorder.hpp"
#include "fracgyro/plant/varying_gyroscope.hpp"

namespace fracgyro {

// One run, possibly with a moving rate and a non-ideal device.
template <class Params>
struct DeviceSetupOf : SetupOf<Params> {
    AngularRateParams rate{};
    ImperfectionParams device{};
};
using DeviceSetup = DeviceSetupOf<ControllerParams>;

template <class Params>
bool plant_varies(const DeviceSetupOf<Params>& s) {
    const ImperfectionParams& d = s.device;
    return s.rate.kind != AngularRateKind::constant || d.rate_wanders() || d.stiffness_drift != 0.0 ||
           d.damping_drift != 0.0 || d.cubic_stiffness.x() != 0.0 || d.cubic_stiffness.y() != 0.0;
}

template <class Params>
bool is_ideal(const DeviceSetupOf<Params>& s) {
    const ImperfectionParams& d = s.device;
    return !plant_varies(s) && !(d.position_noise > 0.0) && !(d.velocity_noise > 0.0) && !d.flickers() &&
           !d.position.on() && !d.velocity.on() && !d.actuator().on() && !d.pickoff.on() && !d.force.on() &&
           d.delay == 0 && s.common.observer_bandwidth == 0.0 && !s.common.filter.on() && !s.common.trigger.on();
}

// A Snapshot of such a run; position, velocity and error are the true ones, `signals.force` is the requested force.
template <class Report>
struct DeviceSnapshot : Snapshot<double, Report> {
    double rate;                     // Ωz, after a jump
    double rate_bias;                // additional effective Ωz due to errors of the device, over the step from here on
    double stiffness_drift;          // relative growth of K
    double damping_drift;            // relative growth of D
    const Motion<double>& measured;  // the motion as seen by the controller
    const Vec2<double>& applied;     // the force that acts
};

// 6  The gyroscope with the interface of IdealGyroscope (stepper.hpp).
struct DeviceGyroscope {
    struct Coefficients {
        Gyroscope<double>::Coefficients plant{};
        VaryingGyroscope::Coefficients varying{};
        bool varies = false;
        double mean_rate = 0.0;
        AngularRate rate{{}, 0.0, 1.0, 0};
        Imperfections::Coefficients device{};

        // Temperature change in kelvin, `halves` half steps after sample n.
        double warmer(std::int64_t n, int halves) const { return device.device.temperature.within(n, halves); }
        // The variation with Ωz larger by `bias`.
        Variation varied(std::int64_t n, int halves, double bias) const {
            const double by = warmer(n, halves);
            return {.rate = rate.within(n, halves) - mean_rate + bias,
                    .stiffness = device.device.stiffness_drift * by,
                    .damping = device.device.damping_drift * by};
        }
    };
    struct Drawn {
        Vec2<double> disturbance;
        DeviceDraw device;
    };
    // All noise drawn in a run.
    class Draw {
    public:
        template <class Params>
        explicit Draw(const DeviceSetupOf<Params>& s)
            : disturbance_(s.disturbance, s.common.step), noise_(s.device, s.disturbance.seed, s.common.step) {}
        Drawn operator()(std::int64_t n) { return {disturbance_(n), noise_(n)}; }

    private:
        Disturbance disturbance_;
        DeviceNoise noise_;
    };
    struct State {
        Motion<double> motion{}, measured{};
        Vec2<double> disturbance{}, applied{};
        Imperfections::State device{};
    };

    template <class Params>
    static Coefficients prepare(const DeviceSetupOf<Params>& s) {
        const double step = s.common.step;
        return {.plant = Gyroscope<double>::prepare(s.plant, step),
                .varying = VaryingGyroscope::prepare({s.plant, s.device.cubic_stiffness, s.rate.inertial}, step),
                .varies = plant_varies(s),
                .mean_rate = s.plant.rate,
                .rate = AngularRate(s.rate, s.plant.rate, step, s.steps),
                .device = Imperfections::prepare(s.device)};
    }
    template <class Params>
    static State start(const DeviceSetupOf<Params>& s) {
        State state{};
        state.motion = Gyroscope<double>::start(s.plant);
        return state;
    }
    static const Motion<double>& sense(State& state, const Coefficients& c, const Drawn& drawn) {
        state.disturbance = drawn.disturbance;
        state.measured = Imperfections::sense(state.device, c.device, state.motion, drawn.device);
        return state.measured;
    }
    template <class C, class Report>
    static void actuate(State& state, const Coefficients& c, Signals<double, Report>& signals, std::int64_t n) {
        if constexpr (!measures_velocity<C>) {
            state.measured.velocity = signals.reference.velocity + signals.error.derivative;  // the observer's
        }
        signals.error = tracking_error(state.motion, signals.reference);
        act(state, c, signals.force, n);
    }
    static void act(State& state, const Coefficients& c, const Vec2<double>& asked, std::int64_t n) {
        state.applied = Imperfections::actuate(state.device, c.device, asked, n);
    }
    // Advances by one step under the acting force.
    static void step(State& state, const Coefficients& c, std::int64_t n) {
        if (!c.varies) {
            Gyroscope<double>::step(state.motion, c.plant, state.applied, state.disturbance);
            return;
        }
        VaryingGyroscope::Course course{.rate_before = c.rate.before(n) - c.mean_rate + state.device.bias_before};
        for (int halves = 0; halves < 3; ++halves) {
            course.at[static_cast<std::size_t>(halves)] = c.varied(n, halves, state.device.bias);
        }
        VaryingGyroscope::step(state.motion, c.varying, state.applied, state.disturbance, course);
    }
    template <class Report>
    static void step(State& state, const Coefficients& c, const Signals<double, Report>&, std::int64_t n) {
        step(state, c, n);
    }
    template <class LoopState, class Report>
    static DeviceSnapshot<Report> snapshot(const LoopState& state, const Coefficients& c,
                                           const Signals<double, Report>& signals) {
        const double warmer = c.warmer(state.step, 0);
        return {{.step = state.step, .motion = state.motion, .signals = signals, .disturbance = state.disturbance},
                c.rate.at(state.step),
                state.device.bias,
                c.device.device.stiffness_drift * warmer,
                c.device.device.damping_drift * warmer,
                state.measured,
                state.applied};
    }
};

// Channels recorded for these runs after the channels of recorder.hpp.
inline constexpr std::array<Channel, 7> device_channels{
    {{"angular_rate", 1, "omega0", "angular rate Omega_z", ""},
     {"rate_bias", 1, "omega0", "what acts as if Omega_z were larger by it", ""},
     {"stiffness_drift", 1, "1", "what the stiffness has grown by, as a fraction", ""},
     {"damping_drift", 1, "1", "what the damping has grown by, as a fraction", ""},
     {"measured_position", 2, "q0", "position as the controller has it"},
     {"measured_velocity", 2, "q0*omega0", "velocity as the controller has it, measured or observed"},
     {"applied_control", 2, "m*omega0^2*q0", "force that the actuator gives for u"}}};
inline constexpr std::size_t device_width = 10;

template <class Report>
std::array<double, device_width> device_row(const DeviceSnapshot<Report>& at) {
    const Motion<double>& m = at.measured;
    return {at.rate,        at.rate_bias,   at.stiffness_drift, at.damping_drift, m.position.x(),
            m.position.y(), m.velocity.x(), m.velocity.y(),     at.applied.x(),   at.applied.y()};
}
template <class Report>
void write_device_row(const DeviceSnapshot<Report>& at, double* row) {
    write_row<double, Report>(at, row);
    const auto more = device_row(at);
    std::copy(more.begin(), more.end(), row + row_width<Report>);
}

// Calls observe(DeviceSnapshot) at every sample, like run_loop.
template <Controller C, class Params, class Observe>
std::int64_t run_device_loop(const DeviceSetupOf<Params>& setup, Observe&& observe) {
    using Loop = Stepper<C, DeviceGyroscope>;
    const auto coefficients = Loop::prepare(setup);
    auto state = Loop::begin(setup);
    Loop::run(state, coefficients, setup.steps + 1, DeviceGyroscope::Draw(setup), observe);
    return state.step;
}

}  // namespace fracgyro
