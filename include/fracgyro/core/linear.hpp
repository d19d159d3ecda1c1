// 2-vectors, symmetric 2x2 matrices, and the signals made of them.
#pragma once

#include "fracgyro/core/elementary.hpp"
#include "fracgyro/core/pack.hpp"

namespace fracgyro {

// Two numbers, one for each axis: Vec2{x, y}. Sums and products are elementwise.
template <Scalar T>
struct Vec2 {
    T first{}, second{};

    constexpr const T& x() const { return first; }
    constexpr const T& y() const { return second; }
};

// Built-in numbers share a register, in memory too: after two stores of halves, a load would wait for both. Aligned as
// one number, so that the layout is as above.
template <Scalar T>
    requires(std::floating_point<T> && FRACGYRO_PACKS)
struct Vec2<T> {
    using Pair [[gnu::vector_size(2 * sizeof(T)), gnu::aligned(alignof(T))]] = T;
    Pair pair{};

    constexpr Vec2() = default;
    constexpr Vec2(T x, T y) : pair{x, y} {}
    constexpr explicit Vec2(Pair both) : pair(both) {}

    constexpr T x() const { return pair[0]; }
    constexpr T y() const { return pair[1]; }
};

// Result of an operation applied to each number; in a register, to both at once. By value: a reference to a pair would
// imply that it is aligned as a register.
template <class Operation, Scalar T, class... More>
constexpr Vec2<T> each(Operation operation, const Vec2<T>& a, const More&... more) {
    if constexpr (requires { a.pair; }) {
        return Vec2<T>(operation(a.pair, more.pair...));
    } else {
        return {operation(a.x(), more.x()...), operation(a.y(), more.y()...)};
    }
}

template <Scalar T>
constexpr Vec2<T> operator+(const Vec2<T>& a, const Vec2<T>& b) {
    return each([](auto l, auto r) { return l + r; }, a, b);
}
template <Scalar T>
constexpr Vec2<T> operator-(const Vec2<T>& a, const Vec2<T>& b) {
    return each([](auto l, auto r) { return l - r; }, a, b);
}
template <Scalar T>
constexpr Vec2<T> operator-(const Vec2<T>& a) {
    return each([](auto l) { return -l; }, a);
}
// Product with a diagonal matrix stored as its diagonal.
template <Scalar T>
constexpr Vec2<T> operator*(const Vec2<T>& diagonal, const Vec2<T>& b) {
    return each([](auto l, auto r) { return l * r; }, diagonal, b);
}
template <Scalar T>
constexpr Vec2<T> operator*(T a, const Vec2<T>& b) {
    return each([a](auto r) { return a * r; }, b);
}
template <Scalar T>
constexpr bool operator==(const Vec2<T>& a, const Vec2<T>& b) {
    return a.x() == b.x() && a.y() == b.y();
}
template <Scalar T>
constexpr auto operator<=>(const Vec2<T>& a, const Vec2<T>& b) {
    const auto first = a.x() <=> b.x();
    return first != 0 ? first : a.y() <=> b.y();
}

// (y, x)
template <Scalar T>
constexpr Vec2<T> swapped(const Vec2<T>& a) {
    return {a.y(), a.x()};
}
// Rotated by a right angle: (-y, x).
template <Scalar T>
constexpr Vec2<T> turned(const Vec2<T>& a) {
    return {-a.y(), a.x()};
}

// Elementwise. In a register one operation: a branch would wait for the comparison, and noise would mispredict it.
template <Scalar T>
constexpr Vec2<T> if_less(const Vec2<T>& a, const Vec2<T>& b, const Vec2<T>& yes, const Vec2<T>& no) {
    if constexpr (requires { a.pair; }) {
        return Vec2<T>(a.pair < b.pair ? yes.pair : no.pair);
    } else {
        return {if_less(a.x(), b.x(), yes.x(), no.x()), if_less(a.y(), b.y(), yes.y(), no.y())};
    }
}
template <Scalar T>
constexpr Vec2<T> absolute(const Vec2<T>& a) {
    return {absolute(a.x()), absolute(a.y())};
}
template <Scalar T>
constexpr Vec2<T> maximum(const Vec2<T>& a, T b) {
    if constexpr (requires { a.pair; }) {
        const Vec2<T> other{b, b};
        return if_less(a, other, other, a);
    } else {
        return {maximum(a.x(), b), maximum(a.y(), b)};
    }
}
template <Scalar T>
constexpr Vec2<T> clamp(const Vec2<T>& a, T low, T high) {
    return {clamp(a.x(), low, high), clamp(a.y(), low, high)};
}
template <Scalar T>
constexpr Vec2<T> with_sign_of(const Vec2<T>& sign, const Vec2<T>& magnitude) {
    return {with_sign_of(sign.x(), magnitude.x()), with_sign_of(sign.y(), magnitude.y())};
}
template <Scalar T>
Vec2<T> square_root(const Vec2<T>& a) {
#if defined(__SSE2__) && __has_builtin(__builtin_ia32_sqrtpd)
    if constexpr (std::same_as<T, double> && FRACGYRO_PACKS) {
        return Vec2<T>(__builtin_ia32_sqrtpd(a.pair));  // both in one instruction
    }
#endif
    return {square_root(a.x()), square_root(a.y())};
}
template <Scalar T>
Vec2<T> raised(const Vec2<T>& a, T exponent) {
    return {power(a.x(), exponent), power(a.y(), exponent)};
}
template <Scalar T>
constexpr Vec2<T> reciprocal(const Vec2<T>& a) {
    return each([](auto l) { return T(1.0) / l; }, a);
}

template <Scalar T>
constexpr T squared_norm(const Vec2<T>& a) {
    const Vec2<T> squares = a * a;
    return squares.x() + squares.y();
}
template <Scalar T>
T norm(const Vec2<T>& a) {
    return square_root(squared_norm(a));
}
// ‖a‖ and ‖b‖.
template <Scalar T>
Vec2<T> norms(const Vec2<T>& a, const Vec2<T>& b) {
    return square_root(Vec2<T>{squared_norm(a), squared_norm(b)});
}
template <Scalar T>
constexpr T dot(const Vec2<T>& a, const Vec2<T>& b) {
    const Vec2<T> products = a * b;
    return products.x() + products.y();
}
// a × b = a.x b.y - a.y b.x
template <Scalar T>
constexpr T cross(const Vec2<T>& a, const Vec2<T>& b) {
    const Vec2<T> products = a * swapped(b);
    return products.x() - products.y();
}

// Symmetric matrix [[xx, xy], [xy, yy]].
template <Scalar T>
struct Sym2 {
    Vec2<T> diagonal{};
    T off_diagonal{};

    constexpr Sym2() = default;
    constexpr Sym2(T xx, T xy, T yy) : diagonal{xx, yy}, off_diagonal(xy) {}
    constexpr Sym2(const Vec2<T>& on, T off) : diagonal(on), off_diagonal(off) {}

    constexpr T xx() const { return diagonal.x(); }
    constexpr T xy() const { return off_diagonal; }
    constexpr T yy() const { return diagonal.y(); }

    friend constexpr Sym2 operator+(const Sym2& a, const Sym2& b) {
        return {a.diagonal + b.diagonal, a.off_diagonal + b.off_diagonal};
    }
    friend constexpr Sym2 operator-(const Sym2& a, const Sym2& b) {
        return {a.diagonal - b.diagonal, a.off_diagonal - b.off_diagonal};
    }
    friend constexpr Sym2 operator*(T a, const Sym2& b) { return {a * b.diagonal, a * b.off_diagonal}; }
    friend constexpr Vec2<T> operator*(const Sym2& a, const Vec2<T>& b) {
        return a.diagonal * b + a.off_diagonal * swapped(b);
    }
};

// Any 2x2 matrix, as its columns.
template <Scalar T>
struct Matrix2 {
    Vec2<T> first{}, second{};

    friend constexpr Vec2<T> operator*(const Matrix2& a, const Vec2<T>& b) {
        return b.x() * a.first + b.y() * a.second;
    }
};

// The same numbers in another type.
template <Scalar To, Scalar From>
constexpr Vec2<To> cast(const Vec2<From>& a) {
    return {static_cast<To>(a.x()), static_cast<To>(a.y())};
}
template <Scalar To, Scalar From>
constexpr Sym2<To> cast(const Sym2<From>& a) {
    return {static_cast<To>(a.xx()), static_cast<To>(a.xy()), static_cast<To>(a.yy())};
}

// A sum that keeps what rounding would lose of each term.
template <Scalar T>
struct LongSum {
    T value{}, lost{};

    friend LongSum operator+(const LongSum& sum, T term) {
        const T whole = term - sum.lost, next = sum.value + whole;
        return {next, (next - sum.value) - whole};
    }
};

// A signal and its derivative at one instant.
template <Scalar T>
struct Sample {
    Vec2<T> value{}, derivative{};
};

// A motion of the proof mass, true or measured.
template <Scalar T>
struct Motion {
    Vec2<T> position{}, velocity{};
};

// Symmetric part of the outer product: ½ (a bᵀ + b aᵀ).
template <Scalar T>
constexpr Sym2<T> symmetric_product(const Vec2<T>& a, const Vec2<T>& b) {
    const Vec2<T> mixed = a * swapped(b);
    return {a * b, T(0.5) * (mixed.x() + mixed.y())};
}

}  // namespace fracgyro
