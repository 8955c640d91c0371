/* A co-simulation FMU of FMI 3.0 with time events and a clock that it times itself; strict about the modes of the standard.
 *
 * x' = 1. Every 0.3 s there is an event that increases n and takes the discrete input d into e. The clock `later` ticks 0.05 s
 * after each event (countdown), every 0.1, 0.2, 0.3 ... s (changing), or at 0.1 + 0.25 m s (fixed); a tick increases k and
 * takes the input cu, twofold, into the output cy. Macros choose its answers. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { X, N, D, E, LATER, K, CU, CY, TIME };
typedef enum { SET_UP, INITIALISING, EVENT, STEPPING } Mode;

typedef struct {
    double time, x, cu, cy, next;
    int32_t n, d, e, k, asked;
    bool active;
    Mode mode;
} State;

typedef struct {
    State s;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Slave;

static fmi3Status say(Slave *i, fmi3Status status, const char *text)
{
    i->log(i->environment, status, "any", text);
    return status;
}
#define NEED(holds, text) if (!(holds)) return say(c, fmi3Error, text)
#define MODE(mode_) NEED(((Slave *)c)->s.mode == mode_, "wrong mode")

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[],
    size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Slave *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    if (!events || !early) {
        say(i, fmi3Error, "event mode is needed");
        free(i);
        return NULL;
    }
    return i;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance c) { free(c); }
FMI3_Export fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
FMI3_Export fmi3Status fmi3Reset(fmi3Instance c) { memset(&((Slave *)c)->s, 0, sizeof(State)); return fmi3OK; }

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean b, fmi3Float64 stop)
{
    State *s = &((Slave *)c)->s;
    MODE(SET_UP);
    s->time = start;
    s->next = start + 0.3;
    s->mode = INITIALISING;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { MODE(INITIALISING); ((Slave *)c)->s.mode = EVENT; return fmi3OK; }
FMI3_Export fmi3Status fmi3EnterEventMode(fmi3Instance c) { MODE(STEPPING); ((Slave *)c)->s.mode = EVENT; return fmi3OK; }
FMI3_Export fmi3Status fmi3EnterStepMode(fmi3Instance c) { MODE(EVENT); ((Slave *)c)->s.mode = STEPPING; return fmi3OK; }

FMI3_Export fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
    fmi3Boolean *jumped, fmi3Boolean *has_next, fmi3Float64 *next)
{
    State *s = &((Slave *)c)->s;
    MODE(EVENT);
    *again = *end = *nominals = *jumped = false;
    if (s->time >= s->next - 1e-9) {
        s->n++;
        s->e = s->d;
        s->next += 0.3;
#ifdef ENDS_AT_EVENT
        *end = s->n == 2;
#endif
    }
    if (s->active) {
        s->k++;
        s->cy = 2.0 * s->cu;
    }
    s->active = false;
#ifdef NEVER_SETTLES
    *again = true;
#endif
    *has_next = true;
    *next = s->next;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return,
    fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last)
{
    State *s = &((Slave *)c)->s;
    double taken = step;
    MODE(STEPPING);
    NEED(fabs(time - s->time) < 1e-9, "wrong time");
    NEED(time + step < s->next + 1e-9, "a step must end at the next event");
#ifdef DISCARDS_ABOVE
    if (step > DISCARDS_ABOVE) return fmi3Discard;
#endif
#ifdef RETURNS_EARLY /* in the middle of long steps, without an event */
    if (step > 0.01) taken = 0.5 * step;
#endif
    s->time = time + taken;
    s->x += taken;
    *event = *end = false;
    *early = taken < step;
    *last = s->time;
#ifdef ENDS_IN_STEP /* in the step in which this time comes, at which it stops */
    if (time + step >= ENDS_IN_STEP - 1e-9) {
        s->x += ENDS_IN_STEP - s->time;
        s->time = *last = ENDS_IN_STEP;
        *early = ENDS_IN_STEP < time + step - 1e-9;
        *end = true;
    }
#endif
#ifdef STRAYS_BY
    *last = time + (1.0 + STRAYS_BY) * step;
#endif
#ifdef WRONG_LAST
    *early = true;
    *last = time + 2.0 * step;
#endif
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock v[])
{
    MODE(EVENT);
    NEED(n == 1 && r[0] == LATER && v[0], "no such clock");
    ((Slave *)c)->s.active = true;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[],
                                              fmi3IntervalQualifier q[])
{
    State *s = &((Slave *)c)->s;
    NEED(s->mode == INITIALISING || s->mode == EVENT, "wrong mode");
    q[0] = fmi3IntervalChanged;
#ifdef INTERVAL
    v[0] = INTERVAL;
#elif KIND == 'd' /* countdown */
    v[0] = 0.05;
    if (s->n == s->asked) q[0] = s->n ? fmi3IntervalUnchanged : fmi3IntervalNotYetKnown;
    s->asked = s->n;
#elif KIND == 'c' /* changing */
    v[0] = 0.1 * (s->k + 1);
#else
    v[0] = 0.25;
#endif
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[])
{
    MODE(INITIALISING);
    v[0] = 0.1;
    return fmi3OK;
}

static double *real_at(State *s, fmi3ValueReference r)
{
    return r == X ? &s->x : r == CU ? &s->cu : r == CY ? &s->cy : r == TIME ? &s->time : NULL;
}

static int32_t *whole_at(State *s, fmi3ValueReference r)
{
    return r == N ? &s->n : r == D ? &s->d : r == E ? &s->e : r == K ? &s->k : NULL;
}

#define MAY_REACH(r) (((r) != CU && (r) != CY) || s->active || s->mode <= INITIALISING)

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t total)
{
    State *s = &((Slave *)c)->s;
    for (size_t k = 0; k < n; k++) {
        NEED(MAY_REACH(r[k]), "the clock of a variable must be active");
        v[k] = r[k] == CY && s->active ? 2.0 * s->cu : *real_at(s, r[k]);
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t total)
{
    State *s = &((Slave *)c)->s;
    for (size_t k = 0; k < n; k++) {
        NEED(MAY_REACH(r[k]), "the clock of a variable must be active");
        *real_at(s, r[k]) = v[k];
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Int32 v[], size_t total)
{
    for (size_t k = 0; k < n; k++) v[k] = *whole_at(&((Slave *)c)->s, r[k]);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 v[], size_t total)
{
    NEED(((Slave *)c)->s.mode != STEPPING, "a discrete input must not be set in step mode");
    for (size_t k = 0; k < n; k++) *whole_at(&((Slave *)c)->s, r[k]) = v[k];
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *x)
{
    *x = malloc(sizeof(State));
    memcpy(*x, &((Slave *)c)->s, sizeof(State));
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState x)
{
    memcpy(&((Slave *)c)->s, x, sizeof(State));
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *x)
{
    free(*x);
    *x = NULL;
    return fmi3OK;
}
