/* The functions of FMI 3.0 for a co-simulation unit whose variables are numbers in double precision; the unit itself is in unit.h. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "unit.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;

typedef void (*log_function)(void *environment, fmi3Status status, const char *category, const char *message);

typedef struct {
    unit_state state;
    double values[UNIT_VARIABLES];
    void *environment;
    log_function log;
} instance;

/* Largest distance of a step from whole sample periods, sample periods. */
#define WHOLE 1e-6

static fmi3Status fail(const instance *unit, const char *message) {
    if (unit && unit->log) {
        unit->log(unit->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Status fmi3SetDebugLogging(void *unit, bool on, size_t n, const char *const categories[]) {
    (void)unit, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool events, bool early, const uint32_t intermediate[], size_t n, void *environment,
                                         log_function log, void *update) {
    instance *unit;
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)intermediate, (void)n, (void)update;
    if (!token || strcmp(token, UNIT_TOKEN) != 0) {
        if (log) {
            log(environment, fmi3Error, "logStatusError", "the instantiation token is not that of this library");
        }
        return NULL;
    }
    unit = calloc(1, sizeof *unit);
    if (unit) {
        unit->environment = environment;
        unit->log = log;
        unit_reset(&unit->state, unit->values);
    }
    return unit;
}

EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }

EXPORT void fmi3FreeInstance(void *unit) { free(unit); }

EXPORT fmi3Status fmi3EnterInitializationMode(void *unit, bool tolerance_defined, double tolerance, double start, bool stop_defined,
                                              double stop) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((instance *)unit)->values[0] = start;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(void *unit) {
    instance *own = unit;
    unit_reset(&own->state, own->values);
    return fmi3OK;
}

EXPORT fmi3Status fmi3Terminate(void *unit) {
    (void)unit;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(void *unit) {
    instance *own = unit;
    memset(own->values, 0, sizeof own->values);
    unit_reset(&own->state, own->values);
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFloat64(void *unit, const uint32_t references[], size_t n, double values[], size_t n_values) {
    const instance *own = unit;
    size_t k;
    if (n != n_values) {
        return fail(own, "every variable has one value");
    }
    for (k = 0; k < n; k++) {
        if (references[k] >= UNIT_VARIABLES) {
            return fail(own, "there is no variable with this reference");
        }
        values[k] = own->values[references[k]];
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(void *unit, const uint32_t references[], size_t n, const double values[], size_t n_values) {
    instance *own = unit;
    size_t k;
    if (n != n_values) {
        return fail(own, "every variable has one value");
    }
    for (k = 0; k < n; k++) {
        if (references[k] >= UNIT_VARIABLES || !UNIT_INPUT[references[k]]) {
            return fail(own, "only inputs are set");
        }
        own->values[references[k]] = values[k];
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(void *unit, double time, double step, bool no_set_state, bool *event, bool *terminate, bool *early,
                             double *last_time) {
    instance *own = unit;
    double samples = step / UNIT_PERIOD_S;
    double whole = floor(samples + 0.5);
    double k;
    (void)no_set_state;
    *event = false;
    *terminate = false;
    *early = false;
    *last_time = time;
    if (!(whole >= 1.0 && fabs(samples - whole) <= WHOLE * whole)) {
        return fail(own, "a step must be a whole number of sample periods (fixedInternalStepSize)");
    }
    for (k = 0.0; k < whole; k += 1.0) {
        unit_step(&own->state, own->values);
    }
    own->values[0] = time + step;
    *last_time = time + step;
    return fmi3OK;
}

/* What the description does not offer: other interfaces, other types, states, derivatives, events, clocks. */
#define ABSENT(name)                                                                                                               \
    EXPORT fmi3Status name(void *unit) { return fail(unit, #name ": this unit does not offer it"); }
ABSENT(fmi3GetFloat32)
ABSENT(fmi3GetInt8)
ABSENT(fmi3GetUInt8)
ABSENT(fmi3GetInt16)
ABSENT(fmi3GetUInt16)
ABSENT(fmi3GetInt32)
ABSENT(fmi3GetUInt32)
ABSENT(fmi3GetInt64)
ABSENT(fmi3GetUInt64)
ABSENT(fmi3GetBoolean)
ABSENT(fmi3GetString)
ABSENT(fmi3GetBinary)
ABSENT(fmi3GetClock)
ABSENT(fmi3SetFloat32)
ABSENT(fmi3SetInt8)
ABSENT(fmi3SetUInt8)
ABSENT(fmi3SetInt16)
ABSENT(fmi3SetUInt16)
ABSENT(fmi3SetInt32)
ABSENT(fmi3SetUInt32)
ABSENT(fmi3SetInt64)
ABSENT(fmi3SetUInt64)
ABSENT(fmi3SetBoolean)
ABSENT(fmi3SetString)
ABSENT(fmi3SetBinary)
ABSENT(fmi3SetClock)
ABSENT(fmi3GetNumberOfVariableDependencies)
ABSENT(fmi3GetVariableDependencies)
ABSENT(fmi3GetFMUState)
ABSENT(fmi3SetFMUState)
ABSENT(fmi3FreeFMUState)
ABSENT(fmi3SerializedFMUStateSize)
ABSENT(fmi3SerializeFMUState)
ABSENT(fmi3DeserializeFMUState)
ABSENT(fmi3GetDirectionalDerivative)
ABSENT(fmi3GetAdjointDerivative)
ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3EnterEventMode)
ABSENT(fmi3EnterStepMode)
ABSENT(fmi3GetOutputDerivatives)
ABSENT(fmi3GetIntervalDecimal)
ABSENT(fmi3GetIntervalFraction)
ABSENT(fmi3GetShiftDecimal)
ABSENT(fmi3GetShiftFraction)
ABSENT(fmi3SetIntervalDecimal)
ABSENT(fmi3SetIntervalFraction)
ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction)
ABSENT(fmi3EvaluateDiscreteStates)
ABSENT(fmi3UpdateDiscreteStates)
ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep)
ABSENT(fmi3SetTime)
ABSENT(fmi3SetContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives)
ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates)
ABSENT(fmi3ActivateModelPartition)
