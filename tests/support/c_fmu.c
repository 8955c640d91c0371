/* A small FMI 2.0 co-simulation slave written for the tests: a mass on a spring with a damper,
 *
 *     dx/dt = v,   m dv/dt = force - stiffness x - damping v,
 *
 * integrated by the classical Runge-Kutta method with steps of at most 1 ms.
 * The macro FAULT_<name> compiles one deliberate fault in; without any of them the slave is correct. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "fmi2Functions.h"
#ifdef FAULT_python_exception
#include "python_exception.h"
#endif

#ifndef FMU_GUID
#define FMU_GUID "{00000000-0000-0000-0000-000000000000}"
#endif

enum { VR_FORCE = 0, VR_STIFFNESS, VR_DAMPING, VR_MASS, VR_X, VR_V, VR_DER_X, VR_DER_V, VR_ENERGY, VR_TIME };

typedef struct {
    double force, stiffness, damping, mass, x, v, time;
    int32_t steps, gain, mode;
    int32_t moving, enabled;
    char label[64];
} State;

typedef enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED, FAILED } Phase;

typedef struct {
    State s;
    Phase phase;
    double start, hidden;
    fmi2CallbackFunctions callbacks;
    char name[64], resources[1024];
} Instance;

static int instances = 0;
static char *volatile hoard = NULL; /* volatile, or the compiler removes the leaks */
#ifdef FAULT_shared_state
static double shared = 0.0;
#endif

#include "hostile.h"

#ifdef FAULT_marks_loading
__attribute__((constructor)) static void mark(void) {
    const char *path = getenv("LOADING_MARK");
    FILE *file = path ? fopen(path, "w") : NULL;
    if (file) fclose(file);
}
#endif

static State initial_state(void) {
    State s = {0.0, 40.0, 0.8, 1.0, 0.1, 0.0, 0.0, 0, 1, 2, 0, 1, "mass on a spring"};
#ifdef FAULT_default_mismatch
    s.gain = 3;
#endif
    return s;
}

static fmi2Status refuse(Instance *self, const char *message) {
    if (self->callbacks.logger)
        self->callbacks.logger(self->callbacks.componentEnvironment, self->name, fmi2Error, "logStatusError", message);
    return fmi2Error;
}

const char *fmi2GetTypesPlatform(void) {
#ifdef FAULT_types_platform
    return "exotic";
#endif
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void) {
#ifdef FAULT_version
    return "1.0";
#endif
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c; (void)on; (void)n; (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    AT(instantiate);
    (void)visible; (void)logging;
#ifdef FAULT_instantiate_null
    return NULL;
#endif
#ifdef FAULT_crash_instantiate
    abort();
#endif
#ifdef FAULT_instantiate_once
    if (instances > 0) return NULL;
#endif
    if (!name || !callbacks || type != fmi2CoSimulation) return NULL;
#ifndef FAULT_guid_ignored
    if (!guid || strcmp(guid, FMU_GUID) != 0) return NULL;
#endif
    Instance *self = calloc(1, sizeof(Instance));
    if (!self) return NULL;
    self->callbacks = *callbacks;
    self->s = initial_state();
    snprintf(self->name, sizeof self->name, "%s", name);
    if (resources && strncmp(resources, "file://", 7) == 0)
        snprintf(self->resources, sizeof self->resources, "%s", resources + 7);
    instances++;
#ifdef FAULT_instance_leak
    hoard = malloc(1 << 20);
    memset(hoard, 1, 1 << 20);
#endif
    return self;
}

void fmi2FreeInstance(fmi2Component c) {
    AT(free);
    if (!c) return;
    instances--;
#ifdef FAULT_crash_free
    abort();
#endif
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean td, fmi2Real tol, fmi2Real start, fmi2Boolean sd, fmi2Real stop) {
    AT(setup);
    Instance *self = c;
    (void)td; (void)tol; (void)sd; (void)stop;
    if (self->phase != INSTANTIATED) return refuse(self, "fmi2SetupExperiment must come before initialisation");
    self->s.time = self->start = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    AT(enter);
    Instance *self = c;
#ifdef FAULT_init_error
    return refuse(self, "cannot initialise");
#endif
    if (self->phase != INSTANTIATED) return refuse(self, "fmi2EnterInitializationMode must come once");
    self->phase = INITIALISING;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    AT(exit);
    Instance *self = c;
    if (self->phase != INITIALISING) return refuse(self, "fmi2ExitInitializationMode without Enter");
    self->phase = STEPPING;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    AT(terminate);
    Instance *self = c;
#ifdef FAULT_terminate_error
    return refuse(self, "cannot terminate");
#endif
    self->phase = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *self = c;
#ifdef FAULT_reset_error
    return refuse(self, "cannot reset");
#endif
    State fresh = initial_state();
#ifdef FAULT_reset_incomplete
    fresh.v = self->s.v;
#endif
    self->s = fresh;
    self->hidden = 0.0;
    self->phase = INSTANTIATED;
    return fmi2OK;
}

static double acceleration(const State *s, double x, double v) {
    return (s->force - s->stiffness * x - s->damping * v) / s->mass;
}

static double real_value(const Instance *self, fmi2ValueReference vr, int *known) {
    const State *s = &self->s;
    *known = 1;
    switch (vr) {
    case VR_FORCE: return s->force;
    case VR_STIFFNESS: return s->stiffness;
    case VR_DAMPING: return s->damping;
    case VR_MASS: return s->mass;
    case VR_X: return s->x;
    case VR_V: return s->v;
    case VR_DER_X: return s->v;
    case VR_DER_V: return acceleration(s, s->x, s->v);
    case VR_ENERGY: return 0.5 * s->mass * s->v * s->v + 0.5 * s->stiffness * s->x * s->x;
    case VR_TIME: return s->time;
    default: *known = 0; return 0.0;
    }
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    AT(get);
    Instance *self = c;
    int known = 1;
#ifdef FAULT_crash_get
    abort();
#endif
#ifdef FAULT_python_exception
    leave_exception();
#endif
    for (size_t i = 0; i < n; i++) {
        value[i] = real_value(self, vr[i], &known);
#ifdef HOSTILE
        if (orders.forced && vr[i] == VR_X) value[i] = orders.value;
#endif
#ifdef FAULT_crash_unknown_reference
        if (!known) abort();
#endif
#ifndef FAULT_unknown_reference
        if (!known) return refuse(self, "fmi2GetReal: unknown value reference");
#endif
#ifdef FAULT_nan_output
        if (vr[i] == VR_X && self->s.steps > 3) value[i] = NAN;
#endif
#ifdef FAULT_nan_initial
        if (vr[i] == VR_ENERGY) value[i] = NAN;
#endif
#ifdef FAULT_get_error
        if (vr[i] == VR_ENERGY) return refuse(self, "energy cannot be read");
#endif
#ifdef FAULT_out_of_range
        if (vr[i] == VR_ENERGY) value[i] = -5.0;
#endif
#ifdef FAULT_random
        if (vr[i] == VR_X && self->s.steps > 0) {
            static uint32_t seed = 1u;
            seed = seed * 1664525u + 1013904223u;
            value[i] += 1e-3 * (double)(seed >> 8) / 16777216.0;
        }
#endif
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    AT(set);
    Instance *self = c;
    State *s = &self->s;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(value[i])) return refuse(self, "values must be finite");
        int before = self->phase == INSTANTIATED || self->phase == INITIALISING;
#ifdef FAULT_input_refused
        if (vr[i] == VR_FORCE && value[i] != 0.0) return refuse(self, "force cannot be set");
#endif
#ifdef FAULT_input_late
        if (vr[i] == VR_FORCE && self->phase == INSTANTIATED) return refuse(self, "FMI 2.0 allows it in initialisation mode");
#endif
#ifdef FAULT_input_never
        if (vr[i] == VR_FORCE && self->phase == INITIALISING) return refuse(self, "force cannot be set");
#endif
#ifdef FAULT_set_refused
        if (vr[i] == VR_STIFFNESS) return refuse(self, "stiffness cannot be set");
#endif
#ifdef FAULT_set_has_effect
        if (vr[i] == VR_V) s->x += 0.01;
#endif
        if (vr[i] == VR_FORCE) s->force = value[i];
        else if (vr[i] == VR_DAMPING) s->damping = value[i];
        else if (vr[i] == VR_STIFFNESS && before) s->stiffness = value[i];
        else if (vr[i] == VR_MASS && before && value[i] > 0.0) s->mass = value[i];
#ifdef FAULT_set_output_refused
        else if (vr[i] == VR_X) return refuse(self, "x is an output");
#endif
        else if (vr[i] == VR_X && before) s->x = value[i];
        else if (vr[i] == VR_V && before) s->v = value[i];
        else return refuse(self, "fmi2SetReal: the variable cannot be set now");
    }
#ifdef FAULT_shared_state
    shared = s->force;
#endif
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    Instance *self = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 0) value[i] = self->s.steps;
        else if (vr[i] == 1) value[i] = self->s.gain;
        else if (vr[i] == 2) value[i] = self->s.mode;
        else return refuse(self, "fmi2GetInteger: unknown value reference");
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    Instance *self = c;
    if (self->phase > INITIALISING) return refuse(self, "a fixed parameter cannot be set now");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 1) self->s.gain = value[i];
        else if (vr[i] == 2) self->s.mode = value[i];
        else return refuse(self, "fmi2SetInteger: the variable cannot be set");
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    Instance *self = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == 0) value[i] = self->s.enabled;
        else if (vr[i] == 1) value[i] = self->s.moving;
        else return refuse(self, "fmi2GetBoolean: unknown value reference");
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    Instance *self = c;
    if (self->phase > INITIALISING) return refuse(self, "a fixed parameter cannot be set now");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0) return refuse(self, "fmi2SetBoolean: the variable cannot be set");
        self->s.enabled = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    Instance *self = c;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0) return refuse(self, "fmi2GetString: unknown value reference");
        value[i] = self->s.label;
#ifdef FAULT_null_string
        value[i] = NULL;
#endif
    }
    return fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    Instance *self = c;
    if (self->phase > INITIALISING) return refuse(self, "a fixed parameter cannot be set now");
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != 0 || !value[i]) return refuse(self, "fmi2SetString: the variable cannot be set");
        snprintf(self->s.label, sizeof self->s.label, "%s", value[i]);
    }
    return fmi2OK;
}

#include "c_fmu_steps.h"
