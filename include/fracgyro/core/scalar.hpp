// The scalar concept: requirements of a number, and functions that follow from them.
//
// The only libm functions called are sqrt, fabs and copysign, which IEEE 754 defines exactly. With floating-point
// contraction off, every compiler and processor therefore computes the same bits.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>

namespace fracgyro {

// Requirements of a number for simulation. A wrapper around a floating-point type qualifies if it has the operators
// below, an explicit constructor from double and its own overloads of square_root and power; a few controllers also
// need its exponential or logarithm. A type that holds several numbers, whose a < b does not have a single answer, also
// overloads if_less, always_less and the functions made from them (include/fracgyro/sim/lanes.hpp).
template <class T>
concept Scalar = std::copyable<T> && std::constructible_from<T, double> && requires(T a, T b) {
    { a + b } -> std::same_as<T>;
    { a - b } -> std::same_as<T>;
    { a * b } -> std::same_as<T>;
    { a / b } -> std::same_as<T>;
    { -a } -> std::same_as<T>;
    a < b;
};

// An integer or a switch in the state of a computation with numbers T. A number that is recorded and not computed with
// (fpga/fracgyro_fpga/cpp/trace.hpp) brings its own.
template <class T, class Built>
struct KeptBy {
    using Type = Built;
};
template <class T, class Built>
using Kept = typename KeptBy<T, Built>::Type;

template <Scalar T>
constexpr T if_less(T a, T b, T yes, T no) {
    return a < b ? yes : no;
}
// a < b, in all runs that a number of several runs represents.
template <Scalar T>
constexpr bool always_less(T a, T b) {
    return a < b;
}
template <Scalar T>
constexpr T maximum(T a, T b) {
    if constexpr (std::floating_point<T>) {
        return a < b ? b : a;  // one instruction
    } else {
        return if_less(a, b, b, a);
    }
}
template <Scalar T>
constexpr T minimum(T a, T b) {
    if constexpr (std::floating_point<T>) {
        return b < a ? b : a;
    } else {
        return if_less(b, a, b, a);
    }
}
template <Scalar T>
constexpr T absolute(T a) {
    return if_less(a, T(0.0), -a, a);
}
inline double absolute(double a) { return std::fabs(a); }
inline float absolute(float a) { return std::fabs(a); }
// A magnitude >= 0 with the sign of `sign`.
template <Scalar T>
constexpr T with_sign_of(T sign, T magnitude) {
    return if_less(sign, T(0.0), -magnitude, magnitude);
}
inline double with_sign_of(double sign, double magnitude) { return std::copysign(magnitude, sign); }
inline float with_sign_of(float sign, float magnitude) { return std::copysign(magnitude, sign); }
template <Scalar T>
constexpr T clamp(T a, T low, T high) {
    return minimum(maximum(a, low), high);
}

inline double square_root(double a) { return std::sqrt(a); }
inline float square_root(float a) { return std::sqrt(a); }

}  // namespace fracgyro
