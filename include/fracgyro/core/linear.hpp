// 2-vectors and symmetric 2x2 matrices.
#pragma once

#include "fracgyro/core/pack.hpp"

namespace fracgyro {

template <Scalar T>
struct Vec2 {
    T x{}, y{};

    friend constexpr Vec2 operator+(const Vec2& a, const Vec2& b) {
        return each(a, b, [](const auto& l, const auto& r) { return l + r; });
    }
    friend constexpr Vec2 operator-(const Vec2& a, const Vec2& b) {
        return each(a, b, [](const auto& l, const auto& r) { return l - r; });
    }
    friend constexpr Vec2 operator-(const Vec2& a) { return {-a.x, -a.y}; }
    friend constexpr Vec2 operator*(T a, const Vec2& b) { return Vec2{a, a} * b; }
    // Product with a diagonal matrix stored as its diagonal.
    friend constexpr Vec2 operator*(const Vec2& diagonal, const Vec2& b) {
        return each(diagonal, b, [](const auto& l, const auto& r) { return l * r; });
    }

    friend constexpr bool operator==(const Vec2&, const Vec2&) = default;
    friend constexpr auto operator<=>(const Vec2&, const Vec2&) = default;

private:
    // Built-in numbers go through one register as a pair, which halves the instructions.
    template <class Operation>
    static constexpr Vec2 each(const Vec2& a, const Vec2& b, Operation operation) {
        if constexpr (std::floating_point<T> && FRACGYRO_PACKS) {
            using Pair = typename PackOf<T, 2>::Type;
            const Pair result = operation(Pair{a.x, a.y}, Pair{b.x, b.y});
            return {result[0], result[1]};
        } else {
            return {operation(a.x, b.x), operation(a.y, b.y)};
        }
    }
};

// Element by element.
template <Scalar T>
constexpr Vec2<T> absolute(Vec2<T> a) {
    return {absolute(a.x), absolute(a.y)};
}
template <Scalar T>
constexpr Vec2<T> maximum(Vec2<T> a, T b) {
    return {maximum(a.x, b), maximum(a.y, b)};
}
template <Scalar T>
constexpr Vec2<T> with_sign_of(Vec2<T> sign, Vec2<T> magnitude) {
    return {with_sign_of(sign.x, magnitude.x), with_sign_of(sign.y, magnitude.y)};
}
template <Scalar T>
constexpr Vec2<T> if_less(Vec2<T> a, Vec2<T> b, Vec2<T> yes, Vec2<T> no) {
    if constexpr (std::floating_point<T> && FRACGYRO_PACKS) {
        // Spelt as one operation on a register: a branch would wait for the comparison, and noise would mispredict it.
        using Pair [[gnu::vector_size(2 * sizeof(T))]] = T;
        const Pair taken = Pair{a.x, a.y} < Pair{b.x, b.y} ? Pair{yes.x, yes.y} : Pair{no.x, no.y};
        return {taken[0], taken[1]};
    } else {
        return {if_less(a.x, b.x, yes.x, no.x), if_less(a.y, b.y, yes.y, no.y)};
    }
}

template <Scalar T>
constexpr T squared_norm(Vec2<T> a) {
    return a.x * a.x + a.y * a.y;
}
template <Scalar T>
T norm(Vec2<T> a) {
    return square_root(squared_norm(a));
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

}  // namespace fracgyro
