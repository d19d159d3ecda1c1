// A variable of the FMU. Its value reference is its place in exported::variables.
#pragma once

#include <limits>

namespace fracgyro {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

enum class Role {
    time,
    constant,  // what the exponentials were designed for
    fixed,     // a number of settings.hpp, which can be set until the first sample
    tunable,   // the same, at any time
    input,     // of the controller by itself: x, y and, where they are measured, vx, vy
    output     // a column of recorder.hpp's rows
};

struct Variable {
    const char* name;
    Role role;
    int place;     // among the settings, inputs or columns
    double start;  // in the FMU's unit
    double scale;  // of that unit: the core's number is value / scale
    double low = -infinity, high = infinity;
    bool strict = false;   // low < value < high
    bool integer = false;  // of an integer's type
};

}  // namespace fracgyro
