// Plain numbers to and from Python without a conversion that costs more than a step of a controller.
#pragma once

#include "fracgyro/core/linear.hpp"

#include <nanobind/nanobind.h>

#include <cmath>
#include <cstring>

namespace fracgyro::bindings {

namespace nb = nanobind;

// All functions here accept plain finite numbers only. Another argument may still be a number, which arguments.py then
// decides.

inline bool take(PyObject* from, double& to) {
    if (!PyFloat_Check(from)) {
        return false;
    }
    to = PyFloat_AS_DOUBLE(from);
    return std::isfinite(to);
}

inline PyObject* array_type() {
    static PyObject* const type = nb::object(nb::module_::import_("numpy").attr("ndarray")).release().ptr();
    return type;
}

// A NumPy array, of any type, with at least one dimension.
inline bool is_array(PyObject* from) {
    if (PyObject_TypeCheck(from, reinterpret_cast<PyTypeObject*>(array_type())) == 0) {
        return false;
    }
    const bool sized = PyObject_Size(from) >= 0;
    PyErr_Clear();
    return sized;
}

// A tuple, a list or a NumPy array of doubles.
inline bool take(PyObject* from, Vec2<double>& to) {
    double x = 0.0, y = 0.0;
    const auto both = [&](bool taken) {
        to = {x, y};
        return taken;
    };
    if (PyTuple_CheckExact(from)) {
        return both(PyTuple_GET_SIZE(from) == 2 && take(PyTuple_GET_ITEM(from, 0), x) &&
                    take(PyTuple_GET_ITEM(from, 1), y));
    }
    if (PyList_CheckExact(from)) {
        return both(PyList_GET_SIZE(from) == 2 && take(PyList_GET_ITEM(from, 0), x) &&
                    take(PyList_GET_ITEM(from, 1), y));
    }
    if (reinterpret_cast<PyObject*>(Py_TYPE(from)) != array_type()) {
        return false;
    }
    Py_buffer view;
    if (PyObject_GetBuffer(from, &view, PyBUF_STRIDES | PyBUF_FORMAT) != 0) {
        PyErr_Clear();
        return false;
    }
    const bool fits = view.ndim == 1 && view.shape[0] == 2 && view.format[0] == 'd' && view.format[1] == '\0';
    if (fits) {
        const auto* const first = static_cast<const char*>(view.buf);
        std::memcpy(&x, first, sizeof x);
        std::memcpy(&y, first + view.strides[0], sizeof y);
    }
    PyBuffer_Release(&view);
    return both(fits && std::isfinite(x) && std::isfinite(y));
}

// (x, y); nullptr if out of memory.
inline PyObject* new_pair(const Vec2<double>& a) {
    PyObject* const pair = PyTuple_New(2);
    PyObject* const x = PyFloat_FromDouble(a.x());
    PyObject* const y = PyFloat_FromDouble(a.y());
    if (pair == nullptr || x == nullptr || y == nullptr) {
        Py_XDECREF(pair), Py_XDECREF(x), Py_XDECREF(y);
        return nullptr;
    }
    PyTuple_SET_ITEM(pair, 0, x);
    PyTuple_SET_ITEM(pair, 1, y);
    return pair;
}

// A NumPy array of two doubles. A copy of one is made faster than a new one.
inline nb::object new_vector(const Vec2<double>& a) {
    static PyObject* const zeros = nb::object(nb::module_::import_("numpy").attr("zeros")(2)).release().ptr();
    static PyObject* const copy = PyUnicode_InternFromString("copy");
    nb::object made = nb::steal(PyObject_CallMethodNoArgs(zeros, copy));
    Py_buffer view;
    if (!made.is_valid() || PyObject_GetBuffer(made.ptr(), &view, PyBUF_WRITABLE) != 0) {
        nb::raise_python_error();
    }
    std::memcpy(view.buf, &a, sizeof a);
    PyBuffer_Release(&view);
    return made;
}

}  // namespace fracgyro::bindings
