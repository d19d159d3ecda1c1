// What stands between the gyroscope and its controller in a device: each effect is off by default.
//
//    sensing     the motion along the axes of the pick-offs, times their gain, plus noise, in steps of a converter;
//                without a sensor of velocity see observer.hpp
//    actuation   the force, `delay` steps late, within the actuator's limit, in steps of its converter, times its gain,
//                along the axes of the actuators
//    the rate    what acts on the mass as if Ωz were larger by it: flicker noise and a random walk
//    the springs and dampers may drift with temperature, and springs stiffen with amplitude: varying_gyroscope.hpp
//
// Noise is drawn as the disturbance is, from streams of their own of the same seed.
#pragma once

#include "fracgyro/plant/angular_rate.hpp"
#include "fracgyro/plant/flicker.hpp"

namespace fracgyro {

// A two's complement converter of 2^bits levels, `step` = 2 range/2^bits apart: -range, …, range - step. Beyond them it
// clips. Without bits it only clips, at ±range.
struct Quantizer {
    static constexpr double unlimited = std::numeric_limits<double>::infinity();
    Vec2<double> range{unlimited, unlimited};  // of each axis
    int bits = 0;

    Vec2<double> operator()(const Vec2<double>& a) const { return {one(a.x(), range.x()), one(a.y(), range.y())}; }
    bool on() const { return bits != 0 || range.x() < unlimited || range.y() < unlimited; }

private:
    double one(double a, double reach) const {
        const double clipped = clamp(a, -reach, reach);
        if (bits == 0) {
            return clipped;
        }
        const double levels = static_cast<double>(std::int64_t{1} << (bits - 1));
        const double step = reach / levels;
        return step * clamp(detail::round_to_nearest(clipped / step), -levels, levels - 1.0);
    }
};

// Axes that are turned by `misalignment`, counter-clockwise in rad, from those of the plant; along them 1 + gain_error
// of what should be.
struct AxesParams {
    Vec2<double> gain_error{};
    double misalignment = 0.0;

    bool on() const { return gain_error.x() != 0.0 || gain_error.y() != 0.0 || misalignment != 0.0; }
};

struct ImperfectionParams {
    double position_noise = 0.0, velocity_noise = 0.0;      // standard deviations, of every sample on each axis
    double position_flicker = 0.0, velocity_flicker = 0.0;  // A of flicker.hpp
    Quantizer position{}, velocity{}, actuator{};
    AxesParams pickoff{}, force{};
    std::int64_t delay = 0;          // steps
    Vec2<double> cubic_stiffness{};  // of each axis: the force is -that·q³
    double stiffness_drift = 0.0;    // K grows by this fraction per kelvin
    double damping_drift = 0.0;      // D grows by this fraction per kelvin
    Profile temperature{};           // its change, K
    double bias_instability = 0.0;   // of the rate: A of flicker.hpp, the B of IEEE Std 952
    double rate_random_walk = 0.0;   // standard deviation of its steps

    bool flickers() const { return position_flicker > 0.0 || velocity_flicker > 0.0; }
    bool rate_wanders() const { return bias_instability > 0.0 || rate_random_walk > 0.0; }
};

// What is drawn of a device at one sample. White noise of unit variance is drawn for what `flicker` and `rate` become.
struct DeviceDraw {
    Motion<double> noise{}, flicker{};
    Vec2<double> rate{};  // for its flicker, for its walk
};

struct Imperfections {
    static constexpr std::size_t longest_delay = 1000;  // steps
    // From one pair of axes to another: what one unit of x becomes, and one of y.
    struct Map {
        Vec2<double> x{}, y{};

        Vec2<double> operator()(const Vec2<double>& a) const { return a.x() * x + a.y() * y; }
    };
    struct Coefficients {
        ImperfectionParams device{};
        bool sensed_as_is = true, acts_as_is = true, flickers = false, rate_wanders = false;
        Map pickoff{}, force{};
    };
    // The white noise is apart: it is a function of seed and sample, and nothing that is remembered.
    struct State {
        std::array<Vec2<double>, longest_delay> waiting{};  // forces asked for and not yet given, in a ring
        Flicker::State<Vec2<double>> position{}, velocity{};
        Flicker::State<double> rate{};
        double walk = 0.0;
        double bias_before = 0.0, bias = 0.0;  // what acts as a rate over the last step, and over the coming one
    };

    static Coefficients prepare(const ImperfectionParams& p) {
        const Vec2<double> seen = turn_of<double>(p.pickoff.misalignment);
        const Vec2<double> pushed = turn_of<double>(p.force.misalignment);
        const Vec2<double> ones{1.0, 1.0}, sense = ones + p.pickoff.gain_error, push = ones + p.force.gain_error;
        return {.device = p,
                .sensed_as_is = !p.pickoff.on(),
                .acts_as_is = !p.force.on(),
                .flickers = p.flickers(),
                .rate_wanders = p.rate_wanders(),
                .pickoff = {sense * Vec2<double>{seen.x(), -seen.y()}, sense * swapped(seen)},
                .force = {push.x() * pushed, push.y() * turned(pushed)}};
    }

    // What is measured of the motion, where this was drawn; called once every sample.
    static Motion<double> sense(State& state, const Coefficients& c, Motion<double> motion, const DeviceDraw& drawn) {
        const ImperfectionParams& d = c.device;
        if (!c.sensed_as_is) {
            motion = {.position = c.pickoff(motion.position), .velocity = c.pickoff(motion.velocity)};
        }
        if (c.rate_wanders) {
            state.walk += d.rate_random_walk * drawn.rate.y();
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

    // What acts over the step from the sample n on, of the force asked for there; called once every step. None at
    // first.
    static Vec2<double> actuate(State& state, const Coefficients& c, Vec2<double> asked, std::int64_t n) {
        if (c.device.delay > 0) {
            std::swap(asked, state.waiting[static_cast<std::size_t>(n % c.device.delay)]);
        }
        const Vec2<double> given = c.device.actuator(asked);
        return c.acts_as_is ? given : c.force(given);
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
          colored_(p.flickers() || p.rate_wanders()) {}

    DeviceDraw operator()(std::int64_t n) {
        DeviceDraw drawn{.noise = {.position = position_(n), .velocity = velocity_(n)}};
        if (colored_) {
            drawn.flicker = {.position = position_flicker_(n), .velocity = velocity_flicker_(n)};
            drawn.rate = rate_(n);
        }
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
    bool colored_;
};

}  // namespace fracgyro
