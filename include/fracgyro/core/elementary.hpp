// Elementary functions, the only ones that the controller may call: power, exponential, logarithm, Γ, sine and cosine.
//
// They are made of additions, multiplications, divisions and integer operations, so every compiler and processor
// computes the same bits.
#pragma once

#include "fracgyro/core/scalar.hpp"

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

namespace fracgyro {

namespace detail {

// Layout of numbers of type T. Lanes, which are several numbers, bring their own (include/fracgyro/sim/lanes.hpp).
template <class T>
struct Bits;
template <>
struct Bits<double> {
    using Value = double;
    using Integer = std::int64_t;
    using Unsigned = std::uint64_t;
    static constexpr int fraction = 52, bias = 1023, log_terms = 11, exp_terms = 14;
    static constexpr double round_to_integer = 6755399441055744.0;  // 1.5 * 2^52
    // ln 2 in two parts: the first has trailing zeros, so that its product with a small integer is exact.
    static constexpr double ln2_high = 0x1.62e42feep-1, ln2_low = 0x1.a39ef35793c76p-33;
};
template <>
struct Bits<float> {
    using Value = float;
    using Integer = std::int32_t;
    using Unsigned = std::uint32_t;
    static constexpr int fraction = 23, bias = 127, log_terms = 6, exp_terms = 8;
    static constexpr float round_to_integer = 12582912.0F;  // 1.5 * 2^23
    static constexpr float ln2_high = 0x1.62e4p-1F, ln2_low = 0x1.7f7d1cp-20F;
};

// The built-in type that constants of T are kept in.
template <class T>
struct BuiltFor {
    using Type = double;
};
template <class T>
    requires requires { typename Bits<T>::Value; }
struct BuiltFor<T> {
    using Type = typename Bits<T>::Value;
};
template <class T>
using Built = typename BuiltFor<T>::Type;

// Below the rounding of any relevant number. Without it, decaying values would become subnormal, which slows processors
// down.
template <class T>
constexpr double vanishing = std::same_as<Built<T>, float> ? 1e-24 : 1e-290;

template <class T, int Terms, class Function>
consteval std::array<T, Terms> table(Function coefficient) {
    std::array<T, Terms> values{};
    for (int k = 0; k < Terms; ++k) {
        values[static_cast<std::size_t>(k)] = static_cast<T>(coefficient(k));
    }
    return values;
}
constexpr double inverse_factorial(int n) {
    double product = 1.0;
    for (int k = 2; k <= n; ++k) {
        product *= k;
    }
    return 1.0 / product;
}
// ±1/n!, with the sign that n has in the series of sine and cosine.
constexpr double series_term(int n) { return n / 2 % 2 == 0 ? inverse_factorial(n) : -inverse_factorial(n); }
// c0 + x (c1 + x (c2 + …)), written out: in a loop a microcontroller would spend as much time on the loop itself.
template <class Number, std::size_t Terms, Scalar T>
constexpr T horner(const std::array<Number, Terms>& c, T x) {
    return [&]<std::size_t... K>(std::index_sequence<K...>) {
        T sum = T(c[Terms - 1]);
        ((sum = sum * x + T(c[Terms - 2 - K])), ...);
        return sum;
    }(std::make_index_sequence<Terms - 1>());
}

// The integer nearest to |x| < 2^22 (float) or 2^51 (double), as a number.
template <class T>
T round_to_nearest(T x) {
    const T shift = T(Bits<T>::round_to_integer);
    return (x + shift) - shift;
}

// For a normal x = 2^exponent * m with m in [sqrt(1/2), sqrt(2)): m.
template <class T>
[[gnu::always_inline]] inline T mantissa_split(T x, T& exponent) {
    using B = Bits<T>;
    using Value = typename B::Value;
    using Integer = typename B::Integer;
    using Unsigned = typename B::Unsigned;
    // Shifting the origin to sqrt(1/2) makes the exponent field round at sqrt(2) instead of truncate at 2.
    constexpr auto origin = std::bit_cast<typename Bits<Value>::Integer>(static_cast<Value>(0.70710678118654752440));
    constexpr auto one = static_cast<typename Bits<Value>::Integer>(1);
    const Integer shifted = std::bit_cast<Integer>(x) - origin;
    // The exponent as a number: an integer added to the last places of a large one, which is then subtracted.
    constexpr auto large = std::bit_cast<typename Bits<Value>::Integer>(B::round_to_integer);
    constexpr auto lift = (one << (sizeof(Value) * 8 - 2)) >> B::fraction;  // keeps the shifted value positive
    constexpr auto lift_bits = static_cast<typename Bits<Value>::Unsigned>(lift) << B::fraction;
    const auto lifted = (std::bit_cast<Unsigned>(shifted) + lift_bits) >> B::fraction;
    exponent = std::bit_cast<T>(std::bit_cast<Integer>(lifted) + (large - lift)) - T(B::round_to_integer);
    return std::bit_cast<T>((shifted & ((one << B::fraction) - one)) + origin);
}

// For the same x: log2(m), whose error is below 2^-53 * 1.5 (double).
// With z = (m - 1)/(m + 1), |z| <= 0.1716: ln m = 2 artanh z = 2 (z + z³/3 + z⁵/5 + …).
template <class T>
T log2_split(T x, T& exponent) {
    using B = Bits<T>;
    using Value = typename B::Value;
    const T m = mantissa_split(x, exponent);
    const T z = (m - T(Value(1))) / (m + T(Value(1)));
    const T square = z * z;
    static constexpr auto odd_reciprocals = table<Value, B::log_terms>([](int k) { return 1.0 / (2 * k + 1); });
    const T series = horner(odd_reciprocals, square);
    return T(static_cast<Value>(2.88539008177792681472)) * (z * series);  // 2/ln 2
}

// mantissa·2^whole, a normal number, for an integer `whole` in the last places of `placed`. It is added to the
// exponent: 2^whole itself may exceed the range.
template <class T>
[[gnu::always_inline]] inline T times_two_to_the(T mantissa, T placed) {
    using Unsigned = typename Bits<T>::Unsigned;
    return std::bit_cast<T>(std::bit_cast<Unsigned>(mantissa) + (std::bit_cast<Unsigned>(placed) << Bits<T>::fraction));
}

// 2^(whole + part), a normal number, for an integer `whole` and |part| <= ½: Taylor series of e^(part ln 2).
template <class T>
T exp2_split(T whole, T part) {
    using B = Bits<T>;
    using Value = typename B::Value;
    const T x = part * T(static_cast<Value>(0.69314718055994530942));
    static constexpr auto inverse_factorials =
        table<Value, B::exp_terms - 1>([](int k) { return inverse_factorial(k + 1); });
    const T series = horner(inverse_factorials, x);
    return times_two_to_the(T(Value(1)) + x * series, whole + T(B::round_to_integer));
}

}  // namespace detail

// base^exponent for base >= 0 and 0 <= exponent <= 1, within 4 units in the last place over the range of normal
// numbers; a subnormal base counts as the minimum normal one.
// log2(base) = k + l is never added up: exponent*k is split exactly into an integer and a remainder, so that the large
// part of the logarithm costs no accuracy.
template <Scalar T>
    requires requires { typename detail::Bits<T>::Value; }
T power(T base, T exponent) {
    using B = detail::Bits<T>;
    using Value = typename B::Value;
    T k{};
    const T l = detail::log2_split(maximum(base, T(std::numeric_limits<Value>::min())), k);
    const T product = exponent * k;
    const T whole = detail::round_to_nearest(product);
    // The rounding error of `product` is recovered by splitting `exponent` in halves whose products are exact.
    constexpr Value splitter = static_cast<Value>((std::int64_t{1} << ((B::fraction + 2) / 2)) + 1);
    const T scaled = T(splitter) * exponent;
    const T high = scaled - (scaled - exponent);
    const T lost = (high * k - product) + (exponent - high) * k;
    T part = (product - whole) + (lost + exponent * l);
    const T carry = detail::round_to_nearest(part);  // |part| may exceed ½
    part = part - carry;
    const T zero = T(Value(0));
    const T result = detail::exp2_split(whole + carry, part);
    return if_less(zero, base, result, if_less(zero, exponent, zero, T(Value(1))));
}

// e^x, within a few units in the last place; 0 for x below some -708 (double) or -86 (float), where the result would
// leave the normal range, and the maximum normal power of two for x above some 709 or 88.
template <Scalar T>
    requires requires { typename detail::Bits<T>::Value; }
T exponential(T x) {
    using B = detail::Bits<T>;
    using Value = typename B::Value;
    constexpr Value smallest = static_cast<Value>(-0.6931 * (B::bias - 2));
    constexpr Value largest = static_cast<Value>(0.6931 * B::bias);
    constexpr Value per_two = static_cast<Value>(1.44269504088896340736);
    const T within = minimum(maximum(x, T(smallest)), T(largest));
    const T k = detail::round_to_nearest(within * T(per_two));
    const T part = ((within - k * T(B::ln2_high)) - k * T(B::ln2_low)) * T(per_two);
    return if_less(x, T(smallest), T(Value(0)), detail::exp2_split(k, part));
}

// ln x for a normal x > 0, within a few units in the last place, also near x = 1.
template <Scalar T>
    requires requires { typename detail::Bits<T>::Value; }
T logarithm(T x) {
    using B = detail::Bits<T>;
    T k{};
    const T l = detail::log2_split(x, k);
    const T rest = k * T(B::ln2_low) + l * T(static_cast<typename B::Value>(0.69314718055994530942));
    return k * T(B::ln2_high) + rest;
}

// ln(1 + x) for x > -1. A factor corrects the rounding of 1 + x (Kahan).
template <std::floating_point T>
T logarithm_of_one_plus(T x) {
    const T sum = T(1) + x;
    return sum == T(1) ? x : logarithm(sum) * (x / (sum - T(1)));
}

// Γ(x) for 1 <= x <= 2, within a few units in the last place: Taylor series of 1/Γ about 3/2.
inline double gamma_from_one_to_two(double x) {
    static constexpr std::array<double, 20> terms{
        1.1283791670955125739,      -0.04117452644528310145,    -0.52665443552554447926,    0.1751020260439345615,
        0.050966860247706076775,    -0.042155169368535600993,   0.0066128978268241272766,   0.002120731442572938336,
        -0.0011107302545948907171,  0.00015235762076747687217,  0.000025355204923814165278, -0.000013896805717913756022,
        2.1562032905141724535e-6,   5.7942640540526725042e-8,   -8.9135511183111160541e-8,  1.7103469415915373749e-8,
        -9.3136864452419015685e-10, -2.6804741033496625565e-10, 7.4589322333163260507e-11,  -8.0128070614147183709e-12};
    return 1.0 / detail::horner(terms, x - 1.5);
}

template <Scalar T>
struct SineCosine {
    T sine{}, cosine{};
};

// The angle of a phase that is `radians` away from a quadrant.
template <Scalar T>
[[gnu::always_inline]] inline T angle(detail::Built<T> radians) {
    return T(radians);
}

// Sine and cosine of `phase` turns, a fraction of 2^32 or 2^64 (Phase std::uint32_t or std::uint64_t). Integer phase
// wraps exactly, so a reference that runs indefinitely neither drifts nor loses precision, in any scalar type.
template <Scalar T, std::unsigned_integral Phase>
[[gnu::always_inline]] inline SineCosine<T> sine_cosine(Phase phase) {
    constexpr bool single = std::same_as<detail::Built<T>, float>;
    if constexpr (single && sizeof(Phase) == 8) {
        return sine_cosine<T>(static_cast<std::uint32_t>(phase >> 32));
    } else {
        constexpr int bits = std::numeric_limits<Phase>::digits;
        const Phase quadrant = (phase + (Phase{1} << (bits - 3))) >> (bits - 2);
        const auto remainder = static_cast<std::make_signed_t<Phase>>(phase - (quadrant << (bits - 2)));
        constexpr double unit = 6.28318530717958647693 / (bits == 32 ? 0x1p32 : 0x1p64);
        const T x = angle<T>(static_cast<detail::Built<T>>(remainder) * static_cast<detail::Built<T>>(unit));
        // Taylor series on |x| <= π/4: x - x³/3! + … and 1 - x²/2! + …
        constexpr int terms = single ? 6 : 9;
        static constexpr auto of_sine =
            detail::table<detail::Built<T>, terms>([](int k) { return detail::series_term(2 * k + 1); });
        static constexpr auto of_cosine =
            detail::table<detail::Built<T>, terms>([](int k) { return detail::series_term(2 * k); });
        const T square = x * x;
        const T sine = x * detail::horner(of_sine, square);
        const T cosine = detail::horner(of_cosine, square);
        // Written out, as compilers vectorize this form and not `select`.
        const T first = (quadrant & 1U) != 0 ? cosine : sine;
        const T second = (quadrant & 1U) != 0 ? sine : cosine;
        return {.sine = (quadrant & 2U) != 0 ? -first : first,
                .cosine = ((quadrant + 1U) & 2U) != 0 ? -second : second};
    }
}

}  // namespace fracgyro
