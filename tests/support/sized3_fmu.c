/* A co-simulation FMU of FMI 3.0 whose arrays have the size that a structural parameter says: y[k]' = p[k] u[k].
 *
 * The size can be set in configuration mode alone. */

#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { SIZE = 1, U, P, Y, MOST = 8 };
enum { INSTANTIATED, CONFIGURING, RUNNING };

typedef struct {
    uint64_t size;
    int mode;
    double values[3][MOST];
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} Slave;

static fmi3Status refuse(Slave *i, const char *text)
{
    i->log(i->environment, fmi3Error, "any", text);
    return fmi3Error;
}

static void begin(Slave *i)
{
    memset(i->values, 0, sizeof i->values);
    i->size = 2;
    i->mode = INSTANTIATED;
    i->values[P - U][0] = 1.0;
    i->values[P - U][1] = 2.0;
}

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[],
    size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Slave *i = calloc(1, sizeof *i);
    i->environment = environment;
    i->log = log;
    begin(i);
    return i;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance i) { free(i); }

static fmi3Status go(Slave *i, int from, int to)
{
    if (i->mode != from) return refuse(i, "wrong mode");
    i->mode = to;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { return go(i, INSTANTIATED, CONFIGURING); }
FMI3_Export fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return go(i, CONFIGURING, INSTANTIATED); }
FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean a, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean b, fmi3Float64 stop) { return go(i, INSTANTIATED, RUNNING); }
FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return fmi3OK; }
FMI3_Export fmi3Status fmi3Terminate(fmi3Instance i) { return fmi3OK; }
FMI3_Export fmi3Status fmi3Reset(fmi3Instance i) { begin(i); return fmi3OK; }

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_return,
    fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last)
{
    Slave *i = c;
    *event = *end = *early = false;
    *last = time + step;
    for (uint64_t k = 0; k < i->size; k++)
        i->values[Y - U][k] += step * i->values[P - U][k] * i->values[0][k];
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const uint64_t v[], size_t total)
{
    Slave *i = c;
    if (i->mode != CONFIGURING) return refuse(i, "the size must be set in configuration mode");
    if (n != 1 || r[0] != SIZE || v[0] < 1 || v[0] > MOST) return refuse(i, "no such size");
    i->size = v[0];
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference r[], size_t n, uint64_t v[], size_t total)
{
    v[0] = ((Slave *)c)->size;
    return n == 1 && r[0] == SIZE ? fmi3OK : refuse(c, "no such variable");
}

FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const double v[], size_t total)
{
    Slave *i = c;
    if (total != n * i->size) return refuse(i, "as many values as the arrays have must be set");
    for (size_t k = 0; k < n; k++, v += i->size) memcpy(i->values[r[k] - U], v, i->size * sizeof *v);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, double v[], size_t total)
{
    Slave *i = c;
    if (total != n * i->size) return refuse(i, "as many values as the arrays have must be read");
    for (size_t k = 0; k < n; k++, v += i->size) memcpy(v, i->values[r[k] - U], i->size * sizeof *v);
    return fmi3OK;
}
