// 1  The reference r and its first two derivatives: amplitude·sin(frequency·t + phase) on each axis, eq. (49).
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/phase.hpp"

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

// Between two exact evaluations the pair (sine, cosine) is rotated by the angle of one step, which is far cheaper.
template <Scalar T>
struct Reference {
    static constexpr std::uint64_t exact_every = 32;

    struct Coefficients {
        SteadyPhases<T> phases{};
        SineCosine2<T> turn{};                              // by one step
        Vec2<T> amplitude{}, peak_velocity{}, curvature{};  // a, a·f, -f²
    };
    struct State {
        Kept<T, std::uint64_t> steps = 0;  // time is steps·h
        SineCosine2<T> at{};               // at the present step
    };

    static Coefficients prepare(const ReferenceParams& p, double step) {
        const auto x = sine_cosine<T>(phase_of(p.frequency.x() * step));
        const auto y = sine_cosine<T>(phase_of(p.frequency.y() * step));
        return {.phases = SteadyPhases<T>::prepare(p.frequency, p.phase, step),
                .turn = {.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}},
                .amplitude = cast<T>(p.amplitude),
                .peak_velocity = cast<T>(p.amplitude * p.frequency),
                .curvature = cast<T>(-p.frequency * p.frequency)};
    }

    // Returns the point at the present step, then advances by one step.
    static ReferencePoint<T> update(State& state, const Coefficients& c) {
        if (state.steps % exact_every == 0) {
            state.at = c.phases.at(state.steps);
        }
        const SineCosine2<T> at = state.at;
        const Vec2<T> position = c.amplitude * at.sine;
        state.at = at * c.turn;
        ++state.steps;
        return {.position = position, .velocity = c.peak_velocity * at.cosine, .acceleration = c.curvature * position};
    }
};

}  // namespace fracgyro
