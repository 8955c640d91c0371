/* Three FMUs of FMI 3.0, for co-simulation and model exchange: a plant, a controller on two clocks, a supervisor.
 *
 * PLANT: x' = u - x; the input u changes at events.
 * CONTROLLER: on each tick of the periodic clock r the output u becomes u + a; the input a belongs to the clock s, which the
 *   supervisor triggers. Where both tick in one instant, u takes the new a.
 * SUPERVISOR: where its input x comes to 2, from below or above, or at the time AT, its output clock s ticks, and its output a,
 *   which belongs to s, changes its sign.
 *
 * All are strict: variables of clocks are set and read while the clock is active, and in event mode alone. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

typedef enum { SET_UP, INITIALISING, EVENT, STEPPING } Mode;
enum { PLANT_X = 1, PLANT_U };
enum { R = 1, A, U, S };
enum { X = 1, OUT_S, OUT_A };

typedef struct {
    double time, x, u, a, side;
    bool r, s, due;
    Mode mode;
} State;

typedef struct {
    State now;
    bool exchange;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
} Slave;

static fmi3Status say(Slave *i, fmi3Status status, const char *text)
{
    i->log(i->environment, status, "any", text);
    return status;
}
#define NEED(holds, text) if (!(holds)) return say(c, fmi3Error, text)
#define MODE(mode_) NEED(((Slave *)c)->now.mode == mode_, "wrong mode")
#define EXPORT FMI3_Export
#define NOW State *n = &((Slave *)c)->now

static void begin(Slave *i)
{
    memset(&i->now, 0, sizeof i->now);
    i->now.a = 1.0;
}

static Slave *make(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Slave *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    begin(i);
    return i;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Slave *i = make(environment, log);
    i->update = update;
    return events && early ? i : NULL;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Slave *i = make(environment, log);
    i->exchange = true;
    return i;
}

EXPORT void fmi3FreeInstance(fmi3Instance c) { free(c); }
EXPORT fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
EXPORT fmi3Status fmi3Reset(fmi3Instance c) { begin(c); return fmi3OK; }

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 tolerance, fmi3Float64 start,
    fmi3Boolean b, fmi3Float64 stop)
{
    NOW;
    MODE(SET_UP);
    n->time = start;
    n->mode = INITIALISING;
    return fmi3OK;
}

static double distance(const State *n)
{
#ifdef AT
    return AT - n->time;
#else
    return 2.0 - n->x;
#endif
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    NOW;
    MODE(INITIALISING);
    n->side = distance(n) > 0.0 ? 1.0 : -1.0;
    n->mode = EVENT;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c)
{
    NOW;
    MODE(STEPPING);
#ifdef SUPERVISOR
#ifdef AT
    n->s = n->side > 0.0 && n->time >= AT - 1e-9;
#else
    n->s = n->due || n->side * distance(n) <= 0.0;
#endif
#endif
    n->mode = EVENT;
    return fmi3OK;
}

static fmi3Status leave(fmi3Instance c)
{
    MODE(EVENT);
    ((Slave *)c)->now.mode = STEPPING;
    return fmi3OK;
}
EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) { return leave(c); }
EXPORT fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return leave(c); }

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals,
    fmi3Boolean *jumped, fmi3Boolean *has_next, fmi3Float64 *next)
{
    NOW;
    MODE(EVENT);
    *again = *end = *nominals = *jumped = *has_next = false;
#ifdef CONTROLLER
    if (n->r) n->u += n->a;
#endif
#ifdef SUPERVISOR
    if (n->s) {
        n->a = -n->a;
        n->side = -n->side;
    }
    n->due = false;
#ifdef AT
    *has_next = n->side > 0.0;
    *next = AT;
#endif
#endif
    n->r = n->s = false;
    return fmi3OK;
}

#ifdef SUPERVISOR
static void ask(Slave *i, double time)
{
    bool early = false;
    double until = 0.0;
    i->now.time = time;
    if (i->update) i->update(i->environment, time, true, false, false, false, &early, &until);
}
#endif

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return, fmi3Boolean *event,
    fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last)
{
    NOW;
    MODE(STEPPING);
    *event = *end = *early = false;
    *last = time + step;
#ifdef PLANT
    n->x = n->u + (n->x - n->u) * exp(-step);
#endif
#if defined SUPERVISOR && !defined AT
    double before = time, after = time + step;
    ask(c, after);
    *event = n->side * distance(n) <= 0.0;
    if (*event) {
        while (after - before > 1e-15 * (1.0 + after)) {
            const double middle = 0.5 * (before + after);
            ask(c, middle);
            if (n->side * distance(n) <= 0.0) after = middle; else before = middle;
        }
        ask(c, after);
        n->due = true;
        *early = after < time + step;
        *last = after;
    }
#endif
    n->time = *last;
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { ((Slave *)c)->now.time = time; return fmi3OK; }
EXPORT fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean a, fmi3Boolean *event, fmi3Boolean *end)
{
    *event = *end = false;
    return fmi3OK;
}

#ifdef PLANT
#define STATES 1
#else
#define STATES 0
#endif
#if defined SUPERVISOR && !defined AT
#define INDICATORS 1
#else
#define INDICATORS 0
#endif
EXPORT fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count) { *count = STATES; return fmi3OK; }
EXPORT fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count) { *count = INDICATORS; return fmi3OK; }
EXPORT fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 v[], size_t count)
{
    if (count) v[0] = distance(&((Slave *)c)->now);
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 v[], size_t count)
{
    if (count) v[0] = ((Slave *)c)->now.x;
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 v[], size_t count)
{
    if (count) ((Slave *)c)->now.x = v[0];
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 v[], size_t count)
{
    if (count) v[0] = 1.0;
    return fmi3OK;
}
EXPORT fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 v[], size_t count)
{
    if (count) v[0] = ((Slave *)c)->now.u - ((Slave *)c)->now.x;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t count, fmi3Float64 v[], size_t values)
{
    NOW;
    for (size_t k = 0; k < count; k++) {
#ifdef PLANT
        v[k] = r[k] == PLANT_X ? n->x : r[k] == PLANT_U ? n->u : n->u - n->x;
#elif defined CONTROLLER
        NEED(n->mode == INITIALISING || (r[k] == U ? n->r : n->s), "a variable of a clock is read between its ticks");
        v[k] = r[k] == A ? n->a : n->r ? n->u + n->a : n->u;
#else
        NEED(r[k] == X || n->mode == INITIALISING || n->s, "a variable of a clock is read between its ticks");
        v[k] = r[k] == X ? n->x : n->s ? -n->a : n->a;
#endif
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t count, const fmi3Float64 v[], size_t values)
{
    NOW;
    for (size_t k = 0; k < count; k++) {
#ifdef PLANT
        NEED(n->mode == EVENT || n->mode <= INITIALISING, "u changes in event mode alone");
        n->u = v[k];
#elif defined CONTROLLER
        NEED(r[k] == A && (n->mode <= INITIALISING || n->s), "a variable of a clock is set between its ticks");
        n->a = v[k];
#else
        n->x = v[k];
#endif
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference r[], size_t count, const fmi3Clock v[])
{
    NOW;
    MODE(EVENT);
    for (size_t k = 0; k < count; k++) {
        bool *clock = r[k] == R ? &n->r : &n->s;
        NEED(v[k] && !*clock, "a clock ticks once in an instant");
        *clock = true;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference r[], size_t count, fmi3Clock v[])
{
    MODE(EVENT);
    NEED(count == 1 && r[0] == OUT_S, "no such clock");
    v[0] = ((Slave *)c)->now.s;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Slave *)c)->now, sizeof(State));
    return fmi3OK;
}
EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { memcpy(&((Slave *)c)->now, state, sizeof(State)); return fmi3OK; }
EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { free(*state); *state = NULL; return fmi3OK; }
