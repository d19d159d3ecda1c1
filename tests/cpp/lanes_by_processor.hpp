// What the lanes of one kind of processor compute, number by number, for a test that has to ask first which kind it
// runs on: each kind is compiled by itself with the flags that it ships with, and nothing else is.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fracgyro::testing {

inline constexpr std::size_t operations = 10, longest_noise = 200;

template <class Number, std::size_t Bytes>
struct LanesOf {
    static constexpr std::size_t count = Bytes / sizeof(Number);

    static void power(const Number* base, const Number* exponent, Number* found);
    // Of each pair: a + b, a - b, a b, -a, maximum, minimum, |a|, |b| with a's sign, 1 or 2 as a < b or not, the root
    // of |b|.
    static void arithmetic(const Number* a, const Number* b, Number* found);
    static bool each_is_less(const Number* a, const Number* b);
    // Noise of the steps first, first + 1, …: x and y of each.
    static void noise(std::uint64_t seed, std::uint32_t stream, std::int64_t hold, std::int64_t first,
                      std::size_t steps, double* found);
    // Of as many seeds as there are lanes: at each step x of all, then y of all.
    static void noise_in_lanes(const std::uint64_t* seeds, const double* deviations, std::int64_t hold,
                               std::int64_t first, std::size_t steps, Number* found);
};

}  // namespace fracgyro::testing
