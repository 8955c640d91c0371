/* A ball that bounces, with a clocked counter and arrays: an FMU of FMI 3.0 for the tests, correct or with one fault.
 * Between bounces its motion is in closed form. Co-simulation, model exchange and scheduled execution. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <signal.h>
#include "fmi3Functions.h"
#ifdef FAULT_python_exception
#include "python_exception.h"
#endif
#ifdef HOSTILE
static void *volatile hoard;
#endif
#include "hostile.h"

#ifndef TOKEN
#define TOKEN "{ball}"
#endif
enum { X = 1, V, U, G, E, BOUNCES, N, P, Q, LABEL, TITLE, BLOB, FLAG, MODE, SMALL, COUNT, TIME, DER_X, DER_V, SMOOTH, OLD,
       BIG, TICK = 100, HIT, KICK };
enum { SIZE = 8, TEXT = 64 };
enum { INSTANTIATED, CONFIGURATION, INITIALISATION, EVENT, CONTINUOUS, STEP, ACTIVATION, TERMINATED };

typedef struct {
    double x, v, u, g, e, time, p[SIZE], smooth, old, hidden;
    float small;
    int32_t bounces, count;
    uint64_t n, big;
    int64_t mode;
    bool flag, tick, hit;
    char label[TEXT];
    int steps, echo;
} State;

typedef struct {
    State s;
    int kind, mode, before, updating;
    bool interval;
    bool events, early;
    char resources[512];
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
    fmi3LockPreemptionCallback lock;
    fmi3UnlockPreemptionCallback unlock;
    char blob[4];
} Ball;

static int alive;
static Ball *latest;
#ifdef FAULT_random
static unsigned long seed;
#endif

static fmi3Status refuse(Ball *b, const char *text) {
    if (b->log) b->log(b->environment, fmi3Error, "error", text);
    return fmi3Error;
}

static void start(Ball *b) {
    State fresh = {.x = 1.0, .g = 9.81, .e = 0.7, .n = 3, .p = {1, 2, 3}, .small = 0.5f, .mode = 1, .label = "ball", .big = 7};
#ifdef FAULT_start_mismatch
    fresh.e = 0.6;
#endif
#ifdef FAULT_reset_incomplete
    if (b->s.steps) fresh.hidden = 0.5;
#endif
#ifdef FAULT_reset_clock
    fresh.count = b->s.count;
#endif
    b->s = fresh;
    b->mode = INSTANTIATED;
}

static Ball *make(int kind, const char *token, const char *resources, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    AT(instantiate);
#ifdef FAULT_instantiate_null
    return NULL;
#endif
#ifndef FAULT_token_ignored
    if (!token || strcmp(token, TOKEN)) return NULL;
#endif
#ifdef FAULT_second_refused
    if (alive) return NULL;
#endif
    Ball *b = calloc(1, sizeof *b);
    b->kind = kind;
    b->environment = environment;
    b->log = log;
    snprintf(b->resources, sizeof b->resources, "%s", resources ? resources : "");
    start(b);
    alive++;
#ifdef FAULT_instance_leak
    for (char *leak = malloc(1 << 20), *k = leak; k < leak + (1 << 20); k += 512) *(volatile char *)k = 1;
#endif
    return b;
}

FMI3_Export const char *fmi3GetVersion(void) {
#ifdef FAULT_version
    return "2.0";
#endif
    return "3.0";
}
FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String c[]) { return fmi3OK; }
FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    return make(0, token, resources, environment, log);
}
FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    Ball *b = make(1, token, resources, environment, log);
    if (b) { b->events = events; b->early = early; b->update = update; }
    return b;
}
FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    Ball *b = make(2, token, resources, environment, log);
    if (b) { b->lock = lock; b->unlock = unlock; }
    return b;
}
FMI3_Export void fmi3FreeInstance(fmi3Instance i) {
    AT(free);
#ifdef FAULT_crash_free
    abort();
#endif
    if (i) alive--;
    free(i);
}

static fmi3Status go(Ball *b, int from, int to) {
    if (b->mode != from) return refuse(b, "this call is not allowed now");
    b->mode = to;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean t, fmi3Float64 tolerance, fmi3Float64 begin, fmi3Boolean s, fmi3Float64 stop) {
    AT(enter);
#ifdef FAULT_init_error
    return refuse(i, "no solution");
#endif
    ((Ball *)i)->s.time = begin;
    return go(i, INSTANTIATED, INITIALISATION);
}
FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance i) {
    Ball *b = i;
    AT(exit);
#ifdef FAULT_exit_error
    return refuse(i, "no solution");
#endif
#ifdef FAULT_interval_wanted
    if (!b->interval) return refuse(b, "the interval of a fixed clock must be set");
#endif
    int next = b->kind == 0 ? EVENT : b->kind == 2 ? ACTIVATION : b->events ? EVENT : STEP;
    return go(b, INITIALISATION, next);
}
FMI3_Export fmi3Status fmi3EnterEventMode(fmi3Instance i) {
    Ball *b = i;
#ifndef FAULT_event_mode
    if (b->kind == 1 && !b->events) return refuse(b, "event mode is not used");
#endif
    return go(b, b->kind == 0 ? CONTINUOUS : STEP, EVENT);
}
FMI3_Export fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return go(i, EVENT, CONTINUOUS); }
FMI3_Export fmi3Status fmi3EnterStepMode(fmi3Instance i) { return go(i, EVENT, STEP); }
FMI3_Export fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) {
#ifdef FAULT_configuration_refused
    return refuse(i, "not now");
#endif
    Ball *b = i;
    if (b->mode == STEP || (b->mode == EVENT && b->kind == 0)) {
#ifdef FAULT_reconfiguration_refused
        return refuse(b, "only before the run");
#endif
        b->before = b->mode;
        b->mode = CONFIGURATION;
        return fmi3OK;
    }
    b->before = INSTANTIATED;
    return go(b, INSTANTIATED, CONFIGURATION);
}
FMI3_Export fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return go(i, CONFIGURATION, ((Ball *)i)->before); }
FMI3_Export fmi3Status fmi3Terminate(fmi3Instance i) {
    AT(terminate);
#ifdef FAULT_terminate_error
    return refuse(i, "cannot end");
#endif
    ((Ball *)i)->mode = TERMINATED;
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3Reset(fmi3Instance i) {
#ifdef FAULT_reset_error
    return refuse(i, "cannot be reset");
#endif
    start(i);
    return fmi3OK;
}

#include "ball3_values.h"
#include "ball3_steps.h"
