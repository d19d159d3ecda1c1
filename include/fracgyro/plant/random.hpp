// Random numbers as a function of only (seed, stream, index): counter-based (Philox4x32-10; Salmon et al., "Parallel
// random numbers: as easy as 1, 2, 3", 2011) with Box-Muller normals. Any part can be drawn in any order.
#pragma once

#include "fracgyro/core/elementary.hpp"

#include <cstring>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>  // compiles in a tenth of the time
#endif

namespace fracgyro {

// 32-bit words, each in the lower half of a 64-bit lane, in a register of `Bytes` bytes; a single number if the
// processor has no such registers. The upper halves are ignored.
template <std::size_t Bytes>
struct WordLanes {
    using Words = std::uint64_t;
};
#define FRACGYRO_WORD_LANES(BYTES)                               \
    template <>                                                  \
    struct WordLanes<BYTES> {                                    \
        using Words [[gnu::vector_size(BYTES)]] = std::uint64_t; \
    };
FRACGYRO_WORD_LANES(16)
FRACGYRO_WORD_LANES(32)
FRACGYRO_WORD_LANES(64)
#undef FRACGYRO_WORD_LANES

// Registers that every processor of this kind has.
#ifdef __SSE2__
inline constexpr std::size_t word_bytes = 16;
#else
inline constexpr std::size_t word_bytes = 8;
#endif

// One block of four words per lane of a register, all at once.
template <std::size_t Bytes>
struct Philox {
    using Words = typename WordLanes<Bytes>::Words;
    static constexpr std::size_t lanes = Bytes / sizeof(std::uint64_t);
    static constexpr std::uint64_t lower = 0xFFFFFFFFU;

    static std::array<Words, 4> block(Words key, std::array<Words, 4> counter) {
        Words k0 = key, k1 = key >> 32;
        for (int round = 0; round < 10; ++round) {
            const Words a = product(counter[0], 0xD2511F53U), b = product(counter[2], 0xCD9E8D57U);
            counter = {(b >> 32) ^ counter[1] ^ k0, b, (a >> 32) ^ counter[3] ^ k1, a};
            k0 += 0x9E3779B9U;
            k1 += 0xBB67AE85U;
        }
        return counter;
    }

private:
    // The full product of two words. It is one instruction, which compilers do not find by themselves.
    static Words product(Words a, std::uint32_t b) {
#ifdef __AVX512F__
        if constexpr (Bytes == 64) {
            return Words(_mm512_maskz_mul_epu32(0xFF, __m512i(a), _mm512_set1_epi64(b)));
        }
#endif
#ifdef __AVX2__
        if constexpr (Bytes == 32) {
            return Words(_mm256_mul_epu32(__m256i(a), _mm256_set1_epi64x(b)));
        }
#endif
#ifdef __SSE2__
        if constexpr (Bytes == 16) {
            return Words(_mm_mul_epu32(__m128i(a), _mm_set1_epi64x(b)));
        }
#endif
        return (a & lower) * b;
    }
};

using PhiloxBlock = std::array<std::uint32_t, 4>;

inline PhiloxBlock philox(std::uint64_t key, const PhiloxBlock& counter) {
    const auto words = Philox<8>::block(key, {counter[0], counter[1], counter[2], counter[3]});
    const auto word = [&](std::size_t i) { return static_cast<std::uint32_t>(words[i]); };
    return {word(0), word(1), word(2), word(3)};
}

// Standard normals, several at once: every block of four words serves two holds, of two axes each. In single precision,
// of which vector registers hold more numbers and whose rounding is far below the resolution of any noise statistic.
template <std::size_t Bytes>
class Normals {
public:
    static constexpr std::size_t most = 64;
    std::array<float, most> x, y;

    // Draws the holds `first`, first + 1, … of one seed. `first` is even, count <= most.
    void draw(std::uint64_t seed, std::uint32_t stream, std::uint64_t first, std::size_t count) {
        const Words key = Words{} + seed;
        Words block = by_lane([&](std::size_t lane) { return first / 2 + lane; });
        for (std::size_t at = 0; at < whole(count); at += 2 * lanes) {
            const auto words = blocks(key, stream, block);
            put(radial_, at, words[0], words[2]);
            put(angular_, at, words[1], words[3]);
            block += lanes;
        }
        transform(count);
    }

    // Draws the holds first, first + 1, … of several seeds, an even number of them: the hold in `row` of seed k is at
    // place(row, k). `first` is even, rows·Seeds <= most.
    template <std::size_t Seeds>
    void draw(const std::array<std::uint64_t, Seeds>& seed, std::uint32_t stream, std::uint64_t first,
              std::size_t rows) {
        static_assert(Seeds % 2 == 0 && most % (2 * pairs<Seeds> * Seeds) == 0);
        const auto keys = [&](std::size_t odd) {
            return by_lane([&](std::size_t lane) { return seed[2 * (lane % (Seeds / 2)) + odd]; });
        };
        const Words even = keys(0), odd = keys(1);
        Words block = by_lane([&](std::size_t lane) { return first / 2 + lane / (Seeds / 2); });
        for (std::size_t at = 0; at < whole(rows * Seeds); at += 4 * lanes) {
            const auto a = blocks(even, stream, block), b = blocks(odd, stream, block);
            put(radial_, at, a[0], b[0]);
            put(angular_, at, a[1], b[1]);
            put(radial_, at + 2 * lanes, a[2], b[2]);
            put(angular_, at + 2 * lanes, a[3], b[3]);
            block += pairs<Seeds>;
        }
        transform(whole(rows * Seeds));
    }
    // Rows from the same words of different blocks are adjacent.
    template <std::size_t Seeds>
    static constexpr std::size_t place(std::size_t row, std::size_t seed) {
        constexpr std::size_t together = 2 * pairs<Seeds>;
        const std::size_t within = row % together;
        return (row - within + within % 2 * pairs<Seeds> + within / 2) * Seeds + seed;
    }

private:
    using Words = typename Philox<Bytes>::Words;
    static constexpr std::size_t lanes = Philox<Bytes>::lanes;
    // Pairs of holds in two registers of as many seeds.
    template <std::size_t Seeds>
    static constexpr std::size_t pairs = 2 * lanes / Seeds;
    static constexpr std::size_t whole(std::size_t count) { return (count + 15) / 16 * 16; }

    template <class Word>
    static Words by_lane(Word&& word) {
        std::array<std::uint64_t, lanes> words;
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            words[lane] = word(lane);
        }
        return std::bit_cast<Words>(words);
    }
    static auto blocks(Words key, std::uint32_t stream, Words block) {
        return Philox<Bytes>::block(key, {block, block >> 32, Words{} + stream, Words{}});
    }
    // Writes the words of both, alternating.
    static void put(std::array<std::uint32_t, most>& to, std::size_t at, Words even, Words odd) {
        static_assert(std::endian::native == std::endian::little);
        const Words both = (even & Philox<Bytes>::lower) | (odd << 32);
        std::memcpy(to.data() + at, &both, sizeof both);
    }
    // The loop is over independent entries, which compilers vectorize.
    void transform(std::size_t count) {
        for (std::size_t at = 0; at < count; at += 16) {
            for (std::size_t i = at; i < at + 16; ++i) {
                // Uniform in (0, 1]: |normal| <= 6.8. The lowest bit is dropped so that the conversion is from a signed
                // integer.
                const float uniform =
                    (static_cast<float>(static_cast<std::int32_t>(radial_[i] >> 1)) + 0.5F) * 0x1p-31F;
                float exponent = 0.0F;
                const float fraction = detail::log2_split(uniform, exponent);
                constexpr float minus_two_ln2 = -1.38629436111989061883F;
                const float radius = std::sqrt(minus_two_ln2 * (exponent + fraction));
                const SineCosine<float> angle = sine_cosine<float>(angular_[i]);
                x[i] = radius * angle.cosine;
                y[i] = radius * angle.sine;
            }
        }
    }

    std::array<std::uint32_t, most> radial_, angular_;
};

}  // namespace fracgyro
