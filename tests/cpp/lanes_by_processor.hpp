// Results of the lanes of one kind of processor, number by number, for a test that first checks the processor. Each
// kind is compiled separately, with the flags that it ships with.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fracgyro::testing {

inline constexpr std::size_t operations = 10, longest_noise = 200;

template <class Number, std::size_t Bytes>
struct LanesOf {
    static constexpr std::size_t count = Bytes / sizeof(Number);

    static void power(const Number* base, const Number* exponent, Number* found);
    // For each pair: a + b, a - b, a b, -a, maximum, minimum, |a|, |b| with a's sign, 1 if a < b and 2 otherwise, √|b|.
    static void arithmetic(const Number* a, const Number* b, Number* found);
    static bool each_is_less(const Number* a, const Number* b);
    // Noise of the steps first, first + 1, …: x and y of each.
    static void noise(std::uint64_t seed, std::uint32_t stream, std::int64_t hold, std::int64_t first,
                      std::size_t steps, double* found);
    // Noise of one seed per lane: at each step x of all, then y of all.
    static void noise_in_lanes(const std::uint64_t* seeds, const double* deviations, std::int64_t hold,
                               std::int64_t first, std::size_t steps, Number* found);
};

}  // namespace fracgyro::testing
