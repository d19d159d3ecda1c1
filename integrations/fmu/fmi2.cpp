// The names of FMI 2.0 for co-simulation.
#include "shared.hpp"

#include "fmi2Functions.h"

namespace {

using fracgyro::Instance;

struct Component {
    Instance instance{};
    fmi2CallbackFunctions callbacks{};
    char name[64] = "";

    // The reason of a failure goes to the importer's logger.
    fmi2Status status(bool worked) { return worked ? fmi2OK : failed(instance.problem()); }
    fmi2Status stepped(bool worked) {
        const char* const warning = instance.warning();
        if (!worked || warning == nullptr) {
            return status(worked);
        }
        if (callbacks.logger != nullptr) {
            callbacks.logger(callbacks.componentEnvironment, name, fmi2Warning, "logStatusWarning", warning);
        }
        return fmi2Warning;
    }
    fmi2Status failed(const char* why) {
        if (callbacks.logger != nullptr) {
            callbacks.logger(callbacks.componentEnvironment, name, fmi2Error, "logStatusError", why);
        }
        return fmi2Error;
    }
};

Component& of(fmi2Component c) { return *static_cast<Component*>(c); }

fmi2Status not_offered(fmi2Component c) { return of(c).failed("this FMU offers no such function"); }

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform() { return fmi2TypesPlatform; }
const char* fmi2GetVersion() { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component, fmi2Boolean, size_t, const fmi2String[]) { return fmi2OK; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String,
                              const fmi2CallbackFunctions* callbacks, fmi2Boolean, fmi2Boolean) {
    auto* const component = fracgyro::make<Component>();
    if (component == nullptr) {
        return nullptr;
    }
    if (callbacks != nullptr) {
        component->callbacks = *callbacks;
    }
    std::snprintf(component->name, sizeof component->name, "%s", name == nullptr ? "" : name);
    const char* const wrong = type != fmi2CoSimulation ? "this FMU supports co-simulation only"
                              : guid == nullptr || std::strcmp(guid, fracgyro::exported::token) != 0
                                  ? "the GUID is not this FMU's: the model description belongs to another FMU"
                                  : nullptr;
    if (wrong != nullptr) {
        component->failed(wrong);
        fracgyro::destroy(component);
        return nullptr;
    }
    return component;
}
void fmi2FreeInstance(fmi2Component c) { fracgyro::destroy(static_cast<Component*>(c)); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean, fmi2Real, fmi2Real start_time, fmi2Boolean, fmi2Real) {
    return of(c).status(of(c).instance.start_at(start_time));
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return of(c).status(of(c).instance.initialize()); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return of(c).status(of(c).instance.start()); }
fmi2Status fmi2Terminate(fmi2Component c) { return of(c).status(of(c).instance.terminate()); }
fmi2Status fmi2Reset(fmi2Component c) {
    of(c).instance.reset();
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    return fracgyro::get_values(of(c), vr, n, values);
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer values[]) {
    return fracgyro::get_values(of(c), vr, n, values);
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference[], size_t n, fmi2Boolean[]) {
    return n == 0 ? fmi2OK : not_offered(c);
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference[], size_t n, fmi2String[]) {
    return n == 0 ? fmi2OK : not_offered(c);
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    return fracgyro::set_values(of(c), vr, n, values);
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer values[]) {
    return fracgyro::set_values(of(c), vr, n, values);
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference[], size_t n, const fmi2Boolean[]) {
    return n == 0 ? fmi2OK : not_offered(c);
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference[], size_t n, const fmi2String[]) {
    return n == 0 ? fmi2OK : not_offered(c);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) { return fracgyro::get_state(of(c), state); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return fracgyro::set_state(of(c), state); }
fmi2Status fmi2FreeFMUstate(fmi2Component, fmi2FMUstate* state) {
    fracgyro::free_state(state);
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t* size) {
    *size = Instance::saved_size;
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return fracgyro::serialize(of(c), state, bytes, size);
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate* state) {
    return fracgyro::deserialize(of(c), bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2ValueReference[],
                                        size_t, const fmi2Real[], fmi2Real[]) {
    return not_offered(c);
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2Integer[],
                                       const fmi2Real[]) {
    return not_offered(c);
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference[], size_t, const fmi2Integer[],
                                        fmi2Real[]) {
    return not_offered(c);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real length, fmi2Boolean) {
    return of(c).stepped(of(c).instance.advance(time, length));
}
fmi2Status fmi2CancelStep(fmi2Component c) { return not_offered(c); }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind, fmi2Status*) { return not_offered(c); }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind, fmi2Real*) { return not_offered(c); }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind, fmi2Integer*) { return not_offered(c); }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind, fmi2Boolean*) { return not_offered(c); }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind, fmi2String*) { return not_offered(c); }

}  // extern "C"
