// Several runs in one vector register: a number type for which the core simulates `Count` runs at once, one in each
// lane.
#pragma once

#include "fracgyro/core/phase.hpp"

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>  // compiles in a tenth of the time
#endif

namespace fracgyro {

// Alignment does not depend on the target processor, as blocks pass between code compiled for different ones. Written
// out for each type: GCC 12 mistakes a vector of dependent type or size for its element in overloaded functions.
template <class Number, std::size_t Count>
struct Registers;
#define FRACGYRO_REGISTERS(NUMBER, COUNT, BITS, BYTES)                                         \
    template <>                                                                                \
    struct Registers<NUMBER, COUNT> {                                                          \
        using Numbers [[gnu::vector_size(BYTES), gnu::aligned(BYTES)]] = NUMBER;               \
        using Integers [[gnu::vector_size(BYTES), gnu::aligned(BYTES)]] = std::int##BITS##_t;  \
        using Unsigned [[gnu::vector_size(BYTES), gnu::aligned(BYTES)]] = std::uint##BITS##_t; \
    };
FRACGYRO_REGISTERS(double, 2, 64, 16)
FRACGYRO_REGISTERS(double, 4, 64, 32)
FRACGYRO_REGISTERS(double, 8, 64, 64)
FRACGYRO_REGISTERS(float, 4, 32, 16)
FRACGYRO_REGISTERS(float, 8, 32, 32)
FRACGYRO_REGISTERS(float, 16, 32, 64)
#undef FRACGYRO_REGISTERS

template <class OneNumber, std::size_t Count>
struct alignas(Count * sizeof(OneNumber)) Lanes {
    using Number = OneNumber;
    using Register = typename Registers<Number, Count>::Numbers;
    using Integers = typename Registers<Number, Count>::Integers;
    static constexpr std::size_t count = Count;
    Register lane{};

    constexpr Lanes() = default;
    template <class One>
        requires std::is_arithmetic_v<One>
    constexpr explicit Lanes(One a) : lane(Register{} + static_cast<Number>(a)) {}
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
    friend bool always_less(Lanes a, Lanes b) {
        constexpr bool doubles = sizeof(Number) == sizeof(double);
#ifdef __AVX512F__
        if constexpr (sizeof(Register) == 64 && doubles) {
            return _mm512_cmp_pd_mask(a.lane, b.lane, _CMP_LT_OQ) == 0xFF;
        } else if constexpr (sizeof(Register) == 64) {
            return _mm512_cmp_ps_mask(a.lane, b.lane, _CMP_LT_OQ) == 0xFFFF;
        }
#endif
#ifdef __AVX__
        if constexpr (sizeof(Register) == 32 && doubles) {
            return _mm256_movemask_pd(_mm256_cmp_pd(a.lane, b.lane, _CMP_LT_OQ)) == 0xF;
        } else if constexpr (sizeof(Register) == 32) {
            return _mm256_movemask_ps(_mm256_cmp_ps(a.lane, b.lane, _CMP_LT_OQ)) == 0xFF;
        }
#endif
#ifdef __SSE2__
        if constexpr (sizeof(Register) == 16 && doubles) {
            return _mm_movemask_pd(_mm_cmplt_pd(a.lane, b.lane)) == 0x3;
        } else if constexpr (sizeof(Register) == 16) {
            return _mm_movemask_ps(_mm_cmplt_ps(a.lane, b.lane)) == 0xF;
        }
#endif
        bool all = true;
        for (std::size_t k = 0; k < Count; ++k) {
            all = all && a.lane[k] < b.lane[k];
        }
        return all;
    }
    friend constexpr Lanes maximum(Lanes a, Lanes b) { return of(a.lane < b.lane ? b.lane : a.lane); }
    friend constexpr Lanes minimum(Lanes a, Lanes b) { return of(b.lane < a.lane ? b.lane : a.lane); }
    friend Lanes absolute(Lanes a) { return of(std::bit_cast<Register>(a.bits() & ~sign_bit())); }
    friend Lanes with_sign_of(Lanes sign, Lanes magnitude) {
        return of(std::bit_cast<Register>((sign.bits() & sign_bit()) | magnitude.bits()));
    }
    friend Lanes square_root(Lanes a) {
        constexpr bool doubles = sizeof(Number) == sizeof(double);
#ifdef __AVX512F__
        if constexpr (sizeof(Register) == 64 && doubles) {
            return of(Register(_mm512_maskz_sqrt_pd(0xFF, a.lane)));
        } else if constexpr (sizeof(Register) == 64) {
            return of(Register(_mm512_maskz_sqrt_ps(0xFFFF, a.lane)));
        }
#endif
#ifdef __AVX__
        if constexpr (sizeof(Register) == 32 && doubles) {
            return of(Register(_mm256_sqrt_pd(a.lane)));
        } else if constexpr (sizeof(Register) == 32) {
            return of(Register(_mm256_sqrt_ps(a.lane)));
        }
#endif
#ifdef __SSE2__
        if constexpr (sizeof(Register) == 16 && doubles) {
            return of(Register(_mm_sqrt_pd(a.lane)));
        } else if constexpr (sizeof(Register) == 16) {
            return of(Register(_mm_sqrt_ps(a.lane)));
        }
#endif
        for (std::size_t k = 0; k < Count; ++k) {
            a.lane[k] = std::sqrt(a.lane[k]);
        }
        return a;
    }

private:
    Integers bits() const { return std::bit_cast<Integers>(lane); }
    static Integers sign_bit() { return std::bit_cast<Integers>(-Register{}); }
};

template <class Number, std::size_t Count>
struct detail::Bits<Lanes<Number, Count>> : detail::Bits<Number> {
    using Integer = typename Registers<Number, Count>::Integers;
    using Unsigned = typename Registers<Number, Count>::Unsigned;
};

// Phases of the reference, one in each lane, as words that stay in their lane whatever the size of its numbers.
template <class Number, std::size_t Count>
struct Phases {
    using Word = std::conditional_t<sizeof(Number) == 8, std::uint64_t, std::uint32_t>;
    static constexpr std::size_t words = sizeof(std::uint64_t) / sizeof(Word);
    struct alignas(Count * sizeof(Word)) Words {
        std::array<Word, Count> lane{};
    };
    std::array<Words, words> word{};  // lowest first

    std::uint64_t at(std::size_t k) const {
        std::uint64_t phase = 0;
        for (std::size_t w = 0; w < words; ++w) {
            phase |= std::uint64_t{word[w].lane[k]} << (w * sizeof(Word) * 8);
        }
        return phase;
    }
    friend Phases operator+(const Phases& a, std::uint64_t b) {
        return each([&](std::size_t k) { return a.at(k) + b; });
    }
    friend Phases operator+(const Phases& a, const Phases& b) {
        return each([&](std::size_t k) { return a.at(k) + b.at(k); });
    }
    friend Phases operator*(std::uint64_t factor, const Phases& a) {
        return each([&](std::size_t k) { return factor * a.at(k); });
    }
    // The phase that each lane makes.
    template <class Phase>
    static Phases each(Phase&& phase) {
        Phases result;
        for (std::size_t k = 0; k < Count; ++k) {
            for (std::size_t w = 0; w < words; ++w) {
                result.word[w].lane[k] = static_cast<Word>(phase(k) >> (w * sizeof(Word) * 8));
            }
        }
        return result;
    }
};

template <class Number, std::size_t Count>
struct PhaseOf<Lanes<Number, Count>> {
    using Type = Phases<Number, Count>;
    static SineCosine<Lanes<Number, Count>> sine_cosine(const Type& phase) {
        SineCosine<Lanes<Number, Count>> result;
        for (std::size_t k = 0; k < Count; ++k) {
            const auto [sine, cosine] = fracgyro::sine_cosine<Number>(phase.at(k));
            result.sine.lane[k] = sine;
            result.cosine.lane[k] = cosine;
        }
        return result;
    }
    static Type after(const Type& phase, const Lanes<Number, Count>& turns) {
        return Type::each([&](std::size_t k) { return phase_after(phase.at(k), static_cast<Number>(turns.lane[k])); });
    }
    static Lanes<Number, Count> turns(const Type& phase) {
        Lanes<Number, Count> result;
        for (std::size_t k = 0; k < Count; ++k) {
            result.lane[k] = turns_of<Number>(phase.at(k));
        }
        return result;
    }
};

}  // namespace fracgyro
