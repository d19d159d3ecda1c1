// Conversions between NumPy arrays, Python sequences and the core's small types.
#pragma once

#include "memory.hpp"

#include "fracgyro/core/linear.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>

#include <algorithm>
#include <memory>
#include <vector>

namespace fracgyro::bindings {

namespace nb = nanobind;

using Array2 = std::array<double, 2>;
using Array3 = std::array<double, 3>;

inline Array2 to_array(const Vec2<double>& v) { return {v.x(), v.y()}; }
inline Array3 to_array(const Sym2<double>& a) { return {a.xx(), a.xy(), a.yy()}; }
inline Vec2<double> to_vec2(const Array2& a) { return {a[0], a[1]}; }
inline Sym2<double> to_sym2(const Array3& a) { return {a[0], a[1], a[2]}; }

// A property that Python sees as a tuple-like of two or three numbers.
template <class Class, class Owner>
void def_vec2(Class& c, const char* name, Vec2<double> Owner::* member) {
    c.def_prop_rw(
        name, [member](const Owner& o) { return to_array(o.*member); },
        [member](Owner& o, const Array2& a) { o.*member = to_vec2(a); });
}
template <class Class, class Owner>
void def_sym2(Class& c, const char* name, Sym2<double> Owner::* member) {
    c.def_prop_rw(
        name, [member](const Owner& o) { return to_array(o.*member); },
        [member](Owner& o, const Array3& a) { o.*member = to_sym2(a); });
}

// A NumPy array that owns `data`.
template <class T, std::size_t Dimensions>
nb::ndarray<nb::numpy, T> owned(std::unique_ptr<T[]> data, const std::array<std::size_t, Dimensions>& shape) {
    T* pointer = data.get();
    nb::capsule owner(data.release(), [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::ndarray<nb::numpy, T>(pointer, Dimensions, shape.data(), owner);
}

// Consecutive rows as a NumPy array.
template <std::size_t Dimensions>
nb::ndarray<nb::numpy, double> owned_rows(Rows rows, const std::array<std::size_t, Dimensions>& shape) {
    auto kept = std::make_unique<Rows>(std::move(rows));
    double* const first = kept->data();
    nb::capsule owner(kept.release(), [](void* p) noexcept { delete static_cast<Rows*>(p); });
    return nb::ndarray<nb::numpy, double>(first, Dimensions, shape.data(), owner);
}

}  // namespace fracgyro::bindings
