/* A co-simulation FMU of FMI 3.0 with variables of every numeric type and arrays; macros choose its answers.
 *
 * y[1]' = u[1] + p[1], y[2]' = p[3] u[2]; the others count or copy: see fmi3DoStep. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { U, N, W, F, B, E, S, H, Y = 10, M, K, G, C, R, D, O, P = 20, LABEL, TIME = 30 };

typedef struct {
    double u[2], y[2], p[3], time;
    int8_t n, m;
    uint64_t w, k;
    float f, g;
    bool b, c;
    int64_t e, r;
    int16_t s, d;
    uint16_t h, o;
} State;

typedef struct {
    State s;
    char label[64];
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Slave;

static fmi3Status say(Slave *i, fmi3Status status, const char *text)
{
    i->log(i->environment, status, "any", text);
    return status;
}

static const State first = {.p = {1.0, 2.0, 3.0}, .e = 1, .r = 1};

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[],
    size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Slave *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    i->s = first;
    if (strcmp(token, "{typed}") || events || early || n || update) {
        say(i, fmi3Error, "wrong token, or what I do not have");
        free(i);
        return NULL;
    }
    return i;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance i) { free(i); }

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean a, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean b, fmi3Float64 stop)
{
    ((Slave *)i)->s.time = start;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return fmi3OK; }
FMI3_Export fmi3Status fmi3Terminate(fmi3Instance i) { return fmi3OK; }
FMI3_Export fmi3Status fmi3Reset(fmi3Instance i) { ((Slave *)i)->s = first; return fmi3OK; }

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return,
    fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last)
{
    Slave *i = c;
    State *s = &i->s;
    fmi3Status status = fmi3OK;
    *event = *end = *early = false;
    *last = time + step;
#ifdef DISCARDS_ABOVE
    if (step > DISCARDS_ABOVE) return fmi3Discard;
#endif
#ifdef FAILS_AT
    if (time >= FAILS_AT) return say(i, FAILS_WITH, "the solver failed");
#endif
#ifdef ENDS_AT
    *end = time >= ENDS_AT;
#endif
#ifdef RETURNS_EARLY
    *early = true;
    *last = time + 0.5 * step;
#endif
#ifdef STRAYS_BY /* it says to be elsewhere, by this share of the step */
    *last = time + (1.0 + STRAYS_BY) * step;
#endif
#ifdef WARNS_FROM
    if (time >= WARNS_FROM - 1e-9) status = say(i, fmi3Warning, "near the limit");
#endif
    if (fabs(time - s->time) > 1e-9) return say(i, fmi3Error, "wrong time");
    s->y[0] += step * (s->u[0] + s->p[0]);
    s->y[1] += step * s->p[2] * s->u[1];
    s->m = (int8_t)(s->m + s->n + 1);
    s->k += s->w;
    s->g = 0.5f * s->g + 0.3f * s->f + 1.0f;
    s->c = s->b ? s->k % 2 : !s->c;
    s->r = s->e % 3 + 1;
    s->d = (int16_t)(s->d - s->s - 1);
    s->o = (uint16_t)(s->o + s->h + 1);
    s->time = time + step;
    return status;
}

/* Elements of a variable of this type, or NULL. */
#define PLACES(name, type, ...) \
    static type *at_##name(State *s, fmi3ValueReference r, size_t *n) \
    { \
        *n = 1; \
        switch (r) { __VA_ARGS__ default: return NULL; } \
    } \
    FMI3_Export fmi3Status fmi3Get##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, type v[], size_t total) \
    { \
        size_t size; \
        for (size_t k = 0; k < n; k++, v += size, total -= size) { \
            const type *from = at_##name(&((Slave *)i)->s, r[k], &size); \
            if (!from || size > total) return say(i, fmi3Error, "no such variable, or no room for it"); \
            memcpy(v, from, size * sizeof *v); \
        } \
        return total ? say(i, fmi3Error, "too much room") : fmi3OK; \
    } \
    FMI3_Export fmi3Status fmi3Set##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, const type v[], size_t total) \
    { \
        size_t size; \
        for (size_t k = 0; k < n; k++, v += size, total -= size) { \
            type *to = at_##name(&((Slave *)i)->s, r[k], &size); \
            if (!to || size > total) return say(i, fmi3Error, "no such variable, or too few values"); \
            memcpy(to, v, size * sizeof *v); \
        } \
        return total ? say(i, fmi3Error, "too many values") : fmi3OK; \
    }
PLACES(Float64, fmi3Float64, case U: *n = 2; return s->u; case Y: *n = 2; return s->y; case P: *n = 3; return s->p;
       case TIME: return &s->time;)
PLACES(Float32, fmi3Float32, case F: return &s->f; case G: return &s->g;)
PLACES(Int8, fmi3Int8, case N: return &s->n; case M: return &s->m;)
PLACES(Int16, fmi3Int16, case S: return &s->s; case D: return &s->d;)
PLACES(UInt16, fmi3UInt16, case H: return &s->h; case O: return &s->o;)
PLACES(UInt64, fmi3UInt64, case W: return &s->w; case K: return &s->k;)
PLACES(Int64, fmi3Int64, case E: return &s->e; case R: return &s->r;)
PLACES(Boolean, fmi3Boolean, case B: return &s->b; case C: return &s->c;)

FMI3_Export fmi3Status fmi3GetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t total)
{
    v[0] = ((Slave *)i)->label;
    return fmi3OK;
}

#ifndef LACKS_SETSTRING
FMI3_Export fmi3Status fmi3SetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3String v[],
                                     size_t total)
{
    strncpy(((Slave *)i)->label, v[0], 63);
    return fmi3OK;
}
#endif

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *x)
{
    State *kept = malloc(sizeof(State));
    *kept = ((Slave *)i)->s;
    *x = kept;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState x)
{
    ((Slave *)i)->s = *(State *)x;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *x)
{
    free(*x);
    *x = NULL;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3EnterEventMode(fmi3Instance i) { return say(i, fmi3Error, "no event mode"); }
FMI3_Export fmi3Status fmi3EnterStepMode(fmi3Instance i) { return say(i, fmi3Error, "no event mode"); }
FMI3_Export fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c,
    fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *f)
{
    return say(i, fmi3Error, "no event mode");
}
