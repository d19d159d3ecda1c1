// The names of FMI 3.0 for co-simulation, with scalar variables.
#include "shared.hpp"

#include "fmi3Functions.h"

namespace {

using fracgyro::Instance;

struct Component {
    Instance instance{};
    fmi3InstanceEnvironment environment = nullptr;
    fmi3LogMessageCallback log = nullptr;

    // The reason of a failure goes to the importer's logger.
    fmi3Status status(bool worked) { return worked ? fmi3OK : failed(instance.problem()); }
    fmi3Status stepped(bool worked) {
        const char* const warning = instance.warning();
        if (!worked || warning == nullptr) {
            return status(worked);
        }
        if (log != nullptr) {
            log(environment, fmi3Warning, "logStatusWarning", warning);
        }
        return fmi3Warning;
    }
    fmi3Status failed(const char* why) {
        if (log != nullptr) {
            log(environment, fmi3Error, "logStatusError", why);
        }
        return fmi3Error;
    }
};

Component& of(fmi3Instance c) { return *static_cast<Component*>(c); }

fmi3Status not_scalar(fmi3Instance c) { return of(c).failed("all variables are scalars: each has one value"); }

}  // namespace

extern "C" {

const char* fmi3GetVersion() { return fmi3Version; }
fmi3Status fmi3SetDebugLogging(fmi3Instance, fmi3Boolean, size_t, const fmi3String[]) { return fmi3OK; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String, fmi3String token, fmi3String, fmi3Boolean, fmi3Boolean,
                                         fmi3Boolean, fmi3Boolean, const fmi3ValueReference[], size_t,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback) {
    auto* const component = fracgyro::make<Component>();
    if (component == nullptr) {
        return nullptr;
    }
    component->environment = environment;
    component->log = log;
    if (token == nullptr || std::strcmp(token, fracgyro::exported::token) != 0) {
        component->failed("the instantiation token is not that of this FMU: its model description is of another one");
        fracgyro::destroy(component);
        return nullptr;
    }
    return component;
}
fmi3Instance fmi3InstantiateModelExchange(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                          fmi3InstanceEnvironment, fmi3LogMessageCallback) {
    return nullptr;
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                               fmi3InstanceEnvironment, fmi3LogMessageCallback, fmi3ClockUpdateCallback,
                                               fmi3LockPreemptionCallback, fmi3UnlockPreemptionCallback) {
    return nullptr;
}
void fmi3FreeInstance(fmi3Instance c) { fracgyro::destroy(static_cast<Component*>(c)); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean, fmi3Float64, fmi3Float64 start_time, fmi3Boolean,
                                       fmi3Float64) {
    return of(c).status(of(c).instance.start_at(start_time) && of(c).instance.initialize());
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return of(c).status(of(c).instance.start()); }
fmi3Status fmi3Terminate(fmi3Instance c) { return of(c).status(of(c).instance.terminate()); }
fmi3Status fmi3Reset(fmi3Instance c) {
    of(c).instance.reset();
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[], size_t m) {
    return n == m ? fracgyro::get_values(of(c), vr, n, values) : not_scalar(c);
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 values[],
                          size_t m) {
    return n == m ? fracgyro::set_values(of(c), vr, n, values) : not_scalar(c);
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 values[], size_t m) {
    return n == m ? fracgyro::get_values(of(c), vr, n, values) : not_scalar(c);
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 values[], size_t m) {
    return n == m ? fracgyro::set_values(of(c), vr, n, values) : not_scalar(c);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState* state) { return fracgyro::get_state(of(c), state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return fracgyro::set_state(of(c), state); }
fmi3Status fmi3FreeFMUState(fmi3Instance, fmi3FMUState* state) {
    fracgyro::free_state(state);
    return fmi3OK;
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t* size) {
    *size = Instance::saved_size;
    return fmi3OK;
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return fracgyro::serialize(of(c), state, bytes, size);
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState* state) {
    return fracgyro::deserialize(of(c), bytes, size, state);
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 length, fmi3Boolean, fmi3Boolean* event,
                      fmi3Boolean* terminate, fmi3Boolean* early, fmi3Float64* reached) {
    *event = *terminate = *early = false;
    const bool worked = of(c).instance.advance(time, length);
    *reached = worked ? time + length : time;
    return of(c).stepped(worked);
}

// Functions that an importer may look up even though the description of this FMU declares none of them: other types,
// events, clocks, derivatives, model exchange.
#define NOT_OFFERED(name, ...) \
    fmi3Status name(fmi3Instance c __VA_OPT__(, ) __VA_ARGS__) { return of(c).failed("this FMU has no " #name); }
#define REFERENCES const fmi3ValueReference[], size_t
#define NO_VARIABLES_OF(Type)                                    \
    NOT_OFFERED(fmi3Get##Type, REFERENCES, fmi3##Type[], size_t) \
    NOT_OFFERED(fmi3Set##Type, REFERENCES, const fmi3##Type[], size_t)

NO_VARIABLES_OF(Float32)
NO_VARIABLES_OF(Int8)
NO_VARIABLES_OF(UInt8)
NO_VARIABLES_OF(Int16)
NO_VARIABLES_OF(UInt16)
NO_VARIABLES_OF(UInt32)
NO_VARIABLES_OF(Int64)
NO_VARIABLES_OF(UInt64)
NO_VARIABLES_OF(Boolean)
NO_VARIABLES_OF(String)
NOT_OFFERED(fmi3GetBinary, REFERENCES, size_t[], fmi3Binary[], size_t)
NOT_OFFERED(fmi3SetBinary, REFERENCES, const size_t[], const fmi3Binary[], size_t)
NOT_OFFERED(fmi3GetClock, REFERENCES, fmi3Clock[])
NOT_OFFERED(fmi3SetClock, REFERENCES, const fmi3Clock[])

NOT_OFFERED(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64[], fmi3IntervalQualifier[])
NOT_OFFERED(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64[])
NOT_OFFERED(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64[], fmi3UInt64[], fmi3IntervalQualifier[])
NOT_OFFERED(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64[], const fmi3UInt64[])
NOT_OFFERED(fmi3GetShiftDecimal, REFERENCES, fmi3Float64[])
NOT_OFFERED(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64[])
NOT_OFFERED(fmi3GetShiftFraction, REFERENCES, fmi3UInt64[], fmi3UInt64[])
NOT_OFFERED(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64[], const fmi3UInt64[])
NOT_OFFERED(fmi3ActivateModelPartition, fmi3ValueReference, fmi3Float64)

NOT_OFFERED(fmi3EnterConfigurationMode)
NOT_OFFERED(fmi3ExitConfigurationMode)
NOT_OFFERED(fmi3EnterEventMode)
NOT_OFFERED(fmi3EnterStepMode)
NOT_OFFERED(fmi3EnterContinuousTimeMode)
NOT_OFFERED(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3UpdateDiscreteStates, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
            fmi3Float64*)
NOT_OFFERED(fmi3CompletedIntegratorStep, fmi3Boolean, fmi3Boolean*, fmi3Boolean*)
NOT_OFFERED(fmi3SetTime, fmi3Float64)
NOT_OFFERED(fmi3SetContinuousStates, const fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetContinuousStates, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetContinuousStateDerivatives, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetEventIndicators, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetNumberOfEventIndicators, size_t*)
NOT_OFFERED(fmi3GetNumberOfContinuousStates, size_t*)
NOT_OFFERED(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32[], fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetDirectionalDerivative, REFERENCES, REFERENCES, const fmi3Float64[], size_t, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetAdjointDerivative, REFERENCES, REFERENCES, const fmi3Float64[], size_t, fmi3Float64[], size_t)
NOT_OFFERED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference, size_t*)
NOT_OFFERED(fmi3GetVariableDependencies, fmi3ValueReference, size_t[], fmi3ValueReference[], size_t[],
            fmi3DependencyKind[], size_t)

}  // extern "C"
