/* A model-exchange FMU of FMI 2.0 and 3.0 with events of all three kinds; strict about the modes of the standard.
 *
 * A ball: h' = v, v' = u - g; at h = 0 it bounces with v -> -0.7 v (state event). n counts time events, one every 0.3 s, and
 * takes the discrete input d into e at each. The first completed step beyond 0.5 s asks for a step event, which sets s to 1.
 * y = h + 2 u follows its input at once. Macros: FMI is 2 or 3; the others choose its answers. */

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#include "fmi2Functions.h"
#define F(name) fmi2##name
#define EXPORT FMI2_Export
typedef fmi2Component Instance;
typedef fmi2Status Status;
typedef fmi2Boolean Bool;
typedef fmi2ValueReference Reference;
enum { OK = fmi2OK, DISCARD = fmi2Discard, ERROR = fmi2Error };
#define SIZES
#else
#include "fmi3Functions.h"
#define F(name) fmi3##name
#define EXPORT FMI3_Export
typedef fmi3Instance Instance;
typedef fmi3Status Status;
typedef fmi3Boolean Bool;
typedef fmi3ValueReference Reference;
enum { OK = fmi3OK, DISCARD = fmi3Discard, ERROR = fmi3Error };
#define SIZES , size_t total
#endif

#ifndef NOMINAL
#define NOMINAL 1.0
#endif
#ifndef NEXT
#define NEXT s->next
#endif
enum { TIME, H, V, U, Y, DERH, DERV, N = 10, D, E, S };
typedef enum { SET_UP, INITIALISING, EVENT, CONTINUOUS } Mode;

typedef struct {
    double time, x[2], u, next;
    int n, d, e, s;
    bool step_event;
    Mode mode;
} State;

typedef struct {
    State s;
    void *environment;
#if FMI == 2
    fmi2CallbackLogger log;
#else
    fmi3LogMessageCallback log;
#endif
} Slave;

static const State first = {.x = {1.0, 0.0}};

static Status say(Slave *i, Status status, const char *text)
{
#if FMI == 2
    i->log(i->environment, "a", status, "any", text);
#else
    i->log(i->environment, status, "any", text);
#endif
    return status;
}
#define NEED(holds, text) if (!(holds)) return say(c, ERROR, text)
#define MODE(...) NEED(in(c, (Mode[]){__VA_ARGS__}, sizeof((Mode[]){__VA_ARGS__}) / sizeof(Mode)), "wrong mode")

static bool in(Slave *i, const Mode *modes, size_t n)
{
    for (size_t k = 0; k < n; k++)
        if (i->s.mode == modes[k]) return true;
    return false;
}

static Slave *made(void)
{
    Slave *i = calloc(1, sizeof *i);
    i->s = first;
    return i;
}

#if FMI == 2
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT Instance fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *f, fmi2Boolean visible, fmi2Boolean logging)
{
    if (type != fmi2ModelExchange) return NULL;
    Slave *i = made();
    i->log = f->logger;
    i->environment = f->componentEnvironment;
    return i;
}
EXPORT Status fmi2SetupExperiment(Instance c, Bool a, double tolerance, double start, Bool b, double stop)
{
    MODE(SET_UP);
    ((Slave *)c)->s.time = start;
    return OK;
}
EXPORT Status fmi2EnterInitializationMode(Instance c)
{
#else
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, Bool visible,
    Bool logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Slave *i = made();
    i->log = log;
    i->environment = environment;
    return i;
}
EXPORT Status fmi3EnterInitializationMode(Instance c, Bool a, double tolerance, double start, Bool b, double stop)
{
    ((Slave *)c)->s.time = start;
#endif
    MODE(SET_UP);
    ((Slave *)c)->s.next = ((Slave *)c)->s.time + 0.3;
    ((Slave *)c)->s.mode = INITIALISING;
    return OK;
}

EXPORT Status F(ExitInitializationMode)(Instance c) { MODE(INITIALISING); ((Slave *)c)->s.mode = EVENT; return OK; }
EXPORT Status F(EnterEventMode)(Instance c) { MODE(CONTINUOUS); ((Slave *)c)->s.mode = EVENT; return OK; }
EXPORT Status F(EnterContinuousTimeMode)(Instance c) { MODE(EVENT); ((Slave *)c)->s.mode = CONTINUOUS; return OK; }
EXPORT Status F(Terminate)(Instance c) { MODE(EVENT, CONTINUOUS); return OK; }
EXPORT Status F(Reset)(Instance c) { ((Slave *)c)->s = first; return OK; }
EXPORT void F(FreeInstance)(Instance c) { free(c); }

EXPORT Status F(SetTime)(Instance c, double time)
{
    MODE(EVENT, CONTINUOUS);
    NEED(time < ((Slave *)c)->s.next + 1e-9, "time must not pass a time event");
    ((Slave *)c)->s.time = time;
    return OK;
}

EXPORT Status F(SetContinuousStates)(Instance c, const double x[], size_t n)
{
    MODE(CONTINUOUS);
    NEED(n == 2, "two states");
    memcpy(((Slave *)c)->s.x, x, sizeof first.x);
    return OK;
}

EXPORT Status F(GetContinuousStates)(Instance c, double x[], size_t n)
{
    memcpy(x, ((Slave *)c)->s.x, sizeof first.x);
    return OK;
}

EXPORT Status F(GetNominalsOfContinuousStates)(Instance c, double x[], size_t n) { x[0] = x[1] = NOMINAL; return OK; }

#if FMI == 2
EXPORT Status fmi2GetDerivatives(Instance c, double x[], size_t n)
#else
EXPORT Status fmi3GetContinuousStateDerivatives(Instance c, double x[], size_t n)
#endif
{
    State *s = &((Slave *)c)->s;
    MODE(EVENT, CONTINUOUS, INITIALISING);
#ifdef FAILS_AT
    if (s->time >= FAILS_AT) return say(c, ERROR, "no derivatives here");
#endif
#ifdef DISCARDS_BELOW /* this height: the integrator must not come here, but go around */
    if (s->x[0] < DISCARDS_BELOW) return DISCARD;
#endif
    x[0] = s->x[1];
    x[1] = s->u - 9.81;
#ifdef NOT_FINITE_FROM
    if (s->time > NOT_FINITE_FROM) x[1] = NAN;
#endif
    return OK;
}

EXPORT Status F(GetEventIndicators)(Instance c, double z[], size_t n)
{
    NEED(n == 1, "one indicator");
    z[0] = ((Slave *)c)->s.x[0];
    return OK;
}

#if FMI == 3
#ifndef STATES
#define STATES 2
#define INDICATORS 1
#endif
EXPORT Status fmi3GetNumberOfContinuousStates(Instance c, size_t *n) { *n = STATES; return OK; }
EXPORT Status fmi3GetNumberOfEventIndicators(Instance c, size_t *n) { *n = INDICATORS; return OK; }
#endif

EXPORT Status F(CompletedIntegratorStep)(Instance c, Bool keeps, Bool *enters, Bool *ends)
{
    State *s = &((Slave *)c)->s;
    MODE(CONTINUOUS);
    *enters = s->step_event = !s->s && s->time > 0.5;
    *ends = false;
#ifdef ENDS_FROM
    *ends = s->time >= ENDS_FROM;
#endif
    return OK;
}

#if FMI == 2
EXPORT Status fmi2NewDiscreteStates(Instance c, fmi2EventInfo *info)
{
    State *s = &((Slave *)c)->s;
    info->newDiscreteStatesNeeded = info->terminateSimulation = info->nominalsOfContinuousStatesChanged = false;
    info->valuesOfContinuousStatesChanged = info->nextEventTimeDefined = true;
#else
EXPORT Status fmi3UpdateDiscreteStates(Instance c, Bool *again, Bool *end, Bool *nominals, Bool *jumped, Bool *has_next, double *next)
{
    State *s = &((Slave *)c)->s;
    *again = *end = *nominals = false;
    *jumped = *has_next = true;
#endif
    MODE(EVENT);
    if (s->x[0] <= 0.0 && s->x[1] < 0.0) {
        s->x[0] = 0.0;
        s->x[1] *= -0.7;
    }
    if (s->time >= s->next - 1e-9) {
        s->n++;
        s->e = s->d;
        s->next += 0.3;
    }
    if (s->step_event) s->s = 1;
    s->step_event = false;
#if FMI == 2
    info->nextEventTime = NEXT;
#ifdef ENDS_AT_EVENT
    info->terminateSimulation = s->n == ENDS_AT_EVENT;
#endif
#else
    *next = NEXT;
#ifdef ENDS_AT_EVENT
    *end = s->n == ENDS_AT_EVENT;
#endif
#endif
    return OK;
}

static double real_at(const State *s, Reference r)
{
    return r == TIME ? s->time : r == H ? s->x[0] : r == V || r == DERH ? s->x[1] : r == U ? s->u
        : r == Y ? s->x[0] + 2.0 * s->u : s->u - 9.81;
}

static int *whole_at(State *s, Reference r) { return r == N ? &s->n : r == D ? &s->d : r == E ? &s->e : &s->s; }

#if FMI == 2
#define GET_REAL fmi2GetReal
#define SET_REAL fmi2SetReal
#define GET_WHOLE fmi2GetInteger
#define SET_WHOLE fmi2SetInteger
#else
#define GET_REAL fmi3GetFloat64
#define SET_REAL fmi3SetFloat64
#define GET_WHOLE fmi3GetInt32
#define SET_WHOLE fmi3SetInt32
#endif

EXPORT Status GET_REAL(Instance c, const Reference r[], size_t n, double v[] SIZES)
{
    for (size_t k = 0; k < n; k++) v[k] = real_at(&((Slave *)c)->s, r[k]);
    return OK;
}

EXPORT Status SET_REAL(Instance c, const Reference r[], size_t n, const double v[] SIZES)
{
    for (size_t k = 0; k < n; k++) {
        NEED(r[k] == U || (r[k] == H && ((Slave *)c)->s.mode <= INITIALISING), "u may be set, and h before the run");
        if (r[k] == U)
            ((Slave *)c)->s.u = v[k];
        else
            ((Slave *)c)->s.x[0] = v[k];
    }
    return OK;
}

EXPORT Status GET_WHOLE(Instance c, const Reference r[], size_t n, int v[] SIZES)
{
    for (size_t k = 0; k < n; k++) v[k] = *whole_at(&((Slave *)c)->s, r[k]);
    return OK;
}

EXPORT Status SET_WHOLE(Instance c, const Reference r[], size_t n, const int v[] SIZES)
{
    NEED(((Slave *)c)->s.mode != CONTINUOUS, "a discrete input must be set in event mode");
    for (size_t k = 0; k < n; k++) *whole_at(&((Slave *)c)->s, r[k]) = v[k];
    return OK;
}

#if FMI == 2
typedef fmi2FMUstate Saved;
#define GET_STATE fmi2GetFMUstate
#define SET_STATE fmi2SetFMUstate
#define FREE_STATE fmi2FreeFMUstate
#else
typedef fmi3FMUState Saved;
#define GET_STATE fmi3GetFMUState
#define SET_STATE fmi3SetFMUState
#define FREE_STATE fmi3FreeFMUState
#endif

EXPORT Status GET_STATE(Instance c, Saved *x)
{
    *x = malloc(sizeof(State));
    memcpy(*x, &((Slave *)c)->s, sizeof(State));
    return OK;
}

#if FMI == 2 /* FMPy asks for all of them */
#define ABSENT(name, ...) EXPORT Status fmi2##name(Instance c, __VA_ARGS__) { return say(c, ERROR, #name " is not there"); }
ABSENT(SetDebugLogging, Bool on, size_t n, const fmi2String names[])
ABSENT(GetBoolean, const Reference r[], size_t n, Bool v[])
ABSENT(SetBoolean, const Reference r[], size_t n, const Bool v[])
ABSENT(GetString, const Reference r[], size_t n, fmi2String v[])
ABSENT(SetString, const Reference r[], size_t n, const fmi2String v[])
ABSENT(SerializedFMUstateSize, Saved x, size_t *n)
ABSENT(SerializeFMUstate, Saved x, fmi2Byte b[], size_t n)
ABSENT(DeSerializeFMUstate, const fmi2Byte b[], size_t n, Saved *x)
ABSENT(GetDirectionalDerivative, const Reference r[], size_t n, const Reference s[], size_t m, const double a[], double b[])
#endif

EXPORT Status SET_STATE(Instance c, Saved x) { memcpy(&((Slave *)c)->s, x, sizeof(State)); return OK; }
EXPORT Status FREE_STATE(Instance c, Saved *x) { free(*x); *x = NULL; return OK; }
