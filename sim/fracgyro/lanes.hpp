// Several runs in one vector register: a number type for which the core simulates `Count` runs at once, one in each lane.
#pragma once

#include "fracgyro/reference.hpp"

#ifdef __SSE2__
#include <immintrin.h>
#endif

namespace fracgyro {

// Aligned alike whatever the processor compiled for, as blocks pass between code compiled for different ones.
// Spelt out for each size: GCC 12 mistakes a vector of dependent size for its element where functions are overloaded.
template <std::size_t Count>
struct Registers;
template <>
struct Registers<2> {
    using Numbers [[gnu::vector_size(16), gnu::aligned(16)]] = double;
    using Integers [[gnu::vector_size(16), gnu::aligned(16)]] = std::int64_t;
    using Unsigned [[gnu::vector_size(16), gnu::aligned(16)]] = std::uint64_t;
};
template <>
struct Registers<4> {
    using Numbers [[gnu::vector_size(32), gnu::aligned(32)]] = double;
    using Integers [[gnu::vector_size(32), gnu::aligned(32)]] = std::int64_t;
    using Unsigned [[gnu::vector_size(32), gnu::aligned(32)]] = std::uint64_t;
};
template <>
struct Registers<8> {
    using Numbers [[gnu::vector_size(64), gnu::aligned(64)]] = double;
    using Integers [[gnu::vector_size(64), gnu::aligned(64)]] = std::int64_t;
    using Unsigned [[gnu::vector_size(64), gnu::aligned(64)]] = std::uint64_t;
};

template <std::size_t Count>
struct alignas(Count * sizeof(double)) Lanes {
    using Register = typename Registers<Count>::Numbers;
    using Integers = typename Registers<Count>::Integers;
    static constexpr std::size_t count = Count;
    Register lane{};

    constexpr Lanes() = default;
    constexpr explicit Lanes(double a) : lane(Register{} + a) {}
    static constexpr Lanes of(Register a) {
        Lanes lanes;
        lanes.lane = a;
        return lanes;
    }

    friend constexpr Lanes operator+(Lanes a, Lanes b) { return of(a.lane + b.lane); }
    friend constexpr Lanes operator-(Lanes a, Lanes b) { return of(a.lane - b.lane); }
    friend constexpr Lanes operator*(Lanes a, Lanes b) { return of(a.lane * b.lane); }
    friend constexpr Lanes operator/(Lanes a, Lanes b) { return of(a.lane / b.lane); }
    friend constexpr Lanes operator-(Lanes a) { return of(-a.lane); }
    friend constexpr auto operator<(Lanes a, Lanes b) { return a.lane < b.lane; }

    friend constexpr Lanes if_less(Lanes a, Lanes b, Lanes yes, Lanes no) {
        return of(a.lane < b.lane ? yes.lane : no.lane);
    }
    friend constexpr bool always_less(Lanes a, Lanes b) {
        const auto less = a.lane < b.lane;
        auto all = less[0];
        for (std::size_t k = 1; k < Count; ++k) {
            all &= less[k];
        }
        return all != 0;
    }
    friend constexpr Lanes maximum(Lanes a, Lanes b) { return of(a.lane < b.lane ? b.lane : a.lane); }
    friend constexpr Lanes minimum(Lanes a, Lanes b) { return of(b.lane < a.lane ? b.lane : a.lane); }
    friend Lanes absolute(Lanes a) { return of(std::bit_cast<Register>(a.bits() & ~sign_bit())); }
    friend Lanes with_sign_of(Lanes sign, Lanes magnitude) {
        return of(std::bit_cast<Register>((sign.bits() & sign_bit()) | magnitude.bits()));
    }
    friend Lanes square_root(Lanes a) {
#ifdef __AVX512F__
        if constexpr (sizeof(Register) == 64) {
            return of(Register(_mm512_maskz_sqrt_pd(0xFF, a.lane)));
        }
#endif
#ifdef __AVX__
        if constexpr (sizeof(Register) == 32) {
            return of(Register(_mm256_sqrt_pd(a.lane)));
        }
#endif
#ifdef __SSE2__
        if constexpr (sizeof(Register) == 16) {
            return of(Register(_mm_sqrt_pd(a.lane)));
        }
#endif
        for (std::size_t k = 0; k < Count; ++k) {
            a.lane[k] = std::sqrt(a.lane[k]);
        }
        return a;
    }

private:
    Integers bits() const { return std::bit_cast<Integers>(lane); }
    static Integers sign_bit() { return Integers{} + std::numeric_limits<std::int64_t>::min(); }
};

template <std::size_t Count>
struct detail::Bits<Lanes<Count>> : detail::Bits<double> {
    using Integer = typename Registers<Count>::Integers;
    using Unsigned = typename Registers<Count>::Unsigned;
};

// The reference's phase: one in each lane.
template <std::size_t Count>
struct PhaseOf<Lanes<Count>> {
    using Type = typename Registers<Count>::Unsigned;
    static SineCosine<Lanes<Count>> sine_cosine(const Type& phase) {
        SineCosine<Lanes<Count>> result;
        for (std::size_t k = 0; k < Count; ++k) {
            const std::uint64_t one = phase[k];
            const auto [sine, cosine] = fracgyro::sine_cosine<double>(one);
            result.sine.lane[k] = sine;
            result.cosine.lane[k] = cosine;
        }
        return result;
    }
};

}  // namespace fracgyro
