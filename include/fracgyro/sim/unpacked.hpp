// A number that never shares a register with others: its coefficients have the layout of processors without such
// registers.
#pragma once

#include "fracgyro/core/elementary.hpp"

namespace fracgyro {

template <std::floating_point Number>
struct Unpacked {
    static constexpr bool is_unpacked = true;
    Number value{};

    constexpr Unpacked() = default;
    constexpr explicit Unpacked(double a) : value(static_cast<Number>(a)) {}

    friend constexpr Unpacked operator+(Unpacked a, Unpacked b) { return of(a.value + b.value); }
    friend constexpr Unpacked operator-(Unpacked a, Unpacked b) { return of(a.value - b.value); }
    friend constexpr Unpacked operator*(Unpacked a, Unpacked b) { return of(a.value * b.value); }
    friend constexpr Unpacked operator/(Unpacked a, Unpacked b) { return of(a.value / b.value); }
    friend constexpr Unpacked operator-(Unpacked a) { return of(-a.value); }
    friend Unpacked square_root(Unpacked a) { return of(fracgyro::square_root(a.value)); }
    friend constexpr bool operator<(Unpacked a, Unpacked b) { return a.value < b.value; }

private:
    static constexpr Unpacked of(Number a) {
        Unpacked result;
        result.value = a;
        return result;
    }
};

}  // namespace fracgyro

template <class Number>
struct fracgyro::detail::Bits<fracgyro::Unpacked<Number>> : fracgyro::detail::Bits<Number> {};
