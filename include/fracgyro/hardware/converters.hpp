// Converters around a controller, in their words: two's complement numbers of the ADC that reads the motion and of the
// DAC that drives the electrodes, or gives the force itself.
//
//    position = step · word        volts = G⁻¹ u/growth(X)        word = round(volts/step), within its bits
//
// G: force per volt, as designed. The steps and their rounding are those of the simulated converters (Quantizer in
// plant/imperfections.hpp, Volts in plant/volts.hpp).
#pragma once

#include "fracgyro/core/linear.hpp"

#include <concepts>
#include <cstdint>

namespace fracgyro {

template <std::floating_point T>
struct Converters {
    struct Words {
        std::int32_t x = 0, y = 0;
    };
    struct Coefficients {
        Vec2<T> position{}, velocity{};     // one step of the ADC
        Sym2<T> per_force{}, force{};       // volts per force, and force per volt; 1 if the DAC gives the force
        Vec2<T> reach{}, step{}, levels{};  // DAC, V: its range, one step, and steps in the range; 0: no steps
        Vec2<T> per_gap{};                  // X per length, if the driver knows how plates grow with X; otherwise 0
    };
    struct Drive {
        Vec2<T> codes{}, volts{}, force{};  // `force`: what the voltages are meant to be

        Words words() const { return {static_cast<std::int32_t>(codes.x()), static_cast<std::int32_t>(codes.y())}; }
    };

    static Vec2<T> motion(const Vec2<T>& step, const Words& words) {
        return step * Vec2<T>{static_cast<T>(words.x), static_cast<T>(words.y)};
    }
    static Drive drive(const Coefficients& c, const Vec2<T>& force, const Vec2<T>& position) {
        const Vec2<T> wanted = c.per_force * force;
        const Vec2<T> grown{growth(c.per_gap.x() * position.x()), growth(c.per_gap.y() * position.y())};
        const One x = one(wanted.x() / grown.x(), c.reach.x(), c.step.x(), c.levels.x());
        const One y = one(wanted.y() / grown.y(), c.reach.y(), c.step.y(), c.levels.y());
        const Vec2<T> volts{x.volts, y.volts};
        return {.codes = {x.code, y.code}, .volts = volts, .force = c.force * (grown * volts)};
    }

private:
    struct One {
        T code{}, volts{};
    };
    static One one(T volts, T reach, T step, T levels) {
        const T clipped = clamp(volts, -reach, reach);
        if (levels == T(0.0)) {
            return {.volts = clipped};
        }
        const T code = clamp(detail::round_to_nearest(clipped / step), -levels, levels - T(1.0));
        return {.code = code, .volts = step * code};
    }
    // Force per volt of a pair of plates at X over that at rest; a sample closer to the plate is a fault.
    static T growth(T x) {
        const T square = minimum(x * x, T(0.81)), d = T(1.0) / (T(1.0) - square);
        return (T(1.0) + square) * (d * d);
    }
};

}  // namespace fracgyro
