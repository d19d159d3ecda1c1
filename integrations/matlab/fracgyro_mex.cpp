// MEX function behind Fracgyro.m: the C interface for MATLAB and Octave. Controllers are kept here, under handles.
//
// Clearing this file clears its controllers: their handles are unknown from then on. An error leaves through
// mexErrMsgIdAndTxt, which runs no destructor in MATLAB: no object that has one is alive where it is called.
#include "fracgyro.h"
#include "mex.h"

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>

namespace {

using Handle = std::uint64_t;

std::map<Handle, fracgyro_state> controllers;

// Numbers that no earlier load of this file gave out, as they start at its time in microseconds.
Handle new_handle() {
    using namespace std::chrono;
    static Handle last =
        static_cast<Handle>(duration_cast<microseconds>(system_clock::now().time_since_epoch()).count());
    return ++last;
}

// By the numbers of fracgyro_status.
const char* const statuses[] = {"ok",        "saturated", "not_finite",  "out_of_range",
                                "restarted", "refused",   "implausible", "lost"};

const char* const names[] = FRACGYRO_EXAMPLE_NAMES;
constexpr fracgyro_number gyroscope[4][6] = FRACGYRO_EXAMPLE_GYROSCOPE;
constexpr fracgyro_number start[4] = FRACGYRO_EXAMPLE_START;

[[noreturn]] void refuse_argument(const char* name, const mxArray* found, const char* allowed) {
    char size[64];
    int length = 0;
    for (mwSize i = 0; i < mxGetNumberOfDimensions(found) && length < 40; ++i) {
        length += std::snprintf(size + length, sizeof size - static_cast<std::size_t>(length), "%s%llu",
                                i == 0 ? "" : "x", static_cast<unsigned long long>(mxGetDimensions(found)[i]));
    }
    mexErrMsgIdAndTxt("fracgyro:argument", "%s is %s %s%s: it must be %s", name, size,
                      mxIsComplex(found)  ? "complex "
                      : mxIsSparse(found) ? "sparse "
                                          : "",
                      mxGetClassName(found), allowed);
    throw 0;  // is not reached; mexErrMsgIdAndTxt is not declared so
}

fracgyro_vector vector(const char* name, const mxArray* given) {
    if (!(mxIsDouble(given) || mxIsSingle(given)) || mxIsComplex(given) || mxIsSparse(given) ||
        mxGetNumberOfElements(given) != 2) {
        refuse_argument(name, given, "two real numbers [x y], double or single");
    }
    if (mxIsSingle(given)) {
        const auto* numbers = static_cast<const float*>(mxGetData(given));
        return {static_cast<fracgyro_number>(numbers[0]), static_cast<fracgyro_number>(numbers[1])};
    }
    const double* numbers = mxGetPr(given);
    return {static_cast<fracgyro_number>(numbers[0]), static_cast<fracgyro_number>(numbers[1])};
}

mxArray* column(const fracgyro_number* numbers, int count) {
    mxArray* made = mxCreateDoubleMatrix(static_cast<mwSize>(count), 1, mxREAL);
    for (int i = 0; i < count; ++i) {
        mxGetPr(made)[i] = static_cast<double>(numbers[i]);
    }
    return made;
}

void set_field(mxArray* made, const char* name, mxArray* value) {
    mxSetFieldByNumber(made, 0, mxAddField(made, name), value);
}

mxArray* new_struct() { return mxCreateStructMatrix(1, 1, 0, nullptr); }

// Numbers whose names differ only after a dot or a bracket are one column.
mxArray* reported(const fracgyro_state& state) {
    fracgyro_report report{};
    fracgyro_read_report(&state, &report);
    const auto* numbers = reinterpret_cast<const fracgyro_number*>(&report);
    mxArray* made = new_struct();
    for (int first = 0, last = 0; first < FRACGYRO_REPORTED; first = last) {
        char name[64] = {};
        const std::size_t length = std::strcspn(names[first], ".[");
        std::strncpy(name, names[first], length < sizeof name ? length : sizeof name - 1);
        while (++last < FRACGYRO_REPORTED && std::strcspn(names[last], ".[") == length &&
               std::strncmp(names[last], name, length) == 0) {
        }
        set_field(made, name, column(numbers + first, last - first));
    }
    return made;
}

// Properties that all controllers of the scenario share.
mxArray* facts() {
    mxArray* units = new_struct();
    set_field(units, "step", mxCreateDoubleScalar(FRACGYRO_STEP_SECONDS));
    set_field(units, "length", mxCreateDoubleScalar(FRACGYRO_LENGTH_UNIT));
    set_field(units, "velocity", mxCreateDoubleScalar(FRACGYRO_VELOCITY_UNIT));
    set_field(units, "force", mxCreateDoubleScalar(FRACGYRO_FORCE_UNIT));
    set_field(units, "damping", mxCreateDoubleScalar(FRACGYRO_DAMPING_UNIT));
    set_field(units, "stiffness", mxCreateDoubleScalar(FRACGYRO_STIFFNESS_UNIT));
    set_field(units, "rate", mxCreateDoubleScalar(FRACGYRO_RATE_UNIT));
    mxArray* plant = mxCreateDoubleMatrix(4, 6, mxREAL);
    for (int i = 0; i < 24; ++i) {
        mxGetPr(plant)[i] = static_cast<double>(gyroscope[i % 4][i / 4]);
    }
    mxArray* made = new_struct();
    set_field(made, "units", units);
    set_field(made, "number", mxCreateString(sizeof(fracgyro_number) == sizeof(double) ? "double" : "single"));
    set_field(made, "velocity_sensed", mxCreateLogicalScalar(FRACGYRO_VELOCITY_SENSED != 0));
    set_field(made, "gyroscope", plant);
    set_field(made, "start", column(start, 4));
    set_field(made, "statuses", mxCreateCharMatrixFromStrings(FRACGYRO_LOST + 1, const_cast<const char**>(statuses)));
    return made;
}

mxArray* saved(const fracgyro_state& state) {
    mxArray* made = mxCreateNumericMatrix(sizeof(fracgyro_saved), 1, mxUINT8_CLASS, mxREAL);
    fracgyro_saved copy;
    fracgyro_save(&state, &copy);
    std::memcpy(mxGetData(made), &copy, sizeof copy);
    return made;
}

void restore(fracgyro_state& state, const mxArray* given) {
    if (!mxIsUint8(given) || mxGetNumberOfElements(given) != sizeof(fracgyro_saved)) {
        char allowed[64];
        std::snprintf(allowed, sizeof allowed, "the %u bytes (uint8) that save returned",
                      static_cast<unsigned>(sizeof(fracgyro_saved)));
        refuse_argument("saved", given, allowed);
    }
    fracgyro_saved copy;
    std::memcpy(&copy, mxGetData(given), sizeof copy);
    if (fracgyro_restore(&state, &copy) != FRACGYRO_OK) {
        mexErrMsgIdAndTxt("fracgyro:refused",
                          "saved was not restored: it is damaged, or was saved by another controller");
    }
}

// Returns 0, which no controller has, if `given` is not a handle.
Handle handle_in(const mxArray* given) {
    return mxIsUint64(given) && mxGetNumberOfElements(given) == 1 ? *static_cast<const Handle*>(mxGetData(given)) : 0;
}

fracgyro_state& controller(const mxArray* given) {
    const auto found = controllers.find(handle_in(given));
    if (found != controllers.end()) {
        return found->second;
    }
    mexErrMsgIdAndTxt("fracgyro:cleared", "the controller was deleted, or cleared with fracgyro_mex: make a new one");
    throw 0;  // is not reached
}

mxArray* make() {
    const Handle handle = new_handle();
    fracgyro_init(&controllers[handle]);
    mxArray* made = mxCreateNumericMatrix(1, 1, mxUINT64_CLASS, mxREAL);
    *static_cast<Handle*>(mxGetData(made)) = handle;
    return made;
}

}  // namespace

// fracgyro_mex(COMMAND, HANDLE, ...), called by Fracgyro.m only.
void mexFunction(int count, mxArray* out[], int given, const mxArray* in[]) {
    char command[8] = {};
    if (given < 1 || mxGetString(in[0], command, sizeof command) != 0) {
        mexErrMsgIdAndTxt("fracgyro:argument", "fracgyro_mex is called by Fracgyro only: use c = Fracgyro()");
    }
    const auto is = [&](const char* name, int arguments) {
        return std::strcmp(command, name) == 0 && given == 1 + arguments;
    };
    if (is("step", 3)) {
        fracgyro_state& state = controller(in[1]);
        const fracgyro_motion motion{vector("position", in[2]), vector("velocity", in[3])};
        fracgyro_vector force;
        const fracgyro_status status = fracgyro_step(&state, &motion, &force);
        const fracgyro_number numbers[] = {force.x, force.y};
        out[0] = column(numbers, 2);
        if (count > 1) {
            out[1] = mxCreateString(statuses[status]);
        }
    } else if (is("report", 1)) {
        out[0] = reported(controller(in[1]));
    } else if (is("new", 0)) {
        out[0] = make();
    } else if (is("facts", 0)) {
        out[0] = facts();
    } else if (is("reset", 1)) {
        fracgyro_init(&controller(in[1]));
    } else if (is("save", 1)) {
        out[0] = saved(controller(in[1]));
    } else if (is("restore", 2)) {
        restore(controller(in[1]), in[2]);
    } else if (is("delete", 1)) {
        controllers.erase(handle_in(in[1]));
    } else {
        mexErrMsgIdAndTxt("fracgyro:argument", "fracgyro_mex is called by Fracgyro only: use c = Fracgyro()");
    }
}
