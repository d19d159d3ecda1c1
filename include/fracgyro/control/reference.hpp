// 1  The reference r and its first two derivatives: amplitude·sin(frequency·t + phase) on each axis, eq. (49).
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/linear.hpp"

namespace fracgyro {

struct ReferenceParams {
    Vec2<double> amplitude{1.0, 1.0};
    Vec2<double> frequency{};  // rad per unit of time
    Vec2<double> phase{};      // rad

    static constexpr auto fields() {
        using P = ReferenceParams;
        constexpr Range frequencies{.low = -1e6, .high = 1e6};
        return std::tuple{
            field("amplitude", &P::amplitude, "q0", any_number, "[x, y], unit q0. Zeros: off, r = 0."),
            fixed(
                field("frequency", &P::frequency, "omega0", frequencies, "[x, y], unit omega0. Zeros: r is constant.")),
            fixed(field("phase", &P::phase, "rad", any_number, "[x, y], rad: pi/2 makes a cosine. Zeros: off.")),
        };
    }
};

template <Scalar T>
struct ReferencePoint {
    Vec2<T> position{}, velocity{}, acceleration{};
};

// A phase as a fraction of 2^64, and its sine and cosine. Lanes, which are several numbers, have one phase each.
template <Scalar T>
struct PhaseOf {
    using Type = std::uint64_t;
    static SineCosine<T> sine_cosine(Type phase) { return fracgyro::sine_cosine<T>(phase); }
};

// Between two exact evaluations the pair (sine, cosine) is turned by one step's angle, which is far cheaper.
template <Scalar T>
struct Reference {
    static constexpr std::uint64_t exact_every = 32;

    using Phase = typename PhaseOf<T>::Type;
    using Phases = std::array<Phase, 2>;  // of x and of y
    // Sine and cosine of a phase on each axis.
    struct Turn {
        Vec2<T> sine{}, cosine{};
    };
    struct Coefficients {
        Phases start{}, increment{};                        // phase at t = 0 and per step, in 2^-64 turns
        Turn turn{};                                        // of the increment
        Vec2<T> amplitude{}, peak_velocity{}, curvature{};  // a, a·f, -f²
    };
    struct State {
        Kept<T, std::uint64_t> steps = 0;  // time is steps·h
        Turn at{};                         // the present step
    };

    // An angle in 2^-64 turns, whole turns left out; 0 for one that is not finite.
    static std::uint64_t phase_of(double radians) {
        constexpr double radians_per_turn = 6.28318530717958647693;
        constexpr double whole = 4503599627370496.0;  // 2^52: from here on a double has no fraction
        const double turns = radians / radians_per_turn;
        if (!(absolute(turns) < whole)) {
            return 0;
        }
        const double fraction = turns - static_cast<double>(static_cast<std::int64_t>(turns));  // in (-1, 1)
        // The low 2^-11 of the phase is below the precision of a double: scale in two exact steps.
        const auto high = static_cast<std::int64_t>(fraction * whole);
        const double rest = fraction * whole - static_cast<double>(high);
        return (static_cast<std::uint64_t>(high) << 12) +
               static_cast<std::uint64_t>(static_cast<std::int64_t>(rest * 4096.0));
    }

    static Coefficients prepare(const ReferenceParams& p, double step) {
        const auto number = [](const Vec2<double>& a) { return Vec2<T>{T(a.x()), T(a.y())}; };
        const std::array<std::uint64_t, 2> increment{phase_of(p.frequency.x() * step),
                                                     phase_of(p.frequency.y() * step)};
        const auto [x, y] = std::array{sine_cosine<T>(increment[0]), sine_cosine<T>(increment[1])};
        return {.start = {Phase{} + phase_of(p.phase.x()), Phase{} + phase_of(p.phase.y())},
                .increment = {Phase{} + increment[0], Phase{} + increment[1]},
                .turn = {.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}},
                .amplitude = number(p.amplitude),
                .peak_velocity = number(p.amplitude * p.frequency),
                .curvature = number(-p.frequency * p.frequency)};
    }

    // The position alone, at any step.
    static Vec2<T> position(const Coefficients& c, Kept<T, std::uint64_t> step) {
        return c.amplitude * exactly(c, step).sine;
    }

    // The point at the present step; then one step on.
    static ReferencePoint<T> update(State& state, const Coefficients& c) {
        if (state.steps % exact_every == 0) {
            state.at = exactly(c, state.steps);
        }
        const Turn at = state.at;
        const Vec2<T> position = c.amplitude * at.sine;
        state.at = turned(at, c.turn);
        ++state.steps;
        return {.position = position, .velocity = c.peak_velocity * at.cosine, .acceleration = c.curvature * position};
    }

private:
    static Turn turned(const Turn& a, const Turn& by) {
        return {.sine = a.sine * by.cosine + a.cosine * by.sine, .cosine = a.cosine * by.cosine - a.sine * by.sine};
    }
    static Turn exactly(const Coefficients& c, Kept<T, std::uint64_t> step) {
        const auto x = PhaseOf<T>::sine_cosine(c.start[0] + step * c.increment[0]);
        const auto y = PhaseOf<T>::sine_cosine(c.start[1] + step * c.increment[1]);
        return {.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}};
    }
};

}  // namespace fracgyro
