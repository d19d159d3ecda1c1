// Phases counted in integers: whole turns never accumulate a rounding error, and every processor has the same bits.
#pragma once

#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/linear.hpp"

#include <array>
#include <cstdint>

namespace fracgyro {

// An angle in 2^-64 turns, without whole turns; 0 if it is not finite.
inline std::uint64_t phase_of(double radians) {
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

// A phase plus a part of a turn, which is below a quarter; the phase itself if it is not. Even in single precision no
// part is too small to change it.
template <std::floating_point F>
std::uint64_t phase_after(std::uint64_t phase, F turns) {
    constexpr F quarter = static_cast<F>(0.25), unit = static_cast<F>(0x1p64);
    const bool within = absolute(turns) < quarter;  // and a number
    return phase + (within ? static_cast<std::uint64_t>(static_cast<std::int64_t>(turns * unit)) : 0);
}
// A phase as a part of a turn, from -½ to ½.
template <std::floating_point F>
F turns_of(std::uint64_t phase) {
    return static_cast<F>(static_cast<std::int64_t>(phase)) * static_cast<F>(0x1p-64);
}

// A phase as a fraction of 2^64, and its sine and cosine. Lanes, which are several numbers, have one phase each.
template <Scalar T>
struct PhaseOf {
    using Type = std::uint64_t;
    static SineCosine<T> sine_cosine(Type phase) { return fracgyro::sine_cosine<T>(phase); }
    static Type after(Type phase, T turns) { return phase_after(phase, static_cast<detail::Built<T>>(turns)); }
    static T turns(Type phase) { return T(turns_of<detail::Built<T>>(phase)); }
};

// Sine and cosine on each axis.
template <Scalar T>
struct SineCosine2 {
    Vec2<T> sine{}, cosine{};

    // Both angles added.
    friend constexpr SineCosine2 operator*(const SineCosine2& a, const SineCosine2& b) {
        return {.sine = a.sine * b.cosine + a.cosine * b.sine, .cosine = a.cosine * b.cosine - a.sine * b.sine};
    }
};

// A phase on each axis that advances by the same amount every step.
template <Scalar T>
struct SteadyPhases {
    using Phase = typename PhaseOf<T>::Type;
    std::array<Phase, 2> start{}, increment{};  // at t = 0 and per step, in 2^-64 turns

    // Frequencies in rad per unit of time, phases in rad.
    static SteadyPhases prepare(const Vec2<double>& frequency, const Vec2<double>& phase, double step) {
        return {.start = {Phase{} + phase_of(phase.x()), Phase{} + phase_of(phase.y())},
                .increment = {Phase{} + phase_of(frequency.x() * step), Phase{} + phase_of(frequency.y() * step)}};
    }
    SineCosine2<T> at(Kept<T, std::uint64_t> step) const {
        const auto x = PhaseOf<T>::sine_cosine(start[0] + step * increment[0]);
        const auto y = PhaseOf<T>::sine_cosine(start[1] + step * increment[1]);
        return {.sine = {x.sine, y.sine}, .cosine = {x.cosine, y.cosine}};
    }
};

// Cosine and sine of an angle in rad: the factor that rotates a complex number by it.
template <Scalar T>
Vec2<T> turn_of(double radians) {
    const SineCosine<double> found = sine_cosine<double>(phase_of(radians));
    return {T(found.cosine), T(found.sine)};
}

}  // namespace fracgyro
