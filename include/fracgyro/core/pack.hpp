// A few numbers in one register, where the processor has such registers.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>

namespace fracgyro {

// Whether the processor has registers of four floating-point numbers. Code exported for several processors says no for
// all: its coefficients are laid out alike.
#ifndef FRACGYRO_PACKS
#if defined(__SSE2__) || defined(__ARM_NEON)
#define FRACGYRO_PACKS true
#else
#define FRACGYRO_PACKS false
#endif
#endif

// A few numbers that go through the same arithmetic. For built-in types the compiler's own vector, which becomes
// whatever registers the processor has; element by element the operations and their results are those of T.
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
