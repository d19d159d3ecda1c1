// Imperfections of sensors and actuators in a device: each effect is off by default.
//
//    sensing     the motion along the axes of the pick-offs, times their gain, plus noise, in steps of a converter;
//                without a sensor of velocity see observer.hpp
//    actuation   the force, `delay` steps late, within the actuator's limit, in steps of its converter, times its gain,
//                along the axes of the actuators
//    the rate    errors that act on the mass like an additional Ωz: flicker noise and a random walk
//    the springs and dampers may drift with temperature, and springs stiffen with amplitude: varying_gyroscope.hpp
//
// Noise is drawn like the disturbance, from separate streams of the same seed.
#pragma once

#include "fracgyro/core/axes.hpp"
#include "fracgyro/plant/angular_rate.hpp"
#include "fracgyro/plant/flicker.hpp"

namespace fracgyro {

// A two's complement converter of 2^bits levels, `step` = 2 range/2^bits apart: -range, …, range - step. It clips
// beyond them. Without bits it only clips, at ±range.
struct Quantizer {
    static constexpr double unlimited = std::numeric_limits<double>::infinity();
    Vec2<double> range{unlimited, unlimited};  // per axis
    int bits = 0;

    Vec2<double> operator()(const Vec2<double>& a) const { return {one(a.x(), range.x()), one(a.y(), range.y())}; }
    bool on() const { return bits != 0 || range.x() < unlimited || range.y() < unlimited; }

private:
    double one(double a, double reach) const {
        const double clipped = clamp(a, -reach, reach);
        if (bits == 0 || !(reach < unlimited)) {
            return clipped;
        }
        const double levels = static_cast<double>(std::int64_t{1} << (bits - 1));
        const double step = reach / levels;
        return step * clamp(detail::round_to_nearest(clipped / step), -levels, levels - 1.0);
    }
};

// Changes per kelvin, in addition to the common ones of springs and dampers.
struct ThermalParams {
    Vec2<double> spring{}, damper{};            // k_xx and k_yy, d_xx and d_yy, as fractions
    double quadrature = 0.0;                    // k_xy, over the root of k_xx k_yy
    double damping_axis = 0.0;                  // rad, from x towards y
    Vec2<double> pickoff_gain{}, force_gain{};  // fractions

    bool moves_plant() const {
        const Vec2<double> sizes = absolute(spring) + absolute(damper);
        return sizes.x() + sizes.y() + absolute(quadrature) + absolute(damping_axis) > 0.0;
    }
    bool moves_gains() const {
        const Vec2<double> sizes = absolute(pickoff_gain) + absolute(force_gain);
        return sizes.x() + sizes.y() > 0.0;
    }
};

struct ImperfectionParams {
    double position_noise = 0.0, velocity_noise = 0.0;      // standard deviations, per sample and axis
    double position_flicker = 0.0, velocity_flicker = 0.0;  // A of flicker.hpp
    AxesParams pickoff{};
    Quantizer position{}, velocity{};
    double actuator_limit = Quantizer::unlimited;
    int actuator_bits = 0;
    AxesParams force{};
    std::int64_t delay = 0;          // steps
    Vec2<double> cubic_stiffness{};  // per axis: the force is -cubic_stiffness·q³
    double stiffness_drift = 0.0;    // K grows by this fraction per kelvin
    double damping_drift = 0.0;      // D grows by this fraction per kelvin
    double bias_instability = 0.0;   // rate: A of flicker.hpp, the B of IEEE Std 952
    double rate_walk_step = 0.0;     // standard deviation of its steps
    ThermalParams thermal{};
    Profile temperature{};  // its change, K

    // Fields, without the temperature.
    static constexpr auto fields() {
        using P = ImperfectionParams;
        constexpr Range bits{.low = 0.0, .high = 32.0, .whole = true}, gain{.low = -1.0, .strict = true};
        constexpr Range delays{.low = 0.0, .high = 1000.0, .whole = true};
        return Fields{
            fixed(field("position_noise", &P::position_noise, "q0", at_least_0,
                        "standard deviation of the measured position, drawn again for every sample. 0.0: off.")),
            fixed(field("position_flicker", &P::position_flicker, "q0", at_least_0,
                        "A of flicker noise of the position, two-sided density A^2/omega. 0.0: off.")),
            fixed(field("velocity_noise", &P::velocity_noise, "q0*omega0", at_least_0,
                        "of the measured velocity. 0.0: off.")),
            fixed(field("velocity_flicker", &P::velocity_flicker, "q0*omega0", at_least_0,
                        "Flicker noise of the velocity, as position_flicker. 0.0: off.")),
            fixed(field("pickoff_gain_error", Within{&P::pickoff, &AxesParams::gain_error}, "1", gain,
                        "[x, y], > -1: position and velocity are measured 1 plus this times as large as they are. "
                        "Zeros: off.")),
            fixed(field("pickoff_misalignment", Within{&P::pickoff, &AxesParams::misalignment}, "rad", any_number,
                        "angle from the axes of [plant] to those of the pick-offs, from x towards y. 0.0: off.")),
            fixed(field("position_range", Within{&P::position, &Quantizer::range}, "q0", limit,
                        "> 0, [x, y]: the measured position clips at plus and minus this. inf: off.")),
            fixed(field("position_bits", Within{&P::position, &Quantizer::bits}, "1", bits,
                        "Bits of the converter: it has 2^bits levels over the range, at most 32 bits. 0: off.")),
            fixed(field("velocity_range", Within{&P::velocity, &Quantizer::range}, "q0*omega0", limit,
                        "> 0, [x, y]: the measured velocity clips at plus and minus this. inf: off.")),
            fixed(field("velocity_bits", Within{&P::velocity, &Quantizer::bits}, "1", bits,
                        "Bits of its converter, as position_bits. 0: off.")),
            fixed(field("actuator_limit", &P::actuator_limit, "m*omega0^2*q0", limit,
                        "> 0: largest force of the actuator per axis; the controller does not know of it, as it does "
                        "of controller.force_limit. inf: off.")),
            fixed(field("actuator_bits", &P::actuator_bits, "1", bits,
                        "Bits of the force's converter, over plus and minus the limit. 0: off.")),
            fixed(field("force_gain_error", Within{&P::force, &AxesParams::gain_error}, "1", gain,
                        "[x, y], > -1: the force that acts is 1 plus this times that of the actuator's converter. "
                        "Zeros: off.")),
            fixed(field("force_misalignment", Within{&P::force, &AxesParams::misalignment}, "rad", any_number,
                        "angle from the axes of [plant] to those of the actuators, from x towards y. 0.0: off.")),
            fixed(field("delay", &P::delay, "h", delays,
                        "Steps between a measurement and the force that answers it, beyond none, at most 1000. "
                        "0: off.")),
            fixed(field("cubic_stiffness", &P::cubic_stiffness, "m*omega0^2/q0^2", any_number,
                        "[x, y]: each spring pulls with this times q^3 more; negative softens. Zeros: off.")),
            fixed(field("stiffness_drift", &P::stiffness_drift, "1/K", any_number,
                        "of K and Delta K, by the temperature below. It is twice the temperature coefficient of the "
                        "frequency (TCF) in a data sheet. 0.0: off.")),
            fixed(field("damping_drift", &P::damping_drift, "1/K", any_number,
                        "of D and Delta D, by the same. A quality factor that goes as T^-g is 1e6 g/300 ppm/K at "
                        "300 K: 1700 to 10000 for g from 0.5 to 3. 0.0: off.")),
            fixed(field("spring_drift", Within{&P::thermal, &ThermalParams::spring}, "1/K", any_number,
                        "[x, y]: further drift of the entries xx and yy of K + Delta K. Zeros: off.")),
            fixed(field("quadrature_drift", Within{&P::thermal, &ThermalParams::quadrature}, "1/K", any_number,
                        "Drift of its entry xy, over the root of xx times yy. 0.0: off.")),
            fixed(field("damper_drift", Within{&P::thermal, &ThermalParams::damper}, "1/K", any_number,
                        "[x, y]: further drift of the entries xx and yy of D + Delta D. Zeros: off.")),
            fixed(field("damping_axis_drift", Within{&P::thermal, &ThermalParams::damping_axis}, "1/K", any_number,
                        "turns the axes of the damping, from x towards y; by small angles. 0.0: off.")),
            fixed(field("pickoff_gain_drift", Within{&P::thermal, &ThermalParams::pickoff_gain}, "1/K", any_number,
                        "[x, y]: drift of the gains of the pick-offs, after pickoff_gain_error. Zeros: off.")),
            fixed(field("force_gain_drift", Within{&P::thermal, &ThermalParams::force_gain}, "1/K", any_number,
                        "[x, y]: drift of the gains of the actuators, before force_gain_error. Zeros: off.")),
            fixed(field("bias_instability", &P::bias_instability, "omega0", at_least_0,
                        "B of IEEE Std 952; 1 deg/h is 4.848e-6 rad/s. Error torques that act as flicker noise of the "
                        "rate would, but are not part of the true rate; their Allan deviation is 0.664 B. 0.0: off.")),
            fixed(field("rate_walk_step", &P::rate_walk_step, "omega0", at_least_0,
                        "Standard deviation of the steps of a random walk of the rate. 0.0: off.")),
        };
    }

    Quantizer actuator() const { return {.range = {actuator_limit, actuator_limit}, .bits = actuator_bits}; }
    bool flickers() const { return position_flicker > 0.0 || velocity_flicker > 0.0; }
    bool rate_wanders() const { return bias_instability > 0.0 || rate_walk_step > 0.0; }
};

// Noise drawn for a device at one sample. `flicker` and `rate` are drawn as white noise of unit variance, and filtered
// later.
struct DeviceDraw {
    Motion<double> noise{}, flicker{};
    Vec2<double> rate{};  // for its flicker, for its walk
    double warmer = 0.0;  // K, where gains drift with temperature
};

struct Imperfections {
    static constexpr std::size_t longest_delay = 1000;  // steps
    struct Coefficients {
        ImperfectionParams device{};
        bool sensed_as_is = true, acts_as_is = true, flickers = false, rate_wanders = false, warms = false;
        AxesMap<double> pickoff{}, force{};
    };
    // The white noise is separate: it is a function of seed and sample, without memory.
    struct State {
        std::array<Vec2<double>, longest_delay> waiting{};  // forces requested and not yet applied, in a ring
        Flicker::State<Vec2<double>> position{}, velocity{};
        Flicker::State<double> rate{};
        double walk = 0.0;
        double bias_before = 0.0, bias = 0.0;  // additional effective rate over the last step, and over the coming one
    };

    static Coefficients prepare(const ImperfectionParams& p) {
        return {.device = p,
                .sensed_as_is = !p.pickoff.on(),
                .acts_as_is = !p.force.on(),
                .flickers = p.flickers(),
                .rate_wanders = p.rate_wanders(),
                .warms = p.thermal.moves_gains(),
                .pickoff = onto(p.pickoff),
                .force = along(p.force)};
    }

    // The measured motion, with this noise; called once per sample.
    static Motion<double> sense(State& state, const Coefficients& c, Motion<double> motion, const DeviceDraw& drawn) {
        const ImperfectionParams& d = c.device;
        if (!c.sensed_as_is) {
            motion = {.position = c.pickoff(motion.position), .velocity = c.pickoff(motion.velocity)};
        }
        if (c.warms) {
            const Vec2<double> gain = grown(d.thermal.pickoff_gain, drawn.warmer);
            motion = {.position = gain * motion.position, .velocity = gain * motion.velocity};
        }
        if (c.rate_wanders) {
            state.walk += d.rate_walk_step * drawn.rate.y();
            state.bias_before = state.bias;
            state.bias = d.bias_instability * Flicker::next(state.rate, drawn.rate.x()) + state.walk;
        }
        Motion<double> noise = drawn.noise;
        if (c.flickers) {
            noise.position =
                noise.position + d.position_flicker * Flicker::next(state.position, drawn.flicker.position);
            noise.velocity =
                noise.velocity + d.velocity_flicker * Flicker::next(state.velocity, drawn.flicker.velocity);
        }
        return {.position = d.position(motion.position + noise.position),
                .velocity = d.velocity(motion.velocity + noise.velocity)};
    }

    // The force that acts over the step from sample n on, for the force requested there; called once per step. Zero at
    // first.
    static Vec2<double> actuate(State& state, const Coefficients& c, const Vec2<double>& asked, std::int64_t n) {
        return give(c, late(state, c, asked, n), n);
    }
    // Its two parts: the force that is due, and what the actuator makes of it.
    static Vec2<double> late(State& state, const Coefficients& c, Vec2<double> asked, std::int64_t n) {
        if (c.device.delay > 0) {
            std::swap(asked, state.waiting[static_cast<std::size_t>(n % c.device.delay)]);
        }
        return asked;
    }
    static Vec2<double> give(const Coefficients& c, const Vec2<double>& asked, std::int64_t n) {
        Vec2<double> given = c.device.actuator()(asked);
        if (c.warms) {
            given = grown(c.device.thermal.force_gain, c.device.temperature.at(n)) * given;
        }
        return c.acts_as_is ? given : c.force(given);
    }

private:
    static Vec2<double> grown(const Vec2<double>& per_kelvin, double warmer) {
        return Vec2<double>{1.0, 1.0} + warmer * per_kelvin;
    }
};

// The white noise of a device.
class DeviceNoise {
public:
    DeviceNoise(const ImperfectionParams& p, std::uint64_t seed, double step)
        : position_(noise(p.position_noise, seed, 1), step),
          velocity_(noise(p.velocity_noise, seed, 2), step),
          position_flicker_(noise(p.position_flicker > 0.0 ? 1.0 : 0.0, seed, 4), step),
          velocity_flicker_(noise(p.velocity_flicker > 0.0 ? 1.0 : 0.0, seed, 5), step),
          rate_(noise(p.rate_wanders() ? 1.0 : 0.0, seed, 6), step),
          temperature_(p.thermal.moves_gains() ? p.temperature : Profile{}),
          colored_(p.flickers() || p.rate_wanders()) {}

    DeviceDraw operator()(std::int64_t n) {
        DeviceDraw drawn{.noise = {.position = position_(n), .velocity = velocity_(n)}};
        if (colored_) {
            drawn.flicker = {.position = position_flicker_(n), .velocity = velocity_flicker_(n)};
            drawn.rate = rate_(n);
        }
        drawn.warmer = temperature_.at(n);
        return drawn;
    }

private:
    static DisturbanceParams noise(double standard_deviation, std::uint64_t seed, std::uint32_t stream) {
        return {.kind = standard_deviation > 0.0 ? DisturbanceKind::noise : DisturbanceKind::none,
                .standard_deviation = standard_deviation,
                .seed = seed,
                .stream = stream};
    }

    Disturbance position_, velocity_, position_flicker_, velocity_flicker_, rate_;
    Profile temperature_;
    bool colored_;
};

}  // namespace fracgyro
