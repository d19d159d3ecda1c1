// The gyroscope with a dynamic rate or a non-ideal device, and runs with it: slower, and only in double precision.
// Without any of these effects its samples are those of loop.hpp, bit for bit.
#pragma once

#include "fracgyro/hardware/trim.hpp"
#include "fracgyro/plant/imperfections.hpp"
#include "fracgyro/sim/recorder.hpp"
#include "fracgyro/plant/varying_gyroscope.hpp"
#include "fracgyro/plant/volts.hpp"

namespace fracgyro {

// One run, possibly with a dynamic rate and a non-ideal device.
template <class Params>
struct DeviceSetupOf : SetupOf<Params> {
    AngularRateParams rate{};
    ImperfectionParams device{};
    VoltsParams volts{};
    TrimParams trim{};
    std::int64_t* touched = nullptr;  // a run writes here 1 + place of the electrode at which it ended, otherwise 0
};
using DeviceSetup = DeviceSetupOf<ControllerParams>;

// In time or with the velocity.
template <class Params>
bool plant_drifts(const DeviceSetupOf<Params>& s) {
    const ImperfectionParams& d = s.device;
    return s.rate.kind != AngularRateKind::constant || d.rate_wanders() || d.stiffness_drift != 0.0 ||
           d.damping_drift != 0.0 || d.thermal.moves_plant() || s.rate.tilts();
}
template <class Params>
bool plant_varies(const DeviceSetupOf<Params>& s) {
    const Vec2<double>& cubic = s.device.cubic_stiffness;
    return plant_drifts(s) || cubic.x() != 0.0 || cubic.y() != 0.0 || s.device.cubic_coupling.on();
}

template <class Params>
bool is_ideal(const DeviceSetupOf<Params>& s) {
    const ImperfectionParams& d = s.device;
    return !plant_varies(s) && !(d.position_noise > 0.0) && !(d.velocity_noise > 0.0) && !d.flickers() &&
           !d.position.on() && !d.velocity.on() && !d.actuator().on() && !d.pickoff.on() && !d.force.on() &&
           !d.thermal.moves_gains() && d.delay == 0 && !s.volts.present && s.common.observer_bandwidth == 0.0 &&
           !s.common.filter.on() && !s.common.trigger.on() && !s.common.pickoffs.on() &&
           s.common.compensation_bandwidth == 0.0;
}

// A Snapshot of such a run; position, velocity and error are the true ones, `signals.force` is the requested force.
template <class Report>
struct DeviceSnapshot : Snapshot<double, Report> {
    double rate;                     // Ωz, after a jump
    double rate_bias;                // additional effective Ωz due to errors of the device, over the step from here on
    double stiffness_drift;          // relative growth of K
    double damping_drift;            // relative growth of D
    double warmer;                   // change of temperature, K
    const Motion<double>& measured;  // the motion as seen by the controller
    const Vec2<double>& applied;     // the force that acts
    const Voltages* volts;           // nullptr without electrodes
    Sym2<double> softened;           // stiffness that a trim has taken since the start
};

// A trim of these electrodes. `lag`: of readings and forces, in s.
inline TrimParams trim_of(const TrimSettings& s, const VoltsParams& p, double lag) {
    constexpr double turn = 6.28318530717958647693;
    TrimParams made{.split = s.tuning == TrimTuning::split,
                    .quadrature = s.quadrature == TrimQuadrature::null,
                    .interval = s.interval * p.rate,
                    .gain = s.gain,
                    .modulation = s.modulation,
                    .frequency = turn * s.frequency / p.rate,
                    .target = turn * s.target / p.rate,
                    .lag = lag * p.rate};
    for (const ElectrodeParams& each : p.electrodes) {
        if (each.role != ElectrodeRole::tuning && each.role != ElectrodeRole::quadrature) {
            continue;
        }
        Electrode known(each, p.scales(), true);
        known.follow_trim();
        const Sym2<double> none = known.softening(), one = known.softening({.tuning = 1.0, .nulling = 1.0});
        if (each.role == ElectrodeRole::tuning) {
            made.per_square += (one - none).yy();
            made.tuning = each.bias;
            made.most_tuning = minimum(made.most_tuning, each.range);
        } else {
            made.per_volt += (one - none).xy();
            made.nulling = each.nulling;
            made.most_nulling = minimum(made.most_nulling, each.range);
        }
    }
    return made;
}

// 6  The gyroscope with the interface of IdealGyroscope (stepper.hpp).
struct DeviceGyroscope {
    struct Coefficients {
        Gyroscope<double>::Coefficients plant{};
        VaryingGyroscope::Coefficients varying{};
        bool varies = false, drifts = false, warms = false;
        double mean_rate = 0.0;
        AngularRate rate{{}, 0.0, 1.0, 0};
        Imperfections::Coefficients device{};
        Volts::Coefficients volts{};
        Trim<double>::Coefficients trim{};

        // Temperature change in kelvin, `halves` half steps after sample n.
        double warmer(std::int64_t n, int halves) const { return device.device.temperature.within(n, halves); }
        // The variation with Ωz larger by `bias`.
        Variation varied(std::int64_t n, int halves, double bias) const {
            const double by = warmer(n, halves);
            return {.rate = rate.within(n, halves) - mean_rate + bias,
                    .stiffness = device.device.stiffness_drift * by,
                    .damping = device.device.damping_drift * by,
                    .warmer = warms ? by : 0.0,
                    .tilt = rate.tilted(n, halves)};
        }
    };
    struct Drawn {
        Vec2<double> disturbance;
        DeviceDraw device;
        Vec2<double> jitter{}, drive{}, acceleration{};
        double carrier = 0.0;
    };
    // All noise drawn in a run.
    class Draw {
    public:
        template <class Params>
        explicit Draw(const DeviceSetupOf<Params>& s)
            : disturbance_(s.disturbance, s.common.step),
              noise_(s.device, s.disturbance.seed, s.common.step),
              volts_(s.volts, s.plant, s.disturbance.seed, s.common.step) {}
        Drawn operator()(std::int64_t n) {
            Drawn drawn{disturbance_(n), noise_(n)};
            if (volts_.on()) {
                drawn.device.noise.position = drawn.device.noise.position + volts_.amplifier(n);
                drawn.jitter = volts_.jitter(n);
                drawn.drive = volts_.drive(n);
                drawn.acceleration = volts_.acceleration(n);
                drawn.carrier = volts_.carrier(n);
            }
            return drawn;
        }

    private:
        Disturbance disturbance_;
        DeviceNoise noise_;
        VoltsNoise volts_;
    };
    struct State {
        Motion<double> motion{}, measured{};
        Vec2<double> disturbance{}, applied{};
        Imperfections::State device{};
        Volts::State volts{};
        Trim<double>::State trim{};
    };

    template <class Params>
    static Coefficients prepare(const DeviceSetupOf<Params>& s) {
        const double step = s.common.step;
        return {.plant = Gyroscope<double>::prepare(s.plant, step),
                .varying = VaryingGyroscope::prepare({s.plant, s.device.cubic_stiffness, s.rate.inertial,
                                                      s.device.thermal, s.device.cubic_coupling, s.rate.tilts()},
                                                     step),
                .varies = plant_varies(s),
                .drifts = plant_drifts(s),
                .warms = s.device.thermal.moves_plant(),
                .mean_rate = s.plant.rate,
                .rate = AngularRate(s.rate, s.plant.rate, step, s.steps),
                .device = Imperfections::prepare(s.device),
                .volts = Volts::prepare(s.volts, s.plant, step),
                .trim = s.volts.nulled ? Trim<double>::prepare(s.trim, s.common) : Trim<double>::Coefficients{}};
    }
    template <class Params>
    static State start(const DeviceSetupOf<Params>& s) {
        State state{};
        state.motion = Gyroscope<double>::start(s.plant);
        if (s.volts.present) {
            state.volts = Volts::start(Volts::prepare(s.volts, s.plant, s.common.step), state.motion);
            state.trim = Trim<double>::start(s.trim);
            state.volts.volts.tuning = s.trim.tuning;
            state.volts.volts.nulling = s.trim.nulling;
        }
        return state;
    }
    static const Motion<double>& sense(State& state, const Coefficients& c, const Drawn& drawn) {
        state.disturbance = drawn.disturbance;
        Motion<double> seen = state.motion;
        if (c.volts.on) {
            seen.position = Volts::sample(state.volts, c.volts, drawn.carrier, drawn.jitter, seen.velocity);
            state.volts.noise = drawn.drive;
            state.volts.acceleration = drawn.acceleration;
        }
        state.measured = Imperfections::sense(state.device, c.device, seen, drawn.device);
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
        if (c.volts.on) {
            state.volts.volts_before = state.volts.volts;
            state.volts.code = c.volts.drives ? Volts::meant(c.volts, asked, state.measured.position)
                                              : c.device.device.actuator()(asked);
        }
        if (c.volts.trimmed) {
            const auto set = Trim<double>::step(state.trim, c.trim, state.measured.position, state.volts.code);
            state.volts.volts.tuning = set.tuning;
            state.volts.volts.nulling = set.nulling;
            state.volts.volts.share = set.share;
        }
        if (!c.volts.drives) {
            state.applied = Imperfections::actuate(state.device, c.device, asked, n);
            return;
        }
        const Vec2<double> late = Imperfections::late(state.device, c.device, asked, n);
        const Vec2<double> given = Volts::drive(state.volts, c.volts, late, state.measured.position);
        state.applied = Imperfections::give(c.device, given, n);
    }
    // The force to which the converter rounded the last request, for controllers that receive it; otherwise nullptr.
    static const Vec2<double>* code(const State& state, const Coefficients& c) {
        return c.volts.converts ? &state.volts.code : nullptr;
    }
    // Advances by one step under the acting force.
    static void step(State& state, const Coefficients& c, std::int64_t n) {
        if (c.volts.on) {
            step_in_volts(state, c, n);
        } else if (c.varies) {
            VaryingGyroscope::step(state.motion, c.varying, state.applied, state.disturbance, course(state, c, n));
        } else {
            Gyroscope<double>::step(state.motion, c.plant, state.applied, state.disturbance);
        }
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
                warmer,
                state.measured,
                state.applied,
                c.volts.on && !c.volts.electrodes.empty() ? &state.volts.volts : nullptr,
                c.volts.trimmed ? Volts::trimmed(c.volts, state.volts.volts) : Sym2<double>{}};
    }

private:
    static VaryingGyroscope::Course course(const State& state, const Coefficients& c, std::int64_t n) {
        VaryingGyroscope::Course found{.rate_before = c.rate.before(n) - c.mean_rate + state.device.bias_before};
        for (int halves = 0; halves < 3; ++halves) {
            found.at[static_cast<std::size_t>(halves)] = c.varied(n, halves, state.device.bias);
        }
        return found;
    }
    // Forces that depend on the position only are kicks, half a step of them before and after the exact step (Strang,
    // "On the construction and comparison of difference schemes", 1968): an error of h³ a step, and over any number of
    // steps no energy gained or lost, unlike a force that is held from the sample. If the plant also varies in time,
    // they are a part of N in Lawson's method.
    static void step_in_volts(State& state, const Coefficients& c, std::int64_t n) {
        const Volts::Coefficients& v = c.volts;
        Volts::State& volts = state.volts;
        Motion<double> from = state.motion;
        const Vec2<double> held = state.disturbance + v.resting;
        const Vec2<double> shift = volts.common.position;
        if (v.common.on) {
            CommonMode::step(volts.common, v.common, volts.acceleration);
        }
        const Vec2<double>& shifted = volts.common.position;
        if (c.drifts) {
            const Vec2<double> meanwhile = 0.5 * (shift + shifted);
            VaryingGyroscope::step(state.motion, c.varying, state.applied, held, course(state, c, n),
                                   [&](const Vec2<double>& q) { return Volts::rest(v, q, volts.volts, meanwhile); });
        } else if (v.acts || c.varies) {
            // For a time with the voltages before the update, and for the rest of half a step with those after it.
            const auto kick = [&](Motion<double>& at, const Vec2<double>& moved, double before) {
                const Vec2<double>& q = at.position;
                const auto push = [&](const Voltages& volt, double time) {
                    at.velocity =
                        at.velocity + time * (Volts::rest(v, q, volt, moved) + VaryingGyroscope::cubic(c.varying, q));
                };
                if (before > 0.0) {
                    push(volts.volts_before, before);
                }
                if (before < v.half) {
                    push(volts.volts, v.half - before);
                }
            };
            kick(from, shift, minimum(v.late, v.half));
            state.motion = from;
            Gyroscope<double>::step(state.motion, c.plant, state.applied, held);
            kick(state.motion, shifted, maximum(v.late - v.half, 0.0));
        } else {
            Gyroscope<double>::step(state.motion, c.plant, state.applied, held);
        }
        if (v.readout.on) {
            Readout::delay(state.motion, volts.readout, v.readout, state.applied);
        }
        Volts::finish(volts, v, from, state.motion, state.applied, held);
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
// Channels that follow for a device with electrodes.
inline constexpr std::array<Channel, 4> volts_channels{
    {{"drive_voltage", 2, "V", "voltage of the drivers"},
     {"tuning_voltage", 1, "V", "bias of the tuning electrodes", ""},
     {"nulling_voltage", 1, "V", "nulling of the quadrature electrodes, with the tone of a trim", ""},
     {"tone_share", 1, "1",
      "what the tone of a trim changes kxy by over what it was designed to, as last found; if it is not from 1/2 to 2, "
      "y does not answer the tone, and the voltages stay; 0 before the end of the first interval",
      ""}}};
inline constexpr std::size_t volts_width = 5;

template <class Report>
std::array<double, device_width> device_row(const DeviceSnapshot<Report>& at) {
    const Motion<double>& m = at.measured;
    return {at.rate,        at.rate_bias,   at.stiffness_drift, at.damping_drift, m.position.x(),
            m.position.y(), m.velocity.x(), m.velocity.y(),     at.applied.x(),   at.applied.y()};
}
// NaN without electrodes.
inline std::array<double, volts_width> volts_row(const Voltages* volts) {
    constexpr double none = std::numeric_limits<double>::quiet_NaN();
    if (volts == nullptr) {
        return {none, none, none, none, none};
    }
    return {volts->drive.x(), volts->drive.y(), volts->tuning, volts->nulling, volts->share};
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
    if (setup.touched != nullptr) {
        *setup.touched = state.volts.touched;
    }
    return state.step;
}

}  // namespace fracgyro
