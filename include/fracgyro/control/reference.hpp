// 1  The reference r and its first two derivatives. A sine on each axis, eq. (49), is computed here, all other kinds in
//    course.hpp.
//
//    A force that is held for a step acts at its middle on average, λ = (delay + ½) h after the sample that it was
//    computed at, and the hold weakens a sine by sinc(ωh/2) = sin(ωh/2)/(ωh/2). So a force along the reference is that
//    at the held point: each sine of r at t + λ, divided by sinc(ωh/2). Other kinds are taken at t + λ, which leaves an
//    error of h²/24 of the force's second derivative.
#pragma once

#include "fracgyro/core/fields.hpp"
#include "fracgyro/core/phase.hpp"

namespace fracgyro {

enum class ReferenceKind : std::uint32_t { sine, sines, step, ramp, chirp, staircase, table, rest };
inline constexpr std::string_view reference_kinds[] = {"sine",  "sines",     "step",  "ramp",
                                                       "chirp", "staircase", "table", "rest"};

struct Course;

// One sine of a sum of sines on each axis.
struct SineTerm {
    std::array<double, 2> amplitude{}, frequency{}, phase{};
};
// One row of a table, [x, y]. Between rows the motion is the polynomial of fifth degree that has these values.
struct TableRow {
    double time = 0.0;
    std::array<double, 2> position{}, velocity{}, acceleration{};
};

struct ReferenceParams {
    std::array<ReferenceKind, 2> kind{};  // x, y
    Vec2<double> amplitude{1.0, 1.0};
    Vec2<double> frequency{};  // rad per unit of time
    Vec2<double> phase{};      // rad
    Vec2<double> offset{};
    double start = 0.0, end = std::numeric_limits<double>::infinity();
    Vec2<double> final_frequency{}, slope{};
    double hold = 1.0, levels = 1.0;
    double smoothing = 0.0, smoothing_order = 3.0;
    const Course* course = nullptr;  // made of these, unless both axes have a sine without offset

    static constexpr auto fields() {
        using P = ReferenceParams;
        using enum ReferenceKind;
        constexpr Range frequencies{.low = -1e6, .high = 1e6};
        return Fields{
            settable(Settable::beforehand,
                     choice("kind", &P::kind, reference_kinds,
                            "For both axes, or [x, y]. sine: offset + amplitude*sin(frequency*t + phase); sines: a sum "
                            "of sines; step: to amplitude at start, and back at end; ramp: rises by slope per unit of "
                            "time from start to end; chirp: a sine whose frequency changes from frequency to "
                            "final_frequency between start and end; staircase: a step of amplitude every hold, levels "
                            "times; table: points in time; rest: offset only.")),
            for_kinds(reference_kinds, kinds(sine, step, chirp, staircase),
                      field("amplitude", &P::amplitude, "q0", any_number,
                            "[x, y], unit q0: amplitude of a sine or chirp, height of each step. Zeros: off, r = "
                            "offset.")),
            for_kinds(reference_kinds, kinds(sine, chirp),
                      fixed(field("frequency", &P::frequency, "omega0", frequencies,
                                  "[x, y], unit omega0. Zeros: r is constant."))),
            for_kinds(
                reference_kinds, kinds(sine, chirp),
                fixed(field("phase", &P::phase, "rad", any_number, "[x, y], rad: pi/2 makes a cosine. Zeros: off."))),
            fixed(field("offset", &P::offset, "q0", any_number, "[x, y], unit q0: added to every kind. Zeros: off.")),
            for_kinds(reference_kinds, kinds(step, ramp, chirp, staircase),
                      fixed(field("start", &P::start, "1/omega0", at_least_0,
                                  "Unit 1/omega0: until then r = offset. 0.0: off."))),
            for_kinds(reference_kinds, kinds(step, ramp, chirp),
                      fixed(field("end", &P::end, "1/omega0", limit,
                                  "Unit 1/omega0: a step returns, a ramp stops, a chirp stays at final_frequency. inf: "
                                  "off; a chirp must have an end."))),
            for_kinds(reference_kinds, kinds(chirp),
                      fixed(field("final_frequency", &P::final_frequency, "omega0", frequencies,
                                  "[x, y], unit omega0, reached at end."))),
            for_kinds(reference_kinds, kinds(ramp),
                      fixed(field("slope", &P::slope, "q0*omega0", any_number, "[x, y], unit q0 omega0. Zeros: off."))),
            for_kinds(
                reference_kinds, kinds(staircase),
                fixed(field("hold", &P::hold, "1/omega0", above_0, "Unit 1/omega0: time from one step to the next."))),
            for_kinds(
                reference_kinds, kinds(staircase),
                fixed(field("levels", &P::levels, "1", {.low = 1.0, .high = 1e9, .whole = true}, "Number of steps."))),
            for_kinds(
                reference_kinds, kinds(step, ramp, staircase),
                fixed(field("smoothing", &P::smoothing, "1/omega0", at_least_0,
                            "Unit 1/omega0: time constant T of the filter 1/(1 + s T)^n with n = smoothing_order, "
                            "which makes velocity and acceleration finite. 0.0: off, jumps."))),
            for_kinds(reference_kinds, kinds(step, ramp, staircase),
                      fixed(field("smoothing_order", &P::smoothing_order, "1", {.low = 1.0, .high = 8.0, .whole = true},
                                  "n. From 3 on the acceleration is continuous after a step."))),
        };
    }
};

template <Scalar T>
struct ReferencePoint {
    Vec2<T> position{}, velocity{}, acceleration{};
};

// The reference of each axis as a sine with the same mean squares of position and velocity: some designs assume one.
struct EquivalentSine {
    Vec2<double> amplitude{}, frequency{};
};

// sinc(ωh/2), by which a hold weakens a sine of angle ωh per step; 1 at half the sampling frequency and beyond, where a
// sampled loop follows no sine.
inline double held_share(double angle) {
    constexpr double half_turn = 3.14159265358979323846;
    if (!(absolute(angle) < half_turn)) {
        return 1.0;
    }
    const double square = 0.25 * angle * angle;
    double share = 1.0;
    for (double n = 24.0; n > 0.0; n = n - 2.0) {  // the Taylor series, from its last term on
        share = 1.0 - share * (square / (n * (n + 1.0)));
    }
    return share;
}

// Motion on both axes, of any kinds, ready to be evaluated (course.hpp).
struct Course {
    // The point at this step, or with `lead` > 0 the held point, that many steps later. In a function of its own, which
    // is compiled once: lanes, compiled for several processors, only call it.
    ReferencePoint<double> (*at)(const Course&, std::uint64_t step, double lead) = nullptr;
    ReferenceParams params{};
    double step = 0.0;
    std::span<const SineTerm> terms{};
    std::span<const TableRow> rows{};
    std::span<const ReferencePoint<double>> points{};  // the first steps, if they are known
    EquivalentSine equivalent{};
};

inline EquivalentSine equivalent_sine(const ReferenceParams& p) {
    return p.course != nullptr ? p.course->equivalent : EquivalentSine{p.amplitude, p.frequency};
}

// Between two exact evaluations the pair (sine, cosine) is rotated by the angle of one step, which is far cheaper.
template <Scalar T>
struct Reference {
    static constexpr std::uint64_t exact_every = 32;

    struct Coefficients {
        SteadyPhases<T> phases{};
        SineCosine2<T> turn{};                              // by one step
        Vec2<T> amplitude{}, peak_velocity{}, curvature{};  // a, a·f, -f², the last of the equivalent sine
        Vec2<T> frequency{};
        SineCosine2<T> ahead{};          // a/sinc(fh/2) times the turn from the next sample to the middle of the hold
        std::int32_t delay = 0;          // force delay in steps, as far as it is known
        const Course* course = nullptr;  // unless both axes have a sine without offset
    };
    struct State {
        Kept<T, std::uint64_t> steps = 0;  // time is steps·h
        SineCosine2<T> at{};               // at the present step
    };

    static Coefficients prepare(const ReferenceParams& p, double step, std::int64_t delay = 0) {
        const Vec2<double> frequency = equivalent_sine(p).frequency;
        const auto x = sine_cosine<T>(phase_of(p.frequency.x() * step));
        const auto y = sine_cosine<T>(phase_of(p.frequency.y() * step));
        const auto ahead = [&](double amplitude, double angle) {
            const auto turn = sine_cosine<double>(phase_of((static_cast<double>(delay) - 0.5) * angle));
            const double held = amplitude / held_share(angle);
            return SineCosine<double>{.sine = held * turn.sine, .cosine = held * turn.cosine};
        };
        const SineCosine<double> ahead_x = ahead(p.amplitude.x(), p.frequency.x() * step);
        const SineCosine<double> ahead_y = ahead(p.amplitude.y(), p.frequency.y() * step);
        return {.phases = SteadyPhases<T>::prepare(p.frequency, p.phase, step),
                .turn = {.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}},
                .amplitude = cast<T>(p.amplitude),
                .peak_velocity = cast<T>(p.amplitude * p.frequency),
                .curvature = cast<T>(-frequency * frequency),
                .frequency = cast<T>(p.frequency),
                .ahead = {.sine = {T(ahead_x.sine), T(ahead_y.sine)}, .cosine = {T(ahead_x.cosine), T(ahead_y.cosine)}},
                .delay = static_cast<std::int32_t>(delay),
                .course = p.course};
    }

    // Returns the point at the present step, then advances by one step.
    static ReferencePoint<T> update(State& state, const Coefficients& c) {
        if constexpr (std::same_as<Kept<T, std::uint64_t>, std::uint64_t>) {
            if (c.course != nullptr) [[unlikely]] {
                const std::uint64_t n = state.steps++;
                const auto& points = c.course->points;
                const ReferencePoint<double> r = n < points.size() ? points[n] : c.course->at(*c.course, n, 0.0);
                return {cast<T>(r.position), cast<T>(r.velocity), cast<T>(r.acceleration)};
            }
        }
        if (state.steps % exact_every == 0) {
            state.at = c.phases.at(state.steps);
        }
        return follow(state, c);
    }

    // The same for sines whose pair is already that of this step.
    static ReferencePoint<T> follow(State& state, const Coefficients& c) {
        const SineCosine2<T> at = state.at;
        const Vec2<T> position = c.amplitude * at.sine;
        state.at = at * c.turn;
        ++state.steps;
        return {.position = position, .velocity = c.peak_velocity * at.cosine, .acceleration = c.curvature * position};
    }

    // The held point of the last step that update() returned.
    static ReferencePoint<T> held(const State& state, const Coefficients& c) {
        if constexpr (std::same_as<Kept<T, std::uint64_t>, std::uint64_t>) {
            if (c.course != nullptr) [[unlikely]] {
                const double lead = static_cast<double>(c.delay) + 0.5;
                const ReferencePoint<double> r = c.course->at(*c.course, state.steps - 1, lead);
                return {cast<T>(r.position), cast<T>(r.velocity), cast<T>(r.acceleration)};
            }
        }
        const SineCosine2<T> at = state.at * c.ahead;
        return {.position = at.sine, .velocity = c.frequency * at.cosine, .acceleration = c.curvature * at.sine};
    }
};

}  // namespace fracgyro
