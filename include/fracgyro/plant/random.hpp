// Random numbers as a function of only (seed, stream, index): counter-based (Philox4x32-10; Salmon et al., "Parallel
// random numbers: as easy as 1, 2, 3", 2011) with Box-Muller normals. Any part can be drawn in any order.
#pragma once

#include "fracgyro/core/elementary.hpp"

namespace fracgyro {

using PhiloxBlock = std::array<std::uint32_t, 4>;

inline PhiloxBlock philox(std::uint64_t key, PhiloxBlock counter) {
    auto k0 = static_cast<std::uint32_t>(key);
    auto k1 = static_cast<std::uint32_t>(key >> 32);
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t a = std::uint64_t{0xD2511F53U} * counter[0];
        const std::uint64_t b = std::uint64_t{0xCD9E8D57U} * counter[2];
        counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ k0, static_cast<std::uint32_t>(b),
                   static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ k1, static_cast<std::uint32_t>(a)};
        k0 += 0x9E3779B9U;
        k1 += 0xBB67AE85U;
    }
    return counter;
}

// Standard normals of as many holds as there are entries, from hold `first` on, which must be even: every block of four
// words serves two holds. In single precision, which the vector registers hold more of and whose rounding is far below
// what any statistic of noise can see. The loops are over independent entries, of which the compiler makes vectors.
template <std::size_t Holds>
struct Normals {
    std::array<float, Holds> x{}, y{};

    void draw(std::uint64_t seed, std::uint64_t first, std::uint32_t stream) {
        std::array<std::uint32_t, Holds> radial{}, angular{};
        for (std::size_t i = 0; i < Holds / 2; ++i) {
            const std::uint64_t block = first / 2 + i;
            const PhiloxBlock words =
                philox(seed, {static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(block >> 32), stream, 0});
            radial[2 * i] = words[0];
            angular[2 * i] = words[1];
            radial[2 * i + 1] = words[2];
            angular[2 * i + 1] = words[3];
        }
        for (std::size_t i = 0; i < Holds; ++i) {
            // In (0, 1]: |normal| <= 6.8. The lowest bit is given up so that the conversion is that of a signed
            // integer.
            const float uniform = (static_cast<float>(static_cast<std::int32_t>(radial[i] >> 1)) + 0.5F) * 0x1p-31F;
            float exponent = 0.0F;
            const float fraction = detail::log2_split(uniform, exponent);
            constexpr float minus_two_ln2 = -1.38629436111989061883F;
            const float radius = std::sqrt(minus_two_ln2 * (exponent + fraction));
            const SineCosine<float> angle = sine_cosine<float>(angular[i]);
            x[i] = radius * angle.cosine;
            y[i] = radius * angle.sine;
        }
    }
};

}  // namespace fracgyro
