// A number that never shares a register with others: coefficients of it are laid out as on processors without such registers.
#pragma once

#include "fracgyro/math.hpp"

namespace fracgyro {

template <std::floating_point Number>
struct Alone {
    static constexpr bool is_alone = true;
    Number value{};

    constexpr Alone() = default;
    constexpr explicit Alone(double a) : value(static_cast<Number>(a)) {}

    friend constexpr Alone operator+(Alone a, Alone b) { return of(a.value + b.value); }
    friend constexpr Alone operator-(Alone a, Alone b) { return of(a.value - b.value); }
    friend constexpr Alone operator*(Alone a, Alone b) { return of(a.value * b.value); }
    friend constexpr Alone operator/(Alone a, Alone b) { return of(a.value / b.value); }
    friend constexpr Alone operator-(Alone a) { return of(-a.value); }
    friend constexpr bool operator<(Alone a, Alone b) { return a.value < b.value; }

private:
    static constexpr Alone of(Number a) {
        Alone result;
        result.value = a;
        return result;
    }
};

}  // namespace fracgyro

template <class Number>
struct fracgyro::detail::Bits<fracgyro::Alone<Number>> : fracgyro::detail::Bits<Number> {};
