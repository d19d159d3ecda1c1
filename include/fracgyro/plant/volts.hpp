// A device in volts: electrodes, driver, pick-offs and amplifiers around the gyroscope.
//
//    driver      the controller's force u becomes v = Q(u/G) volts, in steps of a converter within its range, with the
//                G that a designer knows
//    electrodes  make the force: its linear part acts as u does, the rest as kicks (kicked_gyroscope.hpp)
//    pick-offs   read p(q), amplifiers and sampling follow (readout.hpp)
//
// `plant` of a run has the springs at bias: K less the softening of the electrodes.
#pragma once

#include "fracgyro/plant/common_mode.hpp"
#include "fracgyro/plant/electronics.hpp"
#include "fracgyro/plant/imperfections.hpp"

namespace fracgyro {

struct VoltsParams {
    ElectronicsParams electronics{};
    std::vector<ElectrodeParams> electrodes{};
    CommonModeParams common{};
    double mass = 1.0, length = 1.0, rate = 1.0;  // units, in SI
    bool present = false;
    bool tuned = false, nulled = false;  // a trim sets the voltages of tuning, of quadrature

    ElectrodeScales scales() const { return {.force = mass * rate * rate * length, .length = length}; }
};

// Electrodes about the mass at rest and at bias. Nondimensional but for volts and charges.
struct AtBias {
    Sym2<double> softening{};             // true
    Sym2<double> gain{}, true_gain{};     // force per volt, as designed and true
    Sym2<double> charge{};                // C/m that a pick-off gives, as designed
    Vec2<double> capacitance{}, noise{};  // pick-offs, F; position, m/√Hz
    bool drives = false, reads = false;
};

inline Sym2<double> outer(const Vec2<double>& n, double weight) {
    return {weight * n.x() * n.x(), weight * n.x() * n.y(), weight * n.y() * n.y()};
}
inline Sym2<double> inverse(const Sym2<double>& a) {
    const double per = 1.0 / (a.xx() * a.yy() - a.xy() * a.xy());
    return {per * a.yy(), -(per * a.xy()), per * a.xx()};
}

// A carrier's voltage is on a pick-off together with its bias.
inline double pickoff_voltage(const ElectronicsParams& e, const ElectrodeParams& p) {
    return e.carrier_frequency > 0.0 ? e.carrier_voltage : absolute(p.bias);
}
inline double acting_bias(const ElectronicsParams& e, const ElectrodeParams& p) {
    const bool modulated = p.role == ElectrodeRole::pickoff && e.carrier_frequency > 0.0;
    return modulated ? square_root(p.bias * p.bias + e.carrier_voltage * e.carrier_voltage) : p.bias;
}

// `stiffness`: of the plant at bias, for the resonance at which a biased amplifier is read.
inline AtBias at_bias(const VoltsParams& p, const Vec2<double>& stiffness = {1.0, 1.0}) {
    AtBias found;
    for (const ElectrodeParams& each : p.electrodes) {
        Electrode truth(each, p.scales(), false);
        const Electrode known(each, p.scales(), true);
        truth.set_bias(acting_bias(p.electronics, each));
        found.softening = found.softening + truth.softening();
        if (each.role == ElectrodeRole::force) {
            found.drives = true;
            found.gain = found.gain + outer(known.direction(), known.gain());
            found.true_gain = found.true_gain + outer(truth.direction(), truth.gain());
        } else if (each.role == ElectrodeRole::pickoff) {
            found.reads = true;
            const double slope = pickoff_voltage(p.electronics, each) * known.slope(each.gap);
            found.charge = found.charge + outer(known.direction(), slope);
            const Vec2<double> n = known.direction();
            found.capacitance = found.capacitance + known.capacitance() * (n * n);
        }
    }
    if (found.reads && p.electronics.amplifier != AmplifierKind::ideal) {
        const Vec2<double> c = found.charge.diagonal, of = found.capacitance;
        const double omega = p.rate;
        found.noise = {position_noise_density(p.electronics, c.x(), of.x(), omega * square_root(stiffness.x())),
                       position_noise_density(p.electronics, c.y(), of.y(), omega * square_root(stiffness.y()))};
    }
    return found;
}

// All that a device in volts draws: the acceleration of its frame, and white noise, with a deviation for each axis. The
// noise of the amplifiers takes the place of the position's, that of the drivers adds to their voltages.
class VoltsNoise {
public:
    VoltsNoise(const VoltsParams& p, const GyroscopeParams& plant, std::uint64_t seed, double step) : on_(p.present) {
        if (on_) {
            const Vec2<double> density = at_bias(p, plant.stiffness.diagonal).noise;
            deviation_ = (square_root(0.5 * p.rate / step) / p.length) * density;
            const bool noisy = density.x() > 0.0 || density.y() > 0.0;
            amplifier_ = Disturbance(white(noisy ? 1.0 : 0.0, seed, 1), step);
            jitter_ = Disturbance(white(p.electronics.jitter * p.rate, seed, 7), step);
            const Vec2<double> drive = drive_noise(p);
            drive_deviation_ = square_root(0.5 * p.rate / step) * drive;
            drive_ = Disturbance(white(drive.x() > 0.0 || drive.y() > 0.0 ? 1.0 : 0.0, seed, 8), step);
            DisturbanceParams acceleration = p.common.acceleration;
            acceleration.seed = seed;
            acceleration_ = Disturbance(acceleration, step);
            carrier_ = Disturbance(white(p.electronics.carrier_flicker > 0.0 ? 1.0 : 0.0, seed, 9), step);
        }
    }
    bool on() const { return on_; }
    Vec2<double> amplifier(std::int64_t n) { return deviation_ * amplifier_(n); }
    Vec2<double> jitter(std::int64_t n) { return jitter_(n); }
    Vec2<double> drive(std::int64_t n) { return drive_deviation_ * drive_(n); }  // V
    Vec2<double> acceleration(std::int64_t n) { return acceleration_(n); }       // -a
    double carrier(std::int64_t n) { return carrier_(n).x(); }                   // white, before its filter

private:
    // V/√Hz of the drivers of x and y.
    static Vec2<double> drive_noise(const VoltsParams& p) {
        Vec2<double> found{};
        for (const ElectrodeParams& each : p.electrodes) {
            if (each.role == ElectrodeRole::force) {
                const Vec2<double> n = Electrode(each, p.scales(), true).direction();
                found = {n.x() != 0.0 ? each.noise : found.x(), n.y() != 0.0 ? each.noise : found.y()};
            }
        }
        return found;
    }
    static DisturbanceParams white(double standard_deviation, std::uint64_t seed, std::uint32_t stream) {
        return {.kind = standard_deviation > 0.0 ? DisturbanceKind::noise : DisturbanceKind::none,
                .standard_deviation = standard_deviation,
                .seed = seed,
                .stream = stream};
    }

    bool on_;
    Vec2<double> deviation_{};
    Vec2<double> drive_deviation_{};
    Disturbance amplifier_{{}, 1.0}, jitter_{{}, 1.0}, drive_{{}, 1.0}, acceleration_{{}, 1.0}, carrier_{{}, 1.0};
};

struct Volts {
    struct Coefficients {
        std::vector<Electrode> electrodes{}, pickoffs{};
        std::vector<Vec2<double>> weights{};  // reading of each pick-off times this is its part of p(q)
        std::array<double, 2> per_gap{};      // X per length at the force electrode of each axis
        Sym2<double> volts_per_force{}, force_per_volt{}, known_gain{}, softening{};
        Vec2<double> resting{};  // force at q = 0 and at bias, which is held
        std::array<Quantizer, 2> converters{};
        Readout::Coefficients readout{};
        CommonMode::Coefficients common{};
        double half = 0.0, late = 0.0;  // half a step; delay of an update
        double carrier_flicker = 0.0;
        bool on = false, drives = false, trimmed = false, acts = false, reads = false, linearized = false;
        bool converts = false;  // the acting force differs from the request, and is known
    };
    struct State {
        Readout::State readout{};
        Voltages volts{}, volts_before{};  // in this step, in the one before
        Vec2<double> noise{};              // drivers, V
        Vec2<double> acceleration{};       // -a over the step
        CommonMode::State common{};
        Flicker::State<double> carrier{};
        Vec2<double> bent{};       // p(q) - q
        Vec2<double> code{};       // the force that the last code is meant to be
        std::int64_t touched = 0;  // 1 + place of the electrode that the mass touches
    };

    static Coefficients prepare(const VoltsParams& p, const GyroscopeParams& plant, double step) {
        Coefficients c;
        c.on = p.present;
        if (!c.on) {
            return c;
        }
        const AtBias at = at_bias(p);
        c.half = 0.5 * step;
        c.late = p.electronics.update_delay * p.rate;
        c.drives = at.drives;
        c.reads = at.reads;
        c.trimmed = p.tuned || p.nulled;
        c.linearized = p.electronics.linearized;
        c.carrier_flicker = p.electronics.carrier_flicker;
        c.softening = at.softening;
        if (c.drives) {
            c.volts_per_force = inverse(at.gain);
            c.known_gain = at.gain;
            c.force_per_volt = at.true_gain;
        }
        const Vec2<double> known = at.charge.diagonal;
        for (const ElectrodeParams& each : p.electrodes) {
            c.electrodes.emplace_back(each, p.scales(), false);
            Electrode& made = c.electrodes.back();
            made.set_bias(acting_bias(p.electronics, each));
            c.resting = c.resting + made.force({}, {});
            const bool moves = each.role == ElectrodeRole::tuning ? p.tuned : p.nulled;
            if (moves && (each.role == ElectrodeRole::tuning || each.role == ElectrodeRole::quadrature)) {
                made.follow_trim();
            }
            c.acts = c.acts || c.trimmed || made.bias() != 0.0 || each.role == ElectrodeRole::force;
            const Vec2<double> n = made.direction();
            if (each.role == ElectrodeRole::pickoff) {
                const double charge = pickoff_voltage(p.electronics, each) * made.slope(each.gap);
                c.pickoffs.push_back(made);
                c.weights.push_back(at.charge.xy() == 0.0 ? shares(known, charge * n)
                                                          : inverse(at.charge) * (charge * n));
            } else if (each.role == ElectrodeRole::force) {
                for (std::size_t axis = 0; axis < 2; ++axis) {
                    if ((axis == 0 ? n.x() : n.y()) != 0.0) {
                        c.converters[axis] = {.range = {each.range, each.range}, .bits = each.bits};
                        c.converts = c.converts || c.converters[axis].on();
                        c.per_gap[axis] = each.kind == ElectrodeKind::plate && each.pair ? made.per_length() : 0.0;
                    }
                }
            }
        }
        ReadoutParams readout = readout_of(p, at);
        const Sym2<double> springs = plant.stiffness + plant.stiffness_deviation;
        const SineCosine<double> lag = sine_cosine<double>(phase_of(p.electronics.feedthrough_lag));
        const Vec2<double> resonance{square_root(maximum(springs.xx(), 1e-12)),
                                     square_root(maximum(springs.yy(), 1e-12))};
        readout.leak = resonance.x() * lag.sine / lag.cosine;
        if (p.electronics.amplifier == AmplifierKind::transimpedance) {
            readout.high_pass = readout.pole;
            readout.gain = {readout.pole.x() / resonance.x(), readout.pole.y() / resonance.y()};
            readout.pole = {ReadoutParams::off, ReadoutParams::off};
        }
        c.readout = Readout::prepare(readout, plant, step);
        c.common = CommonMode::prepare(p.common, step);
        return c;
    }

    static State start(const Coefficients& c, const Motion<double>& at) {
        State state;
        if (c.on) {
            state.bent = bend(c, at.position, {});
            state.readout = Readout::start(c.readout, at, state.bent);
        }
        return state;
    }

    // The sample, with the noise drawn for it.
    static Vec2<double> sample(State& state, const Coefficients& c, double carrier, const Vec2<double>& jitter,
                               const Vec2<double>& velocity) {
        const Vec2<double> reading = state.readout.reading + jitter * velocity;
        return c.carrier_flicker > 0.0 ? (1.0 + c.carrier_flicker * Flicker::next(state.carrier, carrier)) * reading
                                       : reading;
    }

    // The force that acts linearly for the force asked for, which sets the voltages. `measured`: the position known.
    static Vec2<double> drive(State& state, const Coefficients& c, const Vec2<double>& asked,
                              const Vec2<double>& measured) {
        state.volts.drive = volts(c, asked, grown(c, measured)) + state.noise;
        return c.force_per_volt * state.volts.drive;
    }
    // The force that a designer knows the code for this force to mean.
    static Vec2<double> meant(const Coefficients& c, const Vec2<double>& asked, const Vec2<double>& measured) {
        const Vec2<double> more = grown(c, measured);
        return c.known_gain * (more * volts(c, asked, more));
    }

    // Force of the electrodes beyond `resting` and their linear part, with the common mode at `shift`: that of the gaps
    // which it leaves, less what pulls the masses all alike.
    static Vec2<double> rest(const Coefficients& c, const Vec2<double>& q, const Voltages& volts,
                             const Vec2<double>& shift) {
        Vec2<double> force{};
        if (c.common.on) {
            Voltages undriven = volts;
            undriven.drive = {};
            for (const Electrode& each : c.electrodes) {
                force =
                    force + (each.force(q + shift, volts) - (each.force(shift, undriven) - each.force({}, undriven)));
            }
        } else {
            for (const Electrode& each : c.electrodes) {
                force = force + each.force(q, volts);
            }
        }
        return force - (c.resting + (c.softening * q + c.force_per_volt * volts.drive));
    }
    // Softening of the springs that a trim has added.
    static Sym2<double> trimmed(const Coefficients& c, const Voltages& volts) {
        Sym2<double> now{};
        for (const Electrode& each : c.electrodes) {
            now = now + each.softening(volts);
        }
        return now - c.softening;
    }

    // After the step of the mass from `from`, with a kick, to `to`.
    static void finish(State& state, const Coefficients& c, const Motion<double>& from, Motion<double>& to,
                       const Vec2<double>& force, const Vec2<double>& disturbance) {
        for (std::size_t place = 0; place < c.electrodes.size(); ++place) {
            if (state.touched == 0 && c.electrodes[place].touches(to.position + state.common.position)) {
                state.touched = static_cast<std::int64_t>(place) + 1;
                constexpr double beyond = std::numeric_limits<double>::infinity();
                to.position = {beyond, beyond};  // ends the run
                return;
            }
        }
        const Vec2<double> bends = bend(c, to.position, state.common.position);
        if (c.readout.on) {
            Readout::step(state.readout, c.readout, from, to, force, disturbance, state.bent, bends);
        } else {
            state.readout.reading = to.position + bends;
        }
        state.bent = bends;
    }

private:
    static Vec2<double> volts(const Coefficients& c, const Vec2<double>& asked, const Vec2<double>& grown) {
        const Vec2<double> wanted = c.volts_per_force * asked;
        const Vec2<double> v{wanted.x() / grown.x(), wanted.y() / grown.y()};
        return {c.converters[0](v).x(), c.converters[1](v).y()};
    }
    // Force per volt of each axis at the measured position over that at rest, if the driver knows.
    static Vec2<double> grown(const Coefficients& c, const Vec2<double>& measured) {
        if (!c.linearized) {
            return {1.0, 1.0};
        }
        return {growth(c.per_gap[0] * measured.x()), growth(c.per_gap[1] * measured.y())};
    }
    // p(q) - q
    static Vec2<double> bend(const Coefficients& c, const Vec2<double>& q, const Vec2<double>& shift) {
        if (!c.reads) {
            return {};
        }
        Vec2<double> read{};
        for (std::size_t place = 0; place < c.pickoffs.size(); ++place) {
            const Electrode& each = c.pickoffs[place];
            const double reading = c.common.on ? each.reading(q + shift) - each.reading(shift) : each.reading(q);
            read = read + reading * c.weights[place];
        }
        return read - q;
    }
    static Vec2<double> shares(const Vec2<double>& known, const Vec2<double>& charge) {
        return {known.x() > 0.0 ? charge.x() / known.x() : 0.0, known.y() > 0.0 ? charge.y() / known.y() : 0.0};
    }
    // Force per volt of a pair of plates at X over that at rest.
    static double growth(double x) {
        const double square = x * x, d = 1.0 / (1.0 - square);
        return (1.0 + square) * (d * d);
    }
    static ReadoutParams readout_of(const VoltsParams& p, const AtBias& at) {
        constexpr double turn = 6.28318530717958647693;
        const ElectronicsParams& e = p.electronics;
        ReadoutParams made{.pole = (turn / p.rate) * e.pole,
                           .sample_delay = e.sample_delay * p.rate,
                           .update_delay = e.update_delay * p.rate,
                           .aperture = e.aperture * p.rate};
        if (e.amplifier == AmplifierKind::charge && e.feedback_capacitance > 0.0) {
            const double corner = 1.0 / (e.feedback_resistance * e.feedback_capacitance * p.rate);
            made.high_pass = {corner, corner};
        }
        if (at.drives && at.reads) {
            const Vec2<double> charge = p.length * at.charge.diagonal;
            const Sym2<double> volts = inverse(at.true_gain);
            const auto& f = e.feedthrough;
            const Vec2<double> to_x = volts * Vec2<double>{f[0], f[1]}, to_y = volts * Vec2<double>{f[2], f[3]};
            made.feedthrough = {.first = {to_x.x() / charge.x(), to_y.x() / charge.y()},
                                .second = {to_x.y() / charge.x(), to_y.y() / charge.y()}};
        }
        return made;
    }
};

}  // namespace fracgyro
