// The lanes as they ship for each kind of processor, on those that this one can stand in for.
#include "lanes_by_processor.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>

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
struct Lanes : ::testing::Test {
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
TYPED_TEST_SUITE(Lanes, Kinds);

template <class Number>
double units_off(Number found, Number base, Number exponent) {
    using Limits = std::numeric_limits<Number>;
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    const int scale = std::max(std::ilogb(wanted), Limits::min_exponent - 1);
    return static_cast<double>(std::abs(static_cast<long double>(found) - wanted) /
                               std::ldexp(1.0L, scale - (Limits::digits - 1)));
}

TYPED_TEST(Lanes, PowerIsWithin4UnitsInTheLastPlaceOfNormalNumbers) {
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

TYPED_TEST(Lanes, DoWhatTheirNumbersDo) {
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

TYPED_TEST(Lanes, AreAlwaysLessWhereEachIs) {
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

}  // namespace
}  // namespace fracgyro::testing
