// The shipped lanes of each kind of processor, as far as this processor supports them.
#include "lanes_by_processor.hpp"

#include "fracgyro/sim/lane_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

namespace fracgyro::testing {
namespace {

template <std::size_t Bytes>
bool processor_has_registers() {
#ifdef FRACGYRO_LANES_X86
    if constexpr (Bytes == 32) {
        return __builtin_cpu_supports("avx2") != 0;
    }
    if constexpr (Bytes == 64) {
        return __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512dq") != 0 &&
               __builtin_cpu_supports("avx512vl") != 0;
    }
#endif
    return true;
}

template <class NumberOfLane, std::size_t Bytes>
struct Kind {
    using Number = NumberOfLane;
    using Checked = LanesOf<Number, Bytes>;
    static constexpr std::size_t bytes = Bytes;
};

template <class K>
struct EachKind : ::testing::Test {
    void SetUp() override {
        if (!processor_has_registers<K::bytes>()) {
            GTEST_SKIP() << "this processor has no registers of " << K::bytes << " bytes";
        }
    }
};
#ifdef FRACGYRO_LANES_X86
using Kinds = ::testing::Types<Kind<double, 16>, Kind<float, 16>, Kind<double, 32>, Kind<float, 32>, Kind<double, 64>,
                               Kind<float, 64>>;
#else
using Kinds = ::testing::Types<Kind<double, 16>, Kind<float, 16>>;
#endif
TYPED_TEST_SUITE(EachKind, Kinds);

template <class Number>
double units_off(Number found, Number base, Number exponent) {
    using Limits = std::numeric_limits<Number>;
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    const int scale = std::max(std::ilogb(wanted), Limits::min_exponent - 1);
    return static_cast<double>(std::abs(static_cast<long double>(found) - wanted) /
                               std::ldexp(1.0L, scale - (Limits::digits - 1)));
}

TYPED_TEST(EachKind, PowerIsWithin4UnitsInTheLastPlaceOfNormalNumbers) {
    using Number = typename TypeParam::Number;
    using Checked = typename TypeParam::Checked;
    using Limits = std::numeric_limits<Number>;
    std::mt19937_64 random(2);
    const auto unit = [&] { return static_cast<Number>(std::ldexp(static_cast<double>(random() >> 40), -24)); };
    std::array<Number, Checked::count> base, exponent, found;
    double worst = 0.0;
    for (int i = 0; i < 100'000; ++i) {
        for (std::size_t k = 0; k < Checked::count; ++k) {
            const Number fraction = Number(0.5) + Number(0.5) * unit();
            const auto powers = static_cast<std::uint64_t>(Limits::max_exponent - Limits::min_exponent + 1);
            const int power_of_two = Limits::min_exponent + static_cast<int>(random() % powers);
            base[k] = std::min(std::ldexp(fraction, power_of_two), Limits::max());
            const Number tiny = std::ldexp(unit(), -(i % 50));
            exponent[k] = i % 2 == 0 ? tiny : 1 - tiny;
        }
        Checked::power(base.data(), exponent.data(), found.data());
        for (std::size_t k = 0; k < Checked::count; ++k) {
            worst = std::max(worst, units_off(found[k], base[k], exponent[k]));
        }
    }
    EXPECT_LE(worst, 4.0);
    EXPECT_GT(worst, 0.5);  // or the measure itself is broken
    const auto of = [&](Number b, Number e) {
        base.fill(b);
        exponent.fill(e);
        Checked::power(base.data(), exponent.data(), found.data());
        return found.back();
    };
    EXPECT_EQ(of(0, Number(0.5)), Number(0));
    EXPECT_EQ(of(0, 0), Number(1));
    EXPECT_EQ(of(1, Number(0.5)), Number(1));
}

TYPED_TEST(EachKind, DoWhatTheirNumbersDo) {
    using Number = typename TypeParam::Number;
    using Checked = typename TypeParam::Checked;
    constexpr std::size_t count = Checked::count;
    const Number pairs[][2] = {{-2, 1}, {0, 0}, {3, -4}, {-Number(0), 5}};
    std::array<Number, count> a, b;
    std::array<Number, operations * count> found;
    for (std::size_t first = 0; first < 4; first += std::min<std::size_t>(count, 4)) {
        for (std::size_t k = 0; k < count; ++k) {
            a[k] = pairs[(first + k) % 4][0];
            b[k] = pairs[(first + k) % 4][1];
        }
        Checked::arithmetic(a.data(), b.data(), found.data());
        for (std::size_t k = 0; k < count; ++k) {
            const Number l = a[k], r = b[k];
            const auto operation = [&](std::size_t i) { return found[i * count + k]; };
            EXPECT_EQ(operation(0), l + r);
            EXPECT_EQ(operation(1), l - r);
            EXPECT_EQ(operation(2), l * r);
            EXPECT_EQ(operation(3), -l);
            EXPECT_EQ(operation(4), std::max(l, r));
            EXPECT_EQ(operation(5), std::min(l, r));
            EXPECT_EQ(operation(6), std::fabs(l));
            EXPECT_EQ(operation(7), std::copysign(r, l));
            EXPECT_EQ(std::signbit(operation(7)), std::signbit(l));
            EXPECT_EQ(operation(8), l < r ? Number(1) : Number(2));
            EXPECT_EQ(operation(9), std::sqrt(std::fabs(r)));
        }
    }
}

TYPED_TEST(EachKind, AreAlwaysLessWhereEachIs) {
    using Number = typename TypeParam::Number;
    using Checked = typename TypeParam::Checked;
    std::array<Number, Checked::count> small, large;
    small.fill(1);
    large.fill(2);
    EXPECT_TRUE(Checked::each_is_less(small.data(), large.data()));
    small.back() = 2;
    EXPECT_FALSE(Checked::each_is_less(small.data(), large.data()));
    small.back() = std::numeric_limits<Number>::quiet_NaN();
    EXPECT_FALSE(Checked::each_is_less(small.data(), large.data()));
}

// Steps and holds at which something restarts: odd ones, a register's, a block of normals', and where the count of
// blocks passes 2^32.
struct Part {
    std::int64_t hold, first;
    std::size_t steps;
};
std::vector<Part> parts() {
    std::vector<Part> all;
    for (const std::int64_t hold : {1, 2, 3, 1000}) {
        const std::int64_t far = (std::int64_t{1} << 33) * hold;
        for (const std::int64_t first : {std::int64_t{0}, std::int64_t{1}, std::int64_t{63}, 31 * hold - 1, far - 77}) {
            for (const std::size_t steps : {1, 2, 17, 64, 200}) {
                all.push_back({hold, first, steps});
            }
        }
    }
    return all;
}
constexpr std::uint64_t seeds[] = {0, 5, std::uint64_t{1} << 32, ~std::uint64_t{0}};

// One word at a time, which every processor can.
std::vector<double> noise_by_words(std::uint64_t seed, double deviation, const Part& part, std::uint32_t stream = 0) {
    std::vector<Vec2<double>> drawn(part.steps);
    fill_noise<8>({.standard_deviation = deviation, .hold = part.hold, .seed = seed, .stream = stream}, part.first,
                  drawn);
    std::vector<double> found;
    for (const auto& d : drawn) {
        found.insert(found.end(), {d.x(), d.y()});
    }
    return found;
}

TEST(Noise, HasTheBitsThatItEverHad) {
    EXPECT_EQ(noise_by_words(0, 1.0, {1, 0, 3}), std::vector<double>({0x1.fb7662p-1, -0x1.d96d6p-1, -0x1.3c373ep-1,
                                                                      -0x1.eda364p-2, -0x1.3aa6a8p-3, 0x1.7254d2p-3}));
    std::uint64_t hash = 0xCBF29CE484222325U;  // FNV-1a
    for (const std::uint64_t seed : seeds) {
        for (const Part& part : parts()) {
            for (const std::uint32_t stream : {0U, 2U}) {
                for (const double number : noise_by_words(seed, 1.7, part, stream)) {
                    hash = (hash ^ std::bit_cast<std::uint64_t>(number)) * 0x100000001B3U;
                }
            }
        }
    }
    EXPECT_EQ(hash, 0xD7EA1628C2C5266EU);
}

TYPED_TEST(EachKind, DrawsTheSameNoise) {
    std::array<double, 2 * longest_noise> found;
    for (const std::uint64_t seed : seeds) {
        for (const Part& part : parts()) {
            for (const std::uint32_t stream : {0U, 2U}) {
                TypeParam::Checked::noise(seed, stream, part.hold, part.first, part.steps, found.data());
                const auto wanted = noise_by_words(seed, 1.7, part, stream);
                ASSERT_EQ(std::memcmp(found.data(), wanted.data(), wanted.size() * sizeof wanted[0]), 0)
                    << "seed " << seed << ", hold " << part.hold << ", from " << part.first << " on";
            }
        }
    }
}

TYPED_TEST(EachKind, DrawsTheSameNoiseInEveryLane) {
    using Number = typename TypeParam::Number;
    constexpr std::size_t count = TypeParam::Checked::count;
    std::array<std::uint64_t, count> seed;
    std::array<double, count> deviation;
    for (std::size_t k = 0; k < count; ++k) {
        seed[k] = seeds[k % 4] + 3 * k;
        deviation[k] = 0.1 * static_cast<double>(k + 1);
    }
    std::vector<Number> found(2 * count * longest_noise);
    for (const Part& part : parts()) {
        TypeParam::Checked::noise_in_lanes(seed.data(), deviation.data(), part.hold, part.first, part.steps,
                                           found.data());
        for (std::size_t k = 0; k < count; ++k) {
            const auto wanted = noise_by_words(seed[k], deviation[k], part);
            for (std::size_t i = 0; i < wanted.size(); ++i) {
                ASSERT_EQ(found[i * count + k], static_cast<Number>(wanted[i]))
                    << "lane " << k << ", hold " << part.hold << ", step " << part.first << " + " << i / 2;
            }
        }
    }
}

TEST(LaneNoise, IsForRunsWithNoiseOfTheSameHoldAndStream) {
    const DisturbanceParams one{.kind = DisturbanceKind::noise, .standard_deviation = 3.0, .hold = 2, .seed = 7};
    DisturbanceParams other = one;
    other.seed = 8;
    const auto noise = LaneNoise<2>::of({one, other});
    ASSERT_TRUE(noise);
    EXPECT_EQ(noise->seed, (std::array<std::uint64_t, 2>{7, 8}));
    EXPECT_EQ(noise->standard_deviation, (std::array{3.0, 3.0}));
    EXPECT_EQ(noise->hold, 2);
    const auto none = [&](auto&& change) {
        DisturbanceParams changed = other;
        change(changed);
        return !LaneNoise<2>::of({one, changed});
    };
    EXPECT_TRUE(none([](DisturbanceParams& p) { p.kind = DisturbanceKind::sine; }));
    EXPECT_TRUE(none([](DisturbanceParams& p) { p.hold = 3; }));
    EXPECT_TRUE(none([](DisturbanceParams& p) { p.stream = 1; }));
    EXPECT_TRUE(none([](DisturbanceParams& p) { p.terms.push_back({.kind = TermKind::step}); }));
}

}  // namespace
}  // namespace fracgyro::testing
