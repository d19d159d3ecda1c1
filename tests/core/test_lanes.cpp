// The lanes as they ship where the processor has AVX2 and fused multiply-add: compiled with that file's own flags.
#include "fracgyro/block.hpp"

#include <gtest/gtest.h>

#include <random>

namespace fracgyro::testing {
namespace {

bool processor_has_avx2() { return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0; }

template <class Number>
double units_off(Number found, Number base, Number exponent) {
    using Limits = std::numeric_limits<Number>;
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    const int scale = std::max(std::ilogb(wanted), Limits::min_exponent - 1);
    return static_cast<double>(std::abs(static_cast<long double>(found) - wanted) /
                               std::ldexp(1.0L, scale - (Limits::digits - 1)));
}

template <class Number>
void expect_power_within_4_units() {
    constexpr std::size_t count = 32 / sizeof(Number);
    using T = Lanes<Number, count>;
    using Limits = std::numeric_limits<Number>;
    std::mt19937_64 random(2);
    std::uniform_real_distribution<Number> unit(0, 1);
    std::uniform_int_distribution<int> exponent_of_two(Limits::min_exponent, Limits::max_exponent);
    double worst = 0.0;
    for (int i = 0; i < 100'000; ++i) {
        T base, exponent;
        for (std::size_t k = 0; k < count; ++k) {
            const Number fraction = Number(0.5) + Number(0.5) * unit(random);
            base.lane[k] = std::min(std::ldexp(fraction, exponent_of_two(random)), Limits::max());
            const Number tiny = std::ldexp(unit(random), -(i % 50));
            exponent.lane[k] = i % 2 == 0 ? tiny : 1 - tiny;
        }
        const T found = power(base, exponent);
        for (std::size_t k = 0; k < count; ++k) {
            const Number b = base.lane[k], e = exponent.lane[k], f = found.lane[k];
            worst = std::max(worst, units_off<Number>(f, b, e));
        }
    }
    EXPECT_LE(worst, 4.0);
    EXPECT_GT(worst, 0.5);  // or the measure itself is broken
    const T zero(0.0), one(1.0), half(0.5);
    EXPECT_EQ(power(zero, half).lane[0], Number(0));
    EXPECT_EQ(power(zero, zero).lane[1], Number(1));
    EXPECT_EQ(power(one, half).lane[2], Number(1));
}

TEST(Lanes, PowerIsWithin4UnitsInTheLastPlaceOfNormalNumbers) {
    if (!processor_has_avx2()) {
        GTEST_SKIP() << "this processor has no AVX2";
    }
    expect_power_within_4_units<double>();
    expect_power_within_4_units<float>();
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
