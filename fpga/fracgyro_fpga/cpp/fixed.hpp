// A number with a fixed point, as the core's scalar and as exported hardware has it: `whole` bits left of the point,
// the sign among them, and `fraction` bits right of it.
//
//    A result that does not fit saturates at the largest number of its sign. The range is symmetric: -x is always a
//    number. Sums are exact. A product is rounded to the nearest number, ties to the larger one. Quotients and roots
//    are rounded towards 0. A quotient by 0 is the largest number; the root of a negative number is 0. There is no
//    NaN: it becomes 0.
#pragma once

#include "fracgyro/control/reference.hpp"

#include <algorithm>
#include <cstdint>

namespace fracgyro {

template <int whole, int fraction>
struct Fixed {
    static constexpr int bits = whole + fraction;
    static_assert(0 < whole && 0 < fraction && fraction < bits && bits <= 62);
    static constexpr std::int64_t most = (std::int64_t{1} << (bits - 1)) - 1;
    // An angle, where its 32 bits of a turn are the last places of a number.
    static constexpr double radians_of_remainder =
        6.28318530717958647693 / 0x1p32 * static_cast<double>(std::int64_t{1} << fraction);
    using Wide = unsigned __int128;

    std::int64_t places = 0;  // times 2^-fraction

    constexpr Fixed() = default;
    template <class One>
        requires std::is_arithmetic_v<One>
    constexpr explicit Fixed(One number) {
        const double scaled = static_cast<double>(number) * static_cast<double>(std::int64_t{1} << fraction);
        const double size = scaled < 0.0 ? -scaled : scaled;
        if (size == size) {
            places = with_sign(scaled < 0.0, size < static_cast<double>(most)
                                                 ? static_cast<Wide>(size + 0.5)  // exact if there is a half to add
                                                 : static_cast<Wide>(most));
        }
    }
    static constexpr Fixed of(std::int64_t places) {
        Fixed found;
        found.places = std::clamp(places, -most, most);
        return found;
    }

    constexpr Fixed operator-() const { return of(-places); }
    friend constexpr Fixed operator+(Fixed a, Fixed b) { return of(a.places + b.places); }
    friend constexpr Fixed operator-(Fixed a, Fixed b) { return of(a.places - b.places); }
    friend constexpr Fixed operator*(Fixed a, Fixed b) {
        constexpr Wide half = Wide{1} << (fraction - 1);
        Fixed found;
        found.places = with_sign((a.places < 0) != (b.places < 0), (a.size() * b.size() + half) >> fraction);
        return found;
    }
    friend constexpr Fixed operator/(Fixed a, Fixed b) {
        const Wide scaled = a.size() << fraction;
        Fixed found;
        found.places =
            with_sign((a.places < 0) != (b.places < 0), b.places == 0 ? static_cast<Wide>(most) : scaled / b.size());
        return found;
    }
    friend constexpr bool operator==(Fixed, Fixed) = default;
    friend constexpr bool operator<(Fixed a, Fixed b) { return a.places < b.places; }

    friend constexpr Fixed square_root(Fixed a) {
        Wide left = a.places < 0 ? 0 : a.size() << fraction, root = 0;
        for (int bit = (bits + fraction) / 2; bit >= 0; --bit) {
            const Wide next = root | Wide{1} << bit;
            if (next * next <= left) {
                root = next;
            }
        }
        Fixed found;
        found.places = static_cast<std::int64_t>(root);
        return found;
    }

private:
    constexpr Wide size() const { return static_cast<Wide>(places < 0 ? -places : places); }
    static constexpr std::int64_t with_sign(bool negative, Wide size) {
        const auto within = static_cast<std::int64_t>(std::min(size, static_cast<Wide>(most)));
        return negative ? -within : within;
    }
};

// The angle that replaces the one of the next phase, if a phase comes from an integer; nullptr: none.
template <class T>
const T*& angle_of_integer() {
    static const T* angle = nullptr;
    return angle;
}

// Sine and cosine of a phase whose integer part the hardware has: x = remainder·unit, with the quadrant's swap and
// signs.
template <class T>
SineCosine<T> sine_cosine_of(T remainder, T unit, T odd_quadrant, T negative_sine, T negative_cosine) {
    const T x = remainder * unit, zero = T(0.0);
    angle_of_integer<T>() = &x;
    const auto [sine, cosine] = sine_cosine<T>(std::uint32_t{0});  // sine and cosine of x
    angle_of_integer<T>() = nullptr;
    const T first = if_less(zero, odd_quadrant, cosine, sine), second = if_less(zero, odd_quadrant, sine, cosine);
    return {.sine = if_less(zero, negative_sine, -first, first),
            .cosine = if_less(zero, negative_cosine, -second, second)};
}

// Word length of exported hardware; other lengths are only for comparison.
#ifndef FRACGYRO_FRACTION
#define FRACGYRO_FRACTION 28
#endif
using HardwareFixed = Fixed<20, FRACGYRO_FRACTION>;
template <>
inline HardwareFixed angle(double radians) {
    const HardwareFixed* const known = angle_of_integer<HardwareFixed>();
    return known != nullptr ? *known : HardwareFixed(radians);
}
template <>
struct PhaseOf<HardwareFixed> {
    using Type = std::uint64_t;
    static SineCosine<HardwareFixed> sine_cosine(Type phase) {
        const auto turns = static_cast<std::uint32_t>(phase >> 32);
        const std::uint32_t quadrant = (turns + (1U << 29)) >> 30;
        const auto remainder = static_cast<std::int32_t>(turns - (quadrant << 30));
        return sine_cosine_of(HardwareFixed::of(remainder), HardwareFixed(HardwareFixed::radians_of_remainder),
                              HardwareFixed(quadrant & 1U), HardwareFixed(quadrant >> 1 & 1U),
                              HardwareFixed((quadrant + 1U) >> 1 & 1U));
    }
};

}  // namespace fracgyro
