// A few numbers in one register, if the processor has such registers.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>

namespace fracgyro {

// True if the processor has registers of four floating-point numbers. False in code exported for several processors:
// its coefficients have the same layout on all.
#ifndef FRACGYRO_PACKS
#if defined(__SSE2__) || defined(__ARM_NEON)
#define FRACGYRO_PACKS true
#else
#define FRACGYRO_PACKS false
#endif
#endif

// A few numbers that undergo the same arithmetic. For built-in types the compiler's own vector, which uses the
// registers of the processor; each element has the operations and results of T.
template <Scalar T, std::size_t Count>
struct PackOf {
    struct Type {
        std::array<T, Count> entry{};
        constexpr T& operator[](std::size_t k) { return entry[k]; }
        constexpr const T& operator[](std::size_t k) const { return entry[k]; }
        friend constexpr Type operator+(Type a, const Type& b) {
            for (std::size_t k = 0; k < Count; ++k) {
                a[k] = a[k] + b[k];
            }
            return a;
        }
        friend constexpr Type operator*(Type a, const Type& b) {
            for (std::size_t k = 0; k < Count; ++k) {
                a[k] = a[k] * b[k];
            }
            return a;
        }
    };
};
template <Scalar T, std::size_t Count>
    requires(std::floating_point<T> && FRACGYRO_PACKS)
struct PackOf<T, Count> {
    using Type [[gnu::vector_size(Count * sizeof(T))]] = T;
};

}  // namespace fracgyro
