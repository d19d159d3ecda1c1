// What stands between the gyroscope and its controller in a device: each effect is off by default.
//
//    sensing     the motion, plus noise, in steps of a converter; without a sensor of velocity see observer.hpp
//    actuation   the force, `delay` steps late, within the actuator's limit, in steps of its converter
//    the springs may drift with temperature and stiffen with amplitude: varying_gyroscope.hpp
//
// Noise is drawn as the disturbance is, from streams of their own of the same seed.
#pragma once

#include "fracgyro/plant/angular_rate.hpp"

#include "fracgyro/control/error.hpp"

namespace fracgyro {

// A two's complement converter of 2^bits levels, `step` = 2 range/2^bits apart: -range, …, range - step. Beyond them it
// clips. Without bits it only clips, at ±range.
struct Quantizer {
    double range = std::numeric_limits<double>::infinity();
    int bits = 0;

    double operator()(double a) const {
        const double clipped = clamp(a, -range, range);
        if (bits == 0) {
            return clipped;
        }
        const double levels = static_cast<double>(std::int64_t{1} << (bits - 1));
        const double step = range / levels;
        return step * clamp(detail::round_to_nearest(clipped / step), -levels, levels - 1.0);
    }
    Vec2<double> operator()(const Vec2<double>& a) const { return {(*this)(a.x()), (*this)(a.y())}; }
    bool on() const { return bits != 0 || range < std::numeric_limits<double>::infinity(); }
};

struct ImperfectionParams {
    double position_noise = 0.0, velocity_noise = 0.0;  // standard deviations, of every sample on each axis
    Quantizer position{}, velocity{}, actuator{};
    std::int64_t delay = 0;          // steps
    Vec2<double> cubic_stiffness{};  // of each axis: the force is -that·q³
    double stiffness_drift = 0.0;    // K grows by this fraction per kelvin
    Profile temperature{};           // its change, K
};

// The noise is apart: it is a function of seed and sample, and nothing that is remembered.
struct Imperfections {
    static constexpr std::size_t longest_delay = 1000;  // steps
    using Coefficients = ImperfectionParams;
    struct State {
        std::array<Vec2<double>, longest_delay> waiting{};  // forces asked for and not yet given, in a ring
    };

    // What is measured of the motion, where this noise was drawn.
    static Motion<double> sense(const Coefficients& c, const Motion<double>& motion, const Motion<double>& noise) {
        return {.position = c.position(motion.position + noise.position),
                .velocity = c.velocity(motion.velocity + noise.velocity)};
    }

    // What acts over the step from the sample n on, of the force asked for there; called once every step. None at
    // first.
    static Vec2<double> actuate(State& state, const Coefficients& c, Vec2<double> asked, std::int64_t n) {
        if (c.delay > 0) {
            std::swap(asked, state.waiting[static_cast<std::size_t>(n % c.delay)]);
        }
        return c.actuator(asked);
    }
};

// The noise of both sensors.
class SensorNoise {
public:
    SensorNoise(const ImperfectionParams& p, std::uint64_t seed, double step)
        : position_(noise(p.position_noise, seed, 1), step), velocity_(noise(p.velocity_noise, seed, 2), step) {}

    Motion<double> operator()(std::int64_t n) { return {.position = position_(n), .velocity = velocity_(n)}; }

private:
    static DisturbanceParams noise(double standard_deviation, std::uint64_t seed, std::uint32_t stream) {
        return {.kind = standard_deviation > 0.0 ? DisturbanceKind::noise : DisturbanceKind::none,
                .standard_deviation = standard_deviation,
                .seed = seed,
                .stream = stream};
    }

    Disturbance position_, velocity_;
};

}  // namespace fracgyro
