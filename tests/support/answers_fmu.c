/* A co-simulation FMU whose state follows dx/dt = gain * u, and whose answers a macro chooses:
 *
 *   WARNS_FROM=t    fmi2DoStep returns fmi2Warning from then on, with a message; FREEZES: and does nothing
 *   LOGS_ERROR      fmi2DoStep logs an error and returns fmi2OK
 *   ENDS_AT=t       fmi2DoStep returns fmi2Discard from then on, and fmi2Terminated is true
 *   LONGEST=h       longer steps are discarded; COMES_TO: after that much, which fmi2LastSuccessfulTime says
 *   OWN_STEP=h      steps of its own, until the communication point is reached or passed
 *   REFUSES         fmi2DoStep prints why and returns fmi2Error
 *   PENDS           fmi2DoStep returns fmi2Pending; HANGS: it does not return; DIES: it ends the process
 *   ONCE            a second instance in a process is refused
 *   RESETS=code     what fmi2Reset does after it began anew, with x and gain of before; LEFT: a variable of the library that outlives instances
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2FunctionTypes.h"

typedef struct { double x, u, gain, time, last; int steps, mode, on; char name[64]; } State;
typedef struct { State s; const fmi2CallbackFunctions *host; } Slave;

static int instances = 0;
static double left = 0.0;

static void say(Slave *m, fmi2Status status, const char *text)
{
    m->host->logger(m->host->componentEnvironment, m->s.name, status, "logAll", text);
}

static void begin(Slave *m)
{
    memset(&m->s, 0, sizeof m->s);
    m->s.gain = 2.0;
    strcpy(m->s.name, "answers");
#ifdef LEFT
    m->s.x = left;
#endif
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String uri,
                              const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    Slave *m;
    (void)name; (void)type; (void)guid; (void)uri; (void)visible; (void)logging;
#ifdef ONCE
    if (instances) return NULL;
#endif
    instances++;
    m = calloc(1, sizeof *m);
    m->host = host;
    begin(m);
    return m;
}
void fmi2FreeInstance(fmi2Component c) { instances--; free(c); }
fmi2Status fmi2Reset(fmi2Component c)
{
#ifdef RESETS
    Slave *m = c;
    double x = m->s.x, gain = m->s.gain;
    begin(m);
    RESETS
    (void)x; (void)gain;
    return fmi2OK;
#else
    begin(c);
    return fmi2OK;
#endif
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real start, fmi2Boolean e, fmi2Real f)
{
    (void)a; (void)b; (void)e; (void)f;
    ((Slave *)c)->s.time = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { (void)c; (void)on; (void)n; (void)k; return fmi2OK; }

/* Real: 0 u, 1 x, 2 gain. Integer: 0 mode, 1 steps. Boolean: 0 on. String: 0 label, which counts its letters into mode. */
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    for (size_t k = 0; k < n; k++) { if (r[k] == 0) ((Slave *)c)->s.u = v[k]; if (r[k] == 2) ((Slave *)c)->s.gain = v[k]; }
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    const State *s = &((Slave *)c)->s;
    for (size_t k = 0; k < n; k++) v[k] = r[k] == 0 ? s->u : r[k] == 1 ? s->x : s->gain;
    return fmi2OK;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]) { (void)r; (void)n; ((Slave *)c)->s.mode = v[0]; return fmi2OK; }
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
{
    for (size_t k = 0; k < n; k++) v[k] = r[k] ? ((Slave *)c)->s.steps : ((Slave *)c)->s.mode;
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]) { (void)r; (void)n; ((Slave *)c)->s.on = v[0]; return fmi2OK; }
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]) { (void)r; (void)n; v[0] = ((Slave *)c)->s.on; return fmi2OK; }
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]) { (void)r; (void)n; ((Slave *)c)->s.mode = (int)strlen(v[0]); return fmi2OK; }
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]) { (void)r; (void)n; (void)c; v[0] = ""; return fmi2OK; }

/* A Boolean doubles the rate, an Integer adds to it: what they are shows in x. */
static void integrate(State *s, double h)
{
    s->x += h * (s->gain * s->u * (s->on ? 2.0 : 1.0) + s->mode);
    s->steps++;
    left = s->x;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean k)
{
    Slave *m = c;
    State *s = &m->s;
    (void)k;
    s->last = t;
#ifdef PENDS
    return fmi2Pending;
#endif
#ifdef HANGS
    for (;;) s->last = t;
#endif
#ifdef DIES
    abort();
#endif
#ifdef REFUSES
    printf("steps must be whole numbers of 0.1 s\n");
    return fmi2Error;
#endif
#ifdef ENDS_AT
    if (t > ENDS_AT - 1e-9) return fmi2Discard;
#endif
#ifdef LONGEST
    if (h > LONGEST * 1.000001) {
        s->x += 1000.0; /* who goes on from here without a word of where it is gets nonsense */
#ifdef COMES_TO
        s->x -= 1000.0;
        integrate(s, LONGEST);
        s->last = t + LONGEST;
#endif
        return fmi2Discard;
    }
#endif
#ifdef WARNS_FROM
    if (t > WARNS_FROM - 1e-9) {
        say(m, fmi2Warning, "near the limit");
#ifdef FREEZES
        return fmi2Warning;
#endif
        integrate(s, h);
        return fmi2Warning;
    }
#endif
#ifdef LOGS_ERROR
    say(m, fmi2Error, "no licence");
#endif
#ifdef OWN_STEP
    while (s->time < t + h - 1e-9) { integrate(s, OWN_STEP); s->time += OWN_STEP; }
    return fmi2OK;
#endif
    integrate(s, h);
    return fmi2OK;
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
#ifdef COMES_TO
    if (kind == fmi2LastSuccessfulTime) { *value = ((Slave *)c)->s.last; return fmi2OK; }
#endif
    (void)c; (void)kind; (void)value;
    return fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c;
#ifdef ENDS_AT
    *value = kind == fmi2Terminated;
    return fmi2OK;
#endif
    (void)kind; (void)value;
    return fmi2Discard;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Slave *)c)->s, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { memcpy(&((Slave *)c)->s, state, sizeof(State)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { (void)c; free(*state); *state = NULL; return fmi2OK; }

/* Loaders ask for every function of the standard. */
#define UNUSED(NAME) int NAME(void) { return fmi2Error; }
UNUSED(fmi2CancelStep) UNUSED(fmi2GetStatus) UNUSED(fmi2GetIntegerStatus) UNUSED(fmi2GetStringStatus)
UNUSED(fmi2SerializedFMUstateSize) UNUSED(fmi2SerializeFMUstate) UNUSED(fmi2DeSerializeFMUstate)
UNUSED(fmi2GetDirectionalDerivative) UNUSED(fmi2SetRealInputDerivatives) UNUSED(fmi2GetRealOutputDerivatives)
