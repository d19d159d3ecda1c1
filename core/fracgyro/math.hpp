// The scalar concept, 2-vectors and symmetric 2x2 matrices, and the only maths functions that the core may call.
//
// Nothing here calls libm except sqrt, which IEEE 754 rounds exactly. With floating-point contraction off, every
// compiler and processor therefore computes the same bits.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace fracgyro {

// What a number must offer to be simulated with. A wrapper around a floating-point type qualifies when it has the
// operators below, an explicit constructor from double and its own overloads of square_root and power.
template <class T>
concept Scalar = std::copyable<T> && std::constructible_from<T, double> && requires(T a, T b) {
    { a + b } -> std::same_as<T>;
    { a - b } -> std::same_as<T>;
    { a * b } -> std::same_as<T>;
    { a / b } -> std::same_as<T>;
    { -a } -> std::same_as<T>;
    { a < b } -> std::convertible_to<bool>;
};

template <Scalar T>
constexpr T select(bool condition, T yes, T no) {
    return condition ? yes : no;
}
template <Scalar T>
constexpr T maximum(T a, T b) {
    return select(a < b, b, a);
}
template <Scalar T>
constexpr T minimum(T a, T b) {
    return select(b < a, b, a);
}
template <Scalar T>
constexpr T absolute(T a) {
    return select(a < T(0.0), -a, a);
}
inline double absolute(double a) { return std::fabs(a); }
inline float absolute(float a) { return std::fabs(a); }
// A magnitude >= 0 with the sign of `sign`.
template <Scalar T>
constexpr T with_sign_of(T sign, T magnitude) {
    return select(sign < T(0.0), -magnitude, magnitude);
}
inline double with_sign_of(double sign, double magnitude) { return std::copysign(magnitude, sign); }
inline float with_sign_of(float sign, float magnitude) { return std::copysign(magnitude, sign); }
template <Scalar T>
constexpr T clamp(T a, T low, T high) {
    return minimum(maximum(a, low), high);
}

inline double square_root(double a) { return std::sqrt(a); }
inline float square_root(float a) { return std::sqrt(a); }

// A few numbers that go through the same arithmetic. For built-in types the compiler's own vector, which becomes
// whatever registers the processor has; element by element the operations and their results are those of T.
template <Scalar T, std::size_t Lanes>
struct PackOf {
    struct Type {
        std::array<T, Lanes> lane{};
        constexpr T& operator[](std::size_t k) { return lane[k]; }
        constexpr const T& operator[](std::size_t k) const { return lane[k]; }
        friend constexpr Type operator+(Type a, const Type& b) {
            for (std::size_t k = 0; k < Lanes; ++k) {
                a[k] = a[k] + b[k];
            }
            return a;
        }
        friend constexpr Type operator*(Type a, const Type& b) {
            for (std::size_t k = 0; k < Lanes; ++k) {
                a[k] = a[k] * b[k];
            }
            return a;
        }
        friend constexpr Type operator+(Type a, T b) {
            for (std::size_t k = 0; k < Lanes; ++k) {
                a[k] = a[k] + b;
            }
            return a;
        }
        friend constexpr Type operator*(Type a, T b) {
            for (std::size_t k = 0; k < Lanes; ++k) {
                a[k] = a[k] * b;
            }
            return a;
        }
    };
};
template <Scalar T, std::size_t Lanes>
    requires std::floating_point<T>
struct PackOf<T, Lanes> {
    using Type [[gnu::vector_size(Lanes * sizeof(T))]] = T;
};

template <Scalar T>
struct Vec2 {
    T x{}, y{};

    friend constexpr Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
    friend constexpr Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
    friend constexpr Vec2 operator-(Vec2 a) { return {-a.x, -a.y}; }
    friend constexpr Vec2 operator*(T a, Vec2 b) { return {a * b.x, a * b.y}; }
    // Product with a diagonal matrix stored as its diagonal.
    friend constexpr Vec2 operator*(Vec2 diagonal, Vec2 b) { return {diagonal.x * b.x, diagonal.y * b.y}; }
};

template <Scalar T>
T norm(Vec2<T> a) {
    return square_root(a.x * a.x + a.y * a.y);
}

// Symmetric matrix [[xx, xy], [xy, yy]].
template <Scalar T>
struct Sym2 {
    T xx{}, xy{}, yy{};

    friend constexpr Sym2 operator+(Sym2 a, Sym2 b) { return {a.xx + b.xx, a.xy + b.xy, a.yy + b.yy}; }
    friend constexpr Sym2 operator-(Sym2 a, Sym2 b) { return {a.xx - b.xx, a.xy - b.xy, a.yy - b.yy}; }
    friend constexpr Sym2 operator*(T a, Sym2 b) { return {a * b.xx, a * b.xy, a * b.yy}; }
    friend constexpr Vec2<T> operator*(Sym2 a, Vec2<T> b) { return {a.xx * b.x + a.xy * b.y, a.xy * b.x + a.yy * b.y}; }
};

// Symmetric part of the outer product: ½ (a bᵀ + b aᵀ).
template <Scalar T>
constexpr Sym2<T> symmetric_product(Vec2<T> a, Vec2<T> b) {
    return {a.x * b.x, T(0.5) * (a.x * b.y + a.y * b.x), a.y * b.y};
}

namespace detail {

template <class T>
struct Bits;
template <>
struct Bits<double> {
    using Integer = std::int64_t;
    static constexpr int fraction = 52, bias = 1023, log_terms = 11, exp_terms = 14;
    static constexpr double round_to_integer = 6755399441055744.0;  // 1.5 * 2^52
    static constexpr double subnormal_scale = 18014398509481984.0;  // 2^54
    static constexpr int subnormal_shift = 54;
    // ln 2 in two parts: the first has trailing zeros, so that its product with a small integer is exact.
    static constexpr double ln2_high = 0x1.62e42feep-1, ln2_low = 0x1.a39ef35793c76p-33;
};
template <>
struct Bits<float> {
    using Integer = std::int32_t;
    static constexpr int fraction = 23, bias = 127, log_terms = 6, exp_terms = 8;
    static constexpr float round_to_integer = 12582912.0F;  // 1.5 * 2^23
    static constexpr float subnormal_scale = 33554432.0F;   // 2^25
    static constexpr int subnormal_shift = 25;
    static constexpr float ln2_high = 0x1.62e4p-1F, ln2_low = 0x1.7f7d1cp-20F;
};

// The built-in type that constants of T are kept in.
template <class T>
using Built = std::conditional_t<std::same_as<T, float>, float, double>;

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
// c0 + x (c1 + x (c2 + …))
template <class Number, std::size_t Terms, Scalar T>
constexpr T horner(const std::array<Number, Terms>& c, T x) {
    T sum = T(c[Terms - 1]);
    for (std::size_t k = Terms - 1; k-- > 0;) {
        sum = sum * x + T(c[k]);
    }
    return sum;
}

// x = 2^exponent * m with m in [sqrt(1/2), sqrt(2)); returns log2(m), whose error is below 2^-53 * 1.5 (double).
// With z = (m - 1)/(m + 1), |z| <= 0.1716: ln m = 2 artanh z = 2 (z + z³/3 + z⁵/5 + …).
template <std::floating_point T>
T log2_split(T x, int& exponent) {
    using B = Bits<T>;
    using Integer = typename B::Integer;
    const bool subnormal = x < std::numeric_limits<T>::min();
    const Integer bits = std::bit_cast<Integer>(subnormal ? x * B::subnormal_scale : x);
    // Shifting the origin to sqrt(1/2) makes the exponent field round at sqrt(2) instead of truncate at 2.
    constexpr Integer origin = std::bit_cast<Integer>(static_cast<T>(0.70710678118654752440));
    const Integer shifted = bits - origin;
    exponent = static_cast<int>(shifted >> B::fraction) - (subnormal ? B::subnormal_shift : 0);
    const T m = std::bit_cast<T>((shifted & ((Integer{1} << B::fraction) - 1)) + origin);
    const T z = (m - T(1)) / (m + T(1));
    const T square = z * z;
    constexpr auto odd_reciprocals = table<T, B::log_terms>([](int k) { return 1.0 / (2 * k + 1); });
    const T series = horner(odd_reciprocals, square);
    constexpr T two_over_ln2 = static_cast<T>(2.88539008177792681472);
    return two_over_ln2 * (z * series);
}

template <std::floating_point T>
T power_of_two(int exponent) {
    using Integer = typename Bits<T>::Integer;
    return std::bit_cast<T>(static_cast<Integer>(static_cast<Integer>(exponent + Bits<T>::bias) << Bits<T>::fraction));
}

// 2^(whole + part) for |part| <= ½: Taylor series of e^(part ln 2).
template <std::floating_point T>
T exp2_split(int whole, T part) {
    using B = Bits<T>;
    const T x = part * static_cast<T>(0.69314718055994530942);
    constexpr auto inverse_factorials = table<T, B::exp_terms - 1>([](int k) { return inverse_factorial(k + 1); });
    const T series = horner(inverse_factorials, x);
    // In two factors: 2^whole itself may exceed the range at either end where the result does not.
    const int half = whole / 2;
    return (T(1) + x * series) * power_of_two<T>(half) * power_of_two<T>(whole - half);
}

template <std::floating_point T>
T round_to_nearest(T x) {
    return (x + Bits<T>::round_to_integer) - Bits<T>::round_to_integer;
}

}  // namespace detail

// base^exponent for base >= 0 and 0 <= exponent <= 1, within 4 units in the last place over the whole range.
// log2(base) = k + l is never added up: exponent*k is split exactly into an integer and a remainder, so that the
// large part of the logarithm costs no accuracy.
template <std::floating_point T>
T power(T base, T exponent) {
    int k = 0;
    const T l = detail::log2_split(base, k);
    const T product = exponent * static_cast<T>(k);
    const T whole = detail::round_to_nearest(product);
    // The rounding error of `product` is recovered by splitting `exponent` in halves whose products are exact.
    constexpr T splitter = static_cast<T>((std::int64_t{1} << ((detail::Bits<T>::fraction + 2) / 2)) + 1);
    const T scaled = splitter * exponent;
    const T high = scaled - (scaled - exponent);
    const T lost = (high * static_cast<T>(k) - product) + (exponent - high) * static_cast<T>(k);
    T part = (product - whole) + (lost + exponent * l);
    const T carry = detail::round_to_nearest(part);  // |part| may exceed ½
    part = part - carry;
    const T result = detail::exp2_split(static_cast<int>(whole) + static_cast<int>(carry), part);
    return select(T(0) < base, result, select(exponent == T(0), T(1), T(0)));
}

// e^x for x <= 0, within a few units in the last place; 0 for x below some -708 (double) or -86 (float), where the result
// would leave the normal range.
template <std::floating_point T>
T exponential(T x) {
    constexpr T high = detail::Bits<T>::ln2_high, low = detail::Bits<T>::ln2_low;
    constexpr T smallest = static_cast<T>(-0.6931 * (detail::Bits<T>::bias - 2));
    const T k = detail::round_to_nearest(maximum(x, smallest) * static_cast<T>(1.44269504088896340736));
    const T part = ((maximum(x, smallest) - k * high) - k * low) * static_cast<T>(1.44269504088896340736);
    return select(x < smallest, T(0), detail::exp2_split(static_cast<int>(k), part));
}

template <Scalar T>
struct SineCosine {
    T sine{}, cosine{};
};

// Sine and cosine of `phase` turns, a fraction of 2^32 or 2^64 (Phase std::uint32_t or std::uint64_t). Integer phase
// wraps exactly, so a reference that runs for ever neither drifts nor loses precision, in any scalar type.
template <Scalar T, std::unsigned_integral Phase>
[[gnu::always_inline]] inline SineCosine<T> sine_cosine(Phase phase) {
    if constexpr (sizeof(T) == sizeof(float) && sizeof(Phase) == 8) {
        return sine_cosine<T>(static_cast<std::uint32_t>(phase >> 32));
    } else {
        constexpr int bits = std::numeric_limits<Phase>::digits;
        const Phase quadrant = (phase + (Phase{1} << (bits - 3))) >> (bits - 2);
        const auto remainder = static_cast<std::make_signed_t<Phase>>(phase - (quadrant << (bits - 2)));
        constexpr double unit = 6.28318530717958647693 / (bits == 32 ? 0x1p32 : 0x1p64);
        const T x = T(static_cast<detail::Built<T>>(remainder) * static_cast<detail::Built<T>>(unit));
        // Taylor series on |x| <= π/4: x - x³/3! + … and 1 - x²/2! + …
        constexpr int terms = sizeof(T) == sizeof(float) ? 6 : 9;
        constexpr auto of_sine =
            detail::table<detail::Built<T>, terms>([](int k) { return detail::series_term(2 * k + 1); });
        constexpr auto of_cosine =
            detail::table<detail::Built<T>, terms>([](int k) { return detail::series_term(2 * k); });
        const T square = x * x;
        const T sine = x * detail::horner(of_sine, square);
        const T cosine = detail::horner(of_cosine, square);
        // Written out, as compilers make vectors of this form and not of `select`.
        const T first = (quadrant & 1U) != 0 ? cosine : sine;
        const T second = (quadrant & 1U) != 0 ? sine : cosine;
        return {.sine = (quadrant & 2U) != 0 ? -first : first,
                .cosine = ((quadrant + 1U) & 2U) != 0 ? -second : second};
    }
}

}  // namespace fracgyro
