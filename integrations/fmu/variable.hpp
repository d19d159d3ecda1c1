// A variable of the FMU. Its value reference is its place in exported::variables.
#pragma once

#include <limits>

namespace fracgyro {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

enum class Role {
    time,
    constant,  // a number for which the exponentials were designed
    fixed,     // a number of settings.hpp, which can be set until the first sample
    tunable,   // the same, at any time
    input,     // q and v of an FMU without a loop; r, r' and r'' if the reference is an input; x, y of each in order
    output     // a column of recorder.hpp's rows
};

struct Variable {
    const char* name;
    Role role;
    int place;     // among the settings, inputs or columns
    double start;  // in the FMU's unit
    double scale;  // factor of that unit: the core's number is value / scale
    double low = -infinity, high = infinity;
    bool strict = false;   // low < value < high
    bool integer = false;  // has the type of an integer
};

}  // namespace fracgyro
