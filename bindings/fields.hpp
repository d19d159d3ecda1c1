// The numbers in a struct, in the order of its fields, nested as its braces would be.
#pragma once

#include "alone.hpp"
#include "arrays.hpp"

namespace fracgyro::bindings {

// Stands for a value of any type, to find out how many fields a struct has.
struct Anything {
    template <class T>
    operator T() const;
};

template <class Struct, class... Known>
consteval std::size_t count_fields() {
    if constexpr (requires { Struct{Known{}..., Anything{}}; }) {
        return count_fields<Struct, Known..., Anything>();
    } else {
        return sizeof...(Known);
    }
}

template <class Struct>
nb::object nested_fields(const Struct& value);

template <class T, std::size_t Count>
nb::object nested_fields(const std::array<T, Count>& values) {
    nb::list all;
    for (const T& value : values) {
        all.append(nested_fields(value));
    }
    return all;
}

template <class Number>
nb::object nested_fields(const Alone<Number>& value) {
    return nb::cast(value.value);
}

// A language without reflection needs one line for each number of fields.
template <class Struct>
nb::object nested_fields(const Struct& value) {
    const auto all = [](const auto&... fields) { return nb::object(nb::make_tuple(nested_fields(fields)...)); };
    if constexpr (std::is_arithmetic_v<Struct>) {
        return nb::cast(value);
    } else if constexpr (!std::is_class_v<Struct>) {  // a pack
        nb::list entries;
        for (std::size_t k = 0; k < sizeof(Struct) / sizeof(value[0]); ++k) {
            entries.append(nb::cast(value[k]));
        }
        return nb::tuple(entries);
    } else {
        constexpr std::size_t count = count_fields<Struct>();
        static_assert(0 < count && count <= 20);
        if constexpr (count == 1) {
            const auto& [a] = value;
            return all(a);
        } else if constexpr (count == 2) {
            const auto& [a, b] = value;
            return all(a, b);
        } else if constexpr (count == 3) {
            const auto& [a, b, c] = value;
            return all(a, b, c);
        } else if constexpr (count == 4) {
            const auto& [a, b, c, d] = value;
            return all(a, b, c, d);
        } else if constexpr (count == 5) {
            const auto& [a, b, c, d, e] = value;
            return all(a, b, c, d, e);
        } else if constexpr (count == 6) {
            const auto& [a, b, c, d, e, f] = value;
            return all(a, b, c, d, e, f);
        } else if constexpr (count == 7) {
            const auto& [a, b, c, d, e, f, g] = value;
            return all(a, b, c, d, e, f, g);
        } else if constexpr (count == 8) {
            const auto& [a, b, c, d, e, f, g, h] = value;
            return all(a, b, c, d, e, f, g, h);
        } else if constexpr (count == 9) {
            const auto& [a, b, c, d, e, f, g, h, i] = value;
            return all(a, b, c, d, e, f, g, h, i);
        } else if constexpr (count == 10) {
            const auto& [a, b, c, d, e, f, g, h, i, j] = value;
            return all(a, b, c, d, e, f, g, h, i, j);
        } else if constexpr (count == 11) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k);
        } else if constexpr (count == 12) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l);
        } else if constexpr (count == 13) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m);
        } else if constexpr (count == 14) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n);
        } else if constexpr (count == 15) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o);
        } else if constexpr (count == 16) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p);
        } else if constexpr (count == 17) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q);
        } else if constexpr (count == 18) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r);
        } else if constexpr (count == 19) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s);
        } else if constexpr (count == 20) {
            const auto& [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t] = value;
            return all(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t);
        }
    }
}

}  // namespace fracgyro::bindings
