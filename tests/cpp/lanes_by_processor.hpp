// What the lanes of one kind of processor compute, number by number, for a test that has to ask first which kind it
// runs on: each kind is compiled by itself with the flags that it ships with, and nothing else is.
#pragma once

#include <cstddef>

namespace fracgyro::testing {

inline constexpr std::size_t operations = 10;

template <class Number, std::size_t Bytes>
struct LanesOf {
    static constexpr std::size_t count = Bytes / sizeof(Number);

    static void power(const Number* base, const Number* exponent, Number* found);
    // Of each pair: a + b, a - b, a b, -a, maximum, minimum, |a|, |b| with a's sign, 1 or 2 as a < b or not, the root
    // of |b|.
    static void arithmetic(const Number* a, const Number* b, Number* found);
    static bool each_is_less(const Number* a, const Number* b);
};

}  // namespace fracgyro::testing
