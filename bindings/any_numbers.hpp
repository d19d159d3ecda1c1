// Numbers that users' code returns: of any type, in any container. Slower than numbers.hpp for all but plain ones.
#pragma once

#include "numbers.hpp"

#include <array>
#include <cstdio>
#include <span>

namespace fracgyro::bindings {

// A number of any type, finite or not; returns false, without a Python error, for anything else, arrays included.
inline bool take_number(PyObject* from, double& to) {
    if (PyFloat_CheckExact(from)) {
        to = PyFloat_AS_DOUBLE(from);
        return true;
    }
    if (PyBool_Check(from) || !PyNumber_Check(from) || is_array(from)) {
        return false;
    }
    to = PyFloat_AsDouble(from);
    if (to == -1.0 && PyErr_Occurred() != nullptr) {
        PyErr_Clear();
        return false;
    }
    return true;
}

// The numbers of a sequence of that length.
inline bool take_items(PyObject* from, std::span<double> to) {
    if (!PySequence_Check(from)) {
        return false;
    }
    nb::object items = nb::steal(PySequence_Fast(from, ""));
    if (!items.is_valid()) {
        PyErr_Clear();
        return false;
    }
    PyObject** const item = PySequence_Fast_ITEMS(items.ptr());
    bool taken = static_cast<std::size_t>(PySequence_Fast_GET_SIZE(items.ptr())) == to.size();
    for (std::size_t i = 0; taken && i < to.size(); ++i) {
        taken = take_number(item[i], to[i]);
    }
    return taken;
}

// Numbers of nested lists, appended; returns false if there are too many, or anything else.
inline bool gather(PyObject* from, std::span<double> to, std::size_t& count) {
    if (!PyList_CheckExact(from)) {
        return count < to.size() && take_number(from, to[count++]);
    }
    for (Py_ssize_t i = 0; i < PyList_GET_SIZE(from); ++i) {
        if (!gather(PyList_GET_ITEM(from, i), to, count)) {
            return false;
        }
    }
    return true;
}

// That many numbers in any shape: a column, a matrix, a tensor. The mask of an array becomes None.
inline bool take_shaped(PyObject* from, std::span<double> to) {
    static PyObject* const shaped = nb::object(nb::module_::import_("numpy.ma").attr("asarray")).release().ptr();
    const nb::object array = nb::steal(PyObject_CallOneArg(shaped, from));
    const nb::object list = array.is_valid() ? nb::steal(PyObject_CallMethod(array.ptr(), "tolist", nullptr)) : array;
    if (!list.is_valid()) {
        PyErr_Clear();
        return false;
    }
    std::size_t count = 0;
    return gather(list.ptr(), to, count) && count == to.size();
}

// Exactly that many numbers, in anything.
inline bool take_any(PyObject* from, std::span<double> to) { return take_items(from, to) || take_shaped(from, to); }

// Raises ValueError about what users' code returned at a time.
[[noreturn]] inline void raise_refusal(const char* what, const nb::object& returned, double at, const char* wanted) {
    std::array<char, 32> time{};
    std::snprintf(time.data(), time.size(), "%.9g", at);
    const nb::object words = nb::str(nb::repr(returned)).attr("split")();  // an array may have several lines
    const nb::object line = nb::str(" ").attr("join")(words);
    PyErr_Format(PyExc_ValueError, "%s %.80U at t = %s: it must return %s", what, line.ptr(), time.data(), wanted);
    nb::raise_python_error();
}

}  // namespace fracgyro::bindings
