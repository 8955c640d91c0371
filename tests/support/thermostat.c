/* A room with a thermostat as an FMU of FMI 2.0, co-simulation and model exchange: a switch far from where values lead
 * that are a tenth beside those of the file, and absolute temperatures.
 *
 *     dT/dt = heat P - (T - outside) / tau        heat: on below set - 0.5 K, off above set + 0.5 K
 *
 * It is correct, or has the one fault that the macro FAULT names; least_power and opening are legal variants: a parameter
 * that acts far from its value alone, and an output that is zero at the start whatever the inputs are. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"

#ifndef FAULT
#define FAULT ""
#endif
#define API FMI2_Export
#define IS(name) (!strcmp(FAULT, #name))
#define NEVER(name, ...) API fmi2Status fmi2##name(fmi2Component c, __VA_ARGS__) { return fmi2Error; }
enum { TIME, OUTSIDE, SET, POWER, THICK, T, DT, LOSS, HEAT, COUNT };
enum { INSTANTIATED, INITIALISATION, EVENT, CONTINUOUS, STEP, TERMINATED };
typedef const fmi2ValueReference *References;

typedef struct {
    double time, start, outside, set, power, x, loss;
    int thick, heat, count, steps;
} State;
typedef struct { State s; int phase, exchange; } Room;

static double loss(const State *s) { return (s->x - s->outside) / (s->thick || IS(dead_truth) ? 100.0 : 80.0); }
static double shown(const State *s) { return loss(s) * (IS(opening) ? fmin(s->time - s->start, 1.0) : 1.0); }
static double power(const State *s) { return IS(least_power) ? fmax(s->power, 0.7) : s->power; }
static double rate(const State *s) { return (s->heat ? power(s) : 0.0) - loss(s); }
static int switches(State *s) {
    int old = s->heat;
    if (s->x > s->set + 0.5) s->heat = 0;
    if (s->x < s->set - 0.5) s->heat = 1;
    s->count += s->heat != old;
    return s->heat != old;
}
static void begin(Room *r) {
    int count = r->s.count;
    r->s = (State){.outside = 275.0, .set = 293.0, .power = 0.5, .x = 292.0, .thick = 1, .loss = 0.17};
    if (IS(keep_count)) r->s.count = count;
    r->phase = INSTANTIATED;
}
static void settle(Room *r) {
    if (r->phase <= INITIALISATION) r->s.heat = r->s.x < r->s.set;
    if (!IS(late_loss) || r->phase > INITIALISATION) r->s.loss = shown(&r->s);
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) { return fmi2OK; }
API fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging) {
    if (strcmp(guid, "{room-of-the-tests}")) return NULL;
    Room *r = calloc(1, sizeof *r);
    r->exchange = type == fmi2ModelExchange;
    begin(r);
    return r;
}
API void fmi2FreeInstance(fmi2Component c) { free(c); }
static fmi2Status go(Room *r, int from, int to) {
    if (r->phase != from) return fmi2Error;
    settle(r);
    r->phase = to;
    settle(r);
    return fmi2OK;
}
API fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real tolerance, fmi2Real start, fmi2Boolean b, fmi2Real stop) {
    Room *r = c;
    r->s.time = r->s.start = start;
    return r->phase == INSTANTIATED ? fmi2OK : fmi2Error;
}
API fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return go(c, INSTANTIATED, INITIALISATION); }
API fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return go(c, INITIALISATION, ((Room *)c)->exchange ? EVENT : STEP); }
API fmi2Status fmi2Terminate(fmi2Component c) { ((Room *)c)->phase = TERMINATED; return fmi2OK; }
API fmi2Status fmi2Reset(fmi2Component c) { begin(c); return fmi2OK; }
API fmi2Status fmi2GetReal(fmi2Component c, References r, size_t n, fmi2Real v[]) {
    State *s = &((Room *)c)->s;
    if (!IS(late_loss) || ((Room *)c)->phase > INITIALISATION) s->loss = shown(s);
    double all[] = {s->time, s->outside, s->set, s->power, 0.0, s->x, rate(s), s->loss};
    for (size_t k = 0; k < n; k++) if (r[k] > LOSS || r[k] == THICK) return fmi2Error; else v[k] = all[r[k]];
    return fmi2OK;
}
API fmi2Status fmi2GetInteger(fmi2Component c, References r, size_t n, fmi2Integer v[]) {
    for (size_t k = 0; k < n; k++) if (r[k] != COUNT) return fmi2Error; else v[k] = ((Room *)c)->s.count;
    return fmi2OK;
}
API fmi2Status fmi2GetBoolean(fmi2Component c, References r, size_t n, fmi2Boolean v[]) {
    State *s = &((Room *)c)->s;
    for (size_t k = 0; k < n; k++) if (r[k] == THICK) v[k] = s->thick; else if (r[k] == HEAT) v[k] = s->heat; else return fmi2Error;
    return fmi2OK;
}
API fmi2Status fmi2SetReal(fmi2Component c, References r, size_t n, const fmi2Real v[]) {
    Room *room = c;
    State *s = &room->s;
    for (size_t k = 0; k < n; k++) {
        double *all[] = {NULL, &s->outside, &s->set, &s->power, NULL, &s->x};
        if (r[k] > T || !all[r[k]] || (room->phase > INITIALISATION && r[k] != OUTSIDE)) return fmi2Error;
        *all[r[k]] = v[k];
    }
    settle(room);
    return fmi2OK;
}
API fmi2Status fmi2SetBoolean(fmi2Component c, References r, size_t n, const fmi2Boolean v[]) {
    Room *room = c;
    for (size_t k = 0; k < n; k++) if (r[k] != THICK || room->phase > INITIALISATION) return fmi2Error; else room->s.thick = v[k];
    settle(room);
    return fmi2OK;
}
API fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Room *)c)->s, sizeof(State));
    return fmi2OK;
}
API fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Room *r = c;
    int heat = r->s.heat;
    r->s = *(State *)state;
    if (IS(lose_heat)) r->s.heat = heat;
    return fmi2OK;
}
API fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { free(*state); *state = NULL; return fmi2OK; }
API fmi2Status fmi2EnterEventMode(fmi2Component c) { return go(c, CONTINUOUS, EVENT); }
API fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { return go(c, EVENT, CONTINUOUS); }
API fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    memset(info, 0, sizeof *info);
    info->newDiscreteStatesNeeded = switches(&((Room *)c)->s);
    return fmi2OK;
}
API fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean done, fmi2Boolean *event, fmi2Boolean *end) {
    if (IS(switch_in_step)) switches(&((Room *)c)->s);
    *event = *end = fmi2False;
    return fmi2OK;
}
API fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) { ((Room *)c)->s.time = t; return fmi2OK; }
API fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { ((Room *)c)->s.x = x[0]; return fmi2OK; }
API fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = ((Room *)c)->s.x; return fmi2OK; }
API fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real d[], size_t n) { d[0] = rate(&((Room *)c)->s); return fmi2OK; }
API fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { x[0] = 300.0; return fmi2OK; }
API fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) {
    State *s = &((Room *)c)->s;
    z[0] = s->x - s->set + (s->heat ? -0.5 : 0.5);
    return fmi2OK;
}
API fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no) {
    Room *r = c;
    State *s = &r->s;
    if (r->phase != STEP || h <= 0.0) return fmi2Error;
    for (int k = 0; k < 16; k++) {
        double x = s->x, small = h / 16.0;
        s->x = x + small / 2.0 * rate(s);
        s->x = x + small * rate(s);
        switches(s);
    }
    s->steps++;
    s->time = IS(time_by_count) ? s->start + s->steps * h : t + h;
    return fmi2OK;
}
API fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
NEVER(GetString, References r, size_t n, fmi2String v[])
NEVER(SetString, References r, size_t n, const fmi2String v[])
NEVER(SetInteger, References r, size_t n, const fmi2Integer v[])
NEVER(SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
NEVER(SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
NEVER(DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
NEVER(GetDirectionalDerivative, References u, size_t n, References k, size_t m, const fmi2Real d[], fmi2Real v[])
NEVER(SetRealInputDerivatives, References r, size_t n, const fmi2Integer o[], const fmi2Real v[])
NEVER(GetRealOutputDerivatives, References r, size_t n, const fmi2Integer o[], fmi2Real v[])
NEVER(GetStatus, const fmi2StatusKind k, fmi2Status *v)
NEVER(GetRealStatus, const fmi2StatusKind k, fmi2Real *v)
NEVER(GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
NEVER(GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *v)
NEVER(GetStringStatus, const fmi2StatusKind k, fmi2String *v)
