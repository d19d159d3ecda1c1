// The lanes as they ship where the processor has AVX2 and fused multiply-add: compiled with that file's own flags.
#include "fracgyro/block.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fracgyro::testing {
namespace {

bool processor_has_avx2() { return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0; }

double units_off(double found, double base, double exponent) {
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    const int scale = std::max(std::ilogb(wanted), std::numeric_limits<double>::min_exponent - 1);
    return static_cast<double>(std::abs(found - wanted) / std::ldexp(1.0L, scale - 52));
}

TEST(Lanes, PowerIsWithin4UnitsInTheLastPlaceOverTheWholeRange) {
    if (!processor_has_avx2()) {
        GTEST_SKIP() << "this processor has no AVX2";
    }
    std::mt19937_64 random(2);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::uniform_int_distribution<int> exponent_of_two(-1074, 1024);
    double worst = 0.0;
    for (int i = 0; i < 100'000; ++i) {
        Lanes<double, 4> base, exponent;
        for (std::size_t k = 0; k < 4; ++k) {
            base.lane[k] = std::min(std::ldexp(0.5 + 0.5 * unit(random), exponent_of_two(random)), 1.7e308);
            const double tiny = std::ldexp(unit(random), -(i % 50));
            exponent.lane[k] = i % 2 == 0 ? tiny : 1.0 - tiny;
        }
        const Lanes<double, 4> found = power(base, exponent);
        for (std::size_t k = 0; k < 4; ++k) {
            if (base.lane[k] > 0.0) {
                worst = std::max(worst, units_off(found.lane[k], base.lane[k], exponent.lane[k]));
            }
        }
    }
    EXPECT_LE(worst, 4.0);
    EXPECT_GT(worst, 0.5);  // or the measure itself is broken
    const Lanes<double, 4> zero(0.0), one(1.0), half(0.5);
    EXPECT_EQ(power(zero, half).lane[0], 0.0);
    EXPECT_EQ(power(zero, zero).lane[1], 1.0);
    EXPECT_EQ(power(one, half).lane[2], 1.0);
}

TEST(Lanes, DoWhatTheirNumbersDo) {
    if (!processor_has_avx2()) {
        GTEST_SKIP() << "this processor has no AVX2";
    }
    Lanes<double, 4> a, b;
    const double left[] = {-2.0, 0.0, 3.0, -0.0}, right[] = {1.0, 0.0, -4.0, 5.0};
    for (std::size_t k = 0; k < 4; ++k) {
        a.lane[k] = left[k];
        b.lane[k] = right[k];
    }
    for (std::size_t k = 0; k < 4; ++k) {
        const double l = left[k], r = right[k];
        EXPECT_EQ((a + b).lane[k], l + r);
        EXPECT_EQ((a - b).lane[k], l - r);
        EXPECT_EQ((a * b).lane[k], l * r);
        EXPECT_EQ((-a).lane[k], -l);
        EXPECT_EQ(maximum(a, b).lane[k], maximum(l, r));
        EXPECT_EQ(minimum(a, b).lane[k], minimum(l, r));
        EXPECT_EQ(absolute(a).lane[k], std::fabs(l));
        EXPECT_EQ(std::signbit(with_sign_of(a, absolute(b)).lane[k]), std::signbit(l));
        EXPECT_EQ(if_less(a, b, Lanes<double, 4>(1.0), Lanes<double, 4>(2.0)).lane[k], l < r ? 1.0 : 2.0);
        EXPECT_EQ(square_root(absolute(b)).lane[k], std::sqrt(std::fabs(r)));
    }
    EXPECT_FALSE(always_less(a, b));
    EXPECT_TRUE(always_less(a, Lanes<double, 4>(4.0)));
    EXPECT_FALSE(always_less(a, Lanes<double, 4>(std::numeric_limits<double>::quiet_NaN())));
}

}  // namespace
}  // namespace fracgyro::testing
