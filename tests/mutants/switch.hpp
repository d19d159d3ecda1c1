// Mutants compiled in: which one is active is asked when the program runs. `compile_in.py` writes the calls.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <type_traits>

extern "C" {
[[gnu::visibility("default"), gnu::used]] inline int fracgyro_mutant = [] {
    const char* id = std::getenv("FRACGYRO_MUTANT");
    return id == nullptr ? -1 : std::atoi(id);
}();
[[gnu::visibility("default"), gnu::used]] inline unsigned char fracgyro_reached[8192]{};
}

namespace fracgyro::mutant {

// Writes the numbers of the mutants that a program came by to the file FRACGYRO_REACHED.
struct Report {
    ~Report() {
        const char* path = std::getenv("FRACGYRO_REACHED");
        if (std::FILE* file = path == nullptr ? nullptr : std::fopen(path, "w")) {
            for (int id = 0; id < 8192; ++id) {
                if (fracgyro_reached[id] != 0) {
                    std::fprintf(file, "%d\n", id);
                }
            }
            std::fclose(file);
        }
    }
};
inline Report report;

// Constant expressions are never mutated.
constexpr bool active(int id) {
    if (std::is_constant_evaluated()) {
        return false;
    }
    fracgyro_reached[id] = 1;
    return fracgyro_mutant == id;
}

// A constant: 0 becomes 1, any other number doubles.
template <class T>
constexpr T number(int id, T value) {
    return active(id) ? (value == T(0) ? T(1) : static_cast<T>(value + value)) : value;
}

// Numbers are passed by value: a lambda may use constants without capturing them.
template <class T>
concept Plain = std::is_arithmetic_v<T> || std::is_enum_v<T>;

// a + Sign{id} * b
struct Sign {
    int id;
    template <Plain T>
    friend constexpr T operator*(Sign s, T b) {
        return active(s.id) ? T(-b) : b;
    }
    template <class T>
        requires(!Plain<T>)
    friend constexpr T operator*(Sign s, const T& b) {
        if constexpr (requires { T(-b); }) {
            return active(s.id) ? T(-b) : b;
        } else if constexpr (requires { T(b + b); }) {
            return active(s.id) ? T(b + b) : b;  // a type without minus
        } else {
            return active(s.id) ? T{} : b;
        }
    }
};

// a * Factor{id} * b: divided, or where that is not defined with the other sign, doubled, or 0. a / Factor{id} / b:
// multiplied.
template <class T>
struct Pending {
    const T& a;
    int id;
};
struct Factor {
    int id;
    template <class T>
    friend constexpr Pending<T> operator*(const T& a, Factor f) {
        return {a, f.id};
    }
    template <class T>
    friend constexpr Pending<T> operator/(const T& a, Factor f) {
        return {a, f.id};
    }
};
template <class T, class U>
constexpr auto operator*(Pending<T> p, const U& b) {
    using Product = std::decay_t<decltype(p.a * b)>;
    if constexpr (requires { Product(p.a / b); }) {
        return active(p.id) ? Product(p.a / b) : Product(p.a * b);
    } else if constexpr (requires { Product(-(p.a * b)); }) {
        return active(p.id) ? Product(-(p.a * b)) : Product(p.a * b);
    } else {
        const Product product = p.a * b;
        if constexpr (requires { Product(product + product); }) {
            return active(p.id) ? Product(product + product) : product;
        } else {
            return active(p.id) ? Product{} : product;
        }
    }
}
template <class T, class U>
constexpr auto operator/(Pending<T> p, const U& b) {
    using Ratio = std::decay_t<decltype(p.a / b)>;
    return active(p.id) ? Ratio(p.a * b) : Ratio(p.a / b);
}

// a < Than{id} < b: of integers the other side of equality, of other numbers the operands swapped.
struct Than {
    int id;
};
#define FRACGYRO_COMPARED(OPERATOR, OF_INTEGERS, OF_OTHERS)       \
    if constexpr (std::is_integral_v<T> || std::is_enum_v<T>) {   \
        return active(p.id) ? p.a OF_INTEGERS b : p.a OPERATOR b; \
    } else {                                                      \
        return active(p.id) ? OF_OTHERS : p.a OPERATOR b;         \
    }
#define FRACGYRO_COMPARISON(OPERATOR, OF_INTEGERS, OF_OTHERS)    \
    template <class T>                                           \
    constexpr Pending<T> operator OPERATOR(const T& a, Than t) { \
        return {a, t.id};                                        \
    }                                                            \
    template <class T, Plain U>                                  \
    constexpr auto operator OPERATOR(Pending<T> p, U b) {        \
        FRACGYRO_COMPARED(OPERATOR, OF_INTEGERS, OF_OTHERS)      \
    }                                                            \
    template <class T, class U>                                  \
        requires(!Plain<U>)                                      \
    constexpr auto operator OPERATOR(Pending<T> p, const U& b) { \
        FRACGYRO_COMPARED(OPERATOR, OF_INTEGERS, OF_OTHERS)      \
    }
FRACGYRO_COMPARISON(<, <=, b < p.a)
FRACGYRO_COMPARISON(<=, <, b <= p.a)
FRACGYRO_COMPARISON(>, >=, b > p.a)
FRACGYRO_COMPARISON(>=, >, b >= p.a)
FRACGYRO_COMPARISON(==, !=, p.a != b)
FRACGYRO_COMPARISON(!=, ==, p.a == b)
#undef FRACGYRO_COMPARISON
#undef FRACGYRO_COMPARED

}  // namespace fracgyro::mutant
