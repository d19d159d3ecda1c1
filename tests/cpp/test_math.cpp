#include "scalars.hpp"

#include <random>

namespace fracgyro::testing {
namespace {

// Distance between floating-point numbers at |a|.
template <class T>
long double spacing(long double a) {
    const int exponent = std::max(std::ilogb(a), std::numeric_limits<T>::min_exponent - 1);
    return std::ldexp(1.0L, exponent - (std::numeric_limits<T>::digits - 1));
}

template <class T>
long double power_error(T base, T exponent) {
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(exponent));
    return std::abs(static_cast<long double>(power(base, exponent)) - wanted) / spacing<T>(wanted);
}

template <class T>
class Accuracy : public ::testing::Test {};
using FloatingPoints = ::testing::Types<double, float>;
TYPED_TEST_SUITE(Accuracy, FloatingPoints, ScalarNames);

TYPED_TEST(Accuracy, PowerIsWithin4UnitsInTheLastPlaceOfNormalNumbers) {
    using T = TypeParam;
    using Limits = std::numeric_limits<T>;
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::uniform_int_distribution<int> exponent_of_two(Limits::min_exponent, Limits::max_exponent);
    long double worst = 0.0L;
    for (int i = 0; i < 300'000; ++i) {
        const T base = std::ldexp(static_cast<T>(0.5 + 0.5 * unit(random)), exponent_of_two(random));
        const auto tiny = static_cast<T>(std::ldexp(unit(random), -(i % 50)));
        const T exponent = i % 2 == 0 ? tiny : T(1) - tiny;
        if (base <= Limits::max()) {
            worst = std::max(worst, power_error(base, exponent));
        }
    }
    for (const T base : {Limits::max(), Limits::min(), T(0.5), T(2), std::sqrt(T(0.5)), std::sqrt(T(2)),
                         std::nextafter(T(1), T(0)), std::nextafter(T(1), T(2))}) {
        for (const T exponent : {Limits::min(), Limits::epsilon(), T(1) / T(3), T(0.5), std::nextafter(T(1), T(0))}) {
            worst = std::max(worst, power_error(base, exponent));
        }
        EXPECT_LE(power_error(base, T(1)), 1.0L);
    }
    EXPECT_LE(worst, 4.0L);
    EXPECT_GT(worst, 0.5L);  // or the measure itself is broken
}

TYPED_TEST(Accuracy, PowerIsExactWhereTheAnswerIsObvious) {
    using T = TypeParam;
    using Limits = std::numeric_limits<T>;
    for (const T x : {T(0), T(1e-30), T(0.3), T(1), T(7), Limits::max()}) {
        EXPECT_EQ(power(x, T(0)), T(1));
    }
    for (const T exponent : {T(1e-6), T(0.1), T(0.5), T(1)}) {
        EXPECT_EQ(power(T(0), exponent), T(0));
        EXPECT_EQ(power(T(1), exponent), T(1));
        EXPECT_EQ(power(Limits::denorm_min(), exponent), power(Limits::min(), exponent));
    }
    EXPECT_EQ(power(T(256), T(0.125)), T(2));
    EXPECT_EQ(power(T(0.0625), T(0.75)), T(0.125));
}

TYPED_TEST(Accuracy, ExponentialOfANegativeNumberIsWithin4UnitsInTheLastPlace) {
    using T = TypeParam;
    // The last half unit of the logarithm of the normal range belongs to the values taken as 0.
    const double lowest = -0.693 * (-std::numeric_limits<T>::min_exponent);
    long double worst = 0.0L;
    for (int i = 0; i <= 100'000; ++i) {
        const auto x = static_cast<T>(lowest * i / 100'000);
        const long double wanted = std::exp(static_cast<long double>(x));
        worst = std::max(worst, std::abs(static_cast<long double>(exponential(x)) - wanted) / spacing<T>(wanted));
    }
    EXPECT_LE(worst, 4.0L);
    EXPECT_EQ(exponential(T(0)), T(1));
    EXPECT_EQ(exponential(static_cast<T>(lowest - 2.0)), T(0));
    EXPECT_EQ(exponential(-std::numeric_limits<T>::max()), T(0));
}

TYPED_TEST(Accuracy, ExponentialOfAPositiveNumberIsWithin4UnitsToo) {
    using T = TypeParam;
    const double highest = 0.693 * (std::numeric_limits<T>::max_exponent - 1);
    long double worst = 0.0L;
    for (int i = 0; i <= 100'000; ++i) {
        const auto x = static_cast<T>(highest * i / 100'000);
        const long double wanted = std::exp(static_cast<long double>(x));
        worst = std::max(worst, std::abs(static_cast<long double>(exponential(x)) - wanted) / spacing<T>(wanted));
    }
    EXPECT_LE(worst, 4.0L);
    EXPECT_LT(exponential(std::numeric_limits<T>::max()), std::numeric_limits<T>::infinity());
}

TYPED_TEST(Accuracy, LogarithmIsWithin4UnitsInTheLastPlaceNearOneToo) {
    using T = TypeParam;
    using Limits = std::numeric_limits<T>;
    long double worst = 0.0L, worst_of_one_plus = 0.0L;
    const auto error = [](T found, long double wanted) {
        return std::abs(static_cast<long double>(found) - wanted) / spacing<T>(wanted);
    };
    for (int i = 1; i <= 100'000; ++i) {
        const auto near_one = static_cast<T>(1.0 + (i - 50'000) * 1e-5 * (i % 3 == 0 ? 1e-3 : 0.9));
        const T anywhere = std::ldexp(near_one, i % (Limits::max_exponent - 2) * (i % 2 == 0 ? 1 : -1));
        for (const T x : {near_one, anywhere}) {
            if (x >= Limits::min() && x != T(1)) {
                worst = std::max(worst, error(logarithm(x), std::log(static_cast<long double>(x))));
            }
        }
        const T small = std::ldexp(near_one, -(i % 60));
        for (const T x : {small, -small, T(1e8) * near_one}) {
            if (x > T(-1)) {
                worst_of_one_plus = std::max(worst_of_one_plus,
                                             error(logarithm_of_one_plus(x), std::log1p(static_cast<long double>(x))));
            }
        }
    }
    EXPECT_LE(worst, 4.0L);
    EXPECT_LE(worst_of_one_plus, 5.0L);
    EXPECT_EQ(logarithm(T(1)), T(0));
    EXPECT_EQ(logarithm_of_one_plus(T(0)), T(0));
}

TEST(Gamma, IsWithin4UnitsInTheLastPlaceFromOneToTwo) {
    long double worst = 0.0L;
    for (int i = 0; i <= 100'000; ++i) {
        const double x = 1.0 + i * 1e-5;
        const long double wanted = std::tgamma(static_cast<long double>(x));
        worst = std::max(worst, std::abs(static_cast<long double>(gamma_from_one_to_two(x)) - wanted) / 0x1p-53L);
    }
    EXPECT_LE(worst, 4.0L);
}

template <class T>
class Math : public ::testing::Test {};
TYPED_TEST_SUITE(Math, Scalars, ScalarNames);

template <Scalar T, class Phase>
void expect_sine_and_cosine(Phase phase) {
    constexpr long double turn = 6.283185307179586476925286766559L;
    const long double angle = turn * std::ldexp(static_cast<long double>(phase), -std::numeric_limits<Phase>::digits);
    const SineCosine<T> got = sine_cosine<T>(phase);
    ASSERT_NEAR(number(got.sine), static_cast<double>(std::sin(angle)), 1.5 * epsilon<T>) << "phase " << phase;
    ASSERT_NEAR(number(got.cosine), static_cast<double>(std::cos(angle)), 1.5 * epsilon<T>) << "phase " << phase;
}

TYPED_TEST(Math, SineAndCosineAreAccurateAtEveryAngle) {
    for (std::uint64_t i = 0; i < 100'000; ++i) {
        const std::uint64_t phase = i * 0x9E3779B97F4A7C15U;  // fills the circle evenly
        expect_sine_and_cosine<TypeParam>(phase);
        expect_sine_and_cosine<TypeParam>(static_cast<std::uint32_t>(phase >> 32));
    }
}

TYPED_TEST(Math, AQuarterTurnTakesSineToCosineExactly) {
    using T = TypeParam;
    constexpr std::uint64_t quarter = std::uint64_t{1} << 62;
    const double expected[4][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}};
    for (std::uint64_t i = 0; i < 4; ++i) {
        EXPECT_EQ(number(sine_cosine<T>(i * quarter).sine), expected[i][0]);
        EXPECT_EQ(number(sine_cosine<T>(i * quarter).cosine), expected[i][1]);
    }
    for (std::uint64_t phase = 1; phase < 16 * quarter / 17; phase += quarter / 17) {
        EXPECT_EQ(number(sine_cosine<T>(phase + quarter).sine), number(sine_cosine<T>(phase).cosine));
        EXPECT_EQ(number(sine_cosine<T>(phase + quarter).cosine), -number(sine_cosine<T>(phase).sine));
    }
}

TYPED_TEST(Math, VectorsAddSubtractAndScale) {
    using T = TypeParam;
    const Vec2<T> a = vec2<T>(3, 4);
    const Vec2<T> b = vec2<T>(1, -2);
    expect_equal(a + b, {4, 2});
    expect_equal(a - b, {2, 6});
    expect_equal(-a, {-3, -4});
    expect_equal(T(2.0) * a, {6, 8});
    expect_equal(a * b, {3, -8});
    EXPECT_EQ(number(norm(a)), 5.0);
    EXPECT_EQ(number(norm(Vec2<T>{})), 0.0);
    EXPECT_EQ(number(dot(a, b)), -5.0);
    EXPECT_EQ(number(cross(a, b)), -10.0);
    EXPECT_EQ(number(cross(b, a)), 10.0);
}

TYPED_TEST(Math, BothAxesOfAVectorAreTreatedAlike) {
    using T = TypeParam;
    const Vec2<T> a = vec2<T>(-4, 16);
    expect_equal(swapped(a), {16, -4});
    expect_equal(turned(a), {-16, -4});
    expect_equal(turned(vec2<T>(1, 0)), {0, 1});
    expect_equal(absolute(a), {4, 16});
    expect_equal(square_root(absolute(a)), {2, 4});
    expect_equal(reciprocal(a), {-0.25, 0.0625});
    expect_equal(maximum(a, T(3.0)), {3, 16});
    expect_equal(clamp(a, T(-3.0), T(5.0)), {-3, 5});
    expect_equal(with_sign_of(a, vec2<T>(1, 2)), {-1, 2});
    expect_equal(if_less(a, vec2<T>(0, 16), vec2<T>(1, 2), vec2<T>(3, 4)), {1, 4});
    expect_equal(norms(vec2<T>(3, 4), vec2<T>(-8, 6)), {5, 10});
}

TYPED_TEST(Math, AVectorInARegisterIsLaidOutAsItsTwoNumbers) {
    using T = TypeParam;
    struct OneAndVector {
        T one = T(1.0);
        Vec2<T> both = vec2<T>(2, 3);
    };
    static_assert(sizeof(OneAndVector) == 3 * sizeof(T) && alignof(OneAndVector) == alignof(T));
    const auto numbers = std::bit_cast<std::array<T, 3>>(OneAndVector{});
    EXPECT_EQ(number(numbers[1]), 2.0);
    EXPECT_EQ(number(numbers[2]), 3.0);
}

TYPED_TEST(Math, ASymmetricMatrixActsAsItsFourEntriesDo) {
    using T = TypeParam;
    const Sym2<T> a{T(1.0), T(2.0), T(3.0)};  // [[1, 2], [2, 3]]
    expect_equal(a * vec2<T>(10, 100), {210, 320});
    expect_equal(a + a, {2, 4, 6});
    expect_equal(a - a, {0, 0, 0});
    expect_equal(T(3.0) * a, {3, 6, 9});
    // ½ ([1, 2]ᵀ[3, 4] + [3, 4]ᵀ[1, 2]) = ½ ([[3, 4], [6, 8]] + [[3, 6], [4, 8]])
    expect_equal(symmetric_product(vec2<T>(1, 2), vec2<T>(3, 4)), {3, 5, 8});
}

TYPED_TEST(Math, SelectionIsByTheFirstArgument) {
    using T = TypeParam;
    EXPECT_EQ(number(if_less(T(-1.0), T(0.0), T(1.0), T(2.0))), 1.0);
    EXPECT_EQ(number(if_less(T(0.0), T(0.0), T(1.0), T(2.0))), 2.0);
    EXPECT_TRUE(always_less(T(0.0), T(1.0)));
    EXPECT_FALSE(always_less(T(0.0), T(0.0)));
    EXPECT_EQ(number(maximum(T(1.0), T(2.0))), 2.0);
    EXPECT_EQ(number(minimum(T(1.0), T(2.0))), 1.0);
    EXPECT_EQ(number(absolute(T(-3.0))), 3.0);
    EXPECT_EQ(number(with_sign_of(T(-0.1), T(5.0))), -5.0);
    EXPECT_EQ(number(with_sign_of(T(0.1), T(5.0))), 5.0);
    EXPECT_EQ(number(clamp(T(7.0), T(-1.0), T(1.0))), 1.0);
    EXPECT_EQ(number(clamp(T(-7.0), T(-1.0), T(1.0))), -1.0);
    EXPECT_EQ(number(clamp(T(0.5), T(-1.0), T(1.0))), 0.5);
}

}  // namespace
}  // namespace fracgyro::testing
