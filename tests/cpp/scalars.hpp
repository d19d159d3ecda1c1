// The scalar types that every test runs on: double, float, and one that converts to and from double only explicitly.
#pragma once

#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/linear.hpp"

#include <gtest/gtest.h>

#include <string>

namespace fracgyro::testing {

// A double behind an explicit constructor. All its functions are hidden friends: the core must find them by
// argument-dependent lookup, as for any user's type.
class Explicit {
public:
    Explicit() = default;
    explicit constexpr Explicit(double value) : value_(value) {}
    explicit constexpr operator double() const { return value_; }

    friend constexpr Explicit operator+(Explicit a, Explicit b) { return Explicit(a.value_ + b.value_); }
    friend constexpr Explicit operator-(Explicit a, Explicit b) { return Explicit(a.value_ - b.value_); }
    friend constexpr Explicit operator*(Explicit a, Explicit b) { return Explicit(a.value_ * b.value_); }
    friend constexpr Explicit operator/(Explicit a, Explicit b) { return Explicit(a.value_ / b.value_); }
    friend constexpr Explicit operator-(Explicit a) { return Explicit(-a.value_); }
    friend constexpr bool operator<(Explicit a, Explicit b) { return a.value_ < b.value_; }

    friend Explicit square_root(Explicit a) { return Explicit(fracgyro::square_root(a.value_)); }
    friend Explicit power(Explicit base, Explicit exponent) {
        return Explicit(fracgyro::power(base.value_, exponent.value_));
    }
    friend Explicit exponential(Explicit a) { return Explicit(fracgyro::exponential(a.value_)); }
    friend Explicit logarithm(Explicit a) { return Explicit(fracgyro::logarithm(a.value_)); }

private:
    double value_ = 0.0;
};
static_assert(Scalar<Explicit>);

template <Scalar T>
double number(T a) {
    return static_cast<double>(a);
}

// Distance between 1 and the next number.
template <class T>
constexpr double epsilon = std::numeric_limits<double>::epsilon();
template <>
inline constexpr double epsilon<float> = static_cast<double>(std::numeric_limits<float>::epsilon());

template <Scalar T>
void expect_near(const Vec2<T>& got, const Vec2<double>& wanted, double tolerance) {
    EXPECT_NEAR(number(got.x()), wanted.x(), tolerance);
    EXPECT_NEAR(number(got.y()), wanted.y(), tolerance);
}
template <Scalar T>
void expect_near(const Sym2<T>& got, const Sym2<double>& wanted, double tolerance) {
    EXPECT_NEAR(number(got.xx()), wanted.xx(), tolerance);
    EXPECT_NEAR(number(got.xy()), wanted.xy(), tolerance);
    EXPECT_NEAR(number(got.yy()), wanted.yy(), tolerance);
}
template <Scalar T>
void expect_equal(const Vec2<T>& got, const Vec2<double>& wanted) {
    expect_near(got, wanted, 0.0);
}
template <Scalar T>
void expect_equal(const Sym2<T>& got, const Sym2<double>& wanted) {
    expect_near(got, wanted, 0.0);
}

template <Scalar T>
Vec2<T> vec2(double x, double y) {
    return {T(x), T(y)};
}

using Scalars = ::testing::Types<double, float, Explicit>;

struct ScalarNames {
    template <class T>
    static std::string GetName(int) {
        return std::is_same_v<T, double> ? "double" : std::is_same_v<T, float> ? "float" : "explicit";
    }
};

}  // namespace fracgyro::testing
