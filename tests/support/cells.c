/* Cells of a battery as an FMU of FMI 3.0 for co-simulation, whose arrays have the size of a structural parameter.
 *
 *     dq[k]/dt = -i / c[k],   u[k] = 3 + q[k] + q[k]^2 / 5 - r i
 *
 * It is correct, or has the one fault that the macro FAULT names. */

#include <stdlib.h>
#include <string.h>
#include "fmi3Functions.h"

#ifndef FAULT
#define FAULT ""
#endif
#define API FMI3_Export
#define IS(name) (!strcmp(FAULT, #name))
#define NEVER(name, ...) API fmi3Status fmi3##name(fmi3Instance i, __VA_ARGS__) { return fmi3Error; }
#define NO_ACCESS(type) NEVER(Get##type, References r, size_t n, fmi3##type v[], size_t m) NEVER(Set##type, References r, size_t n, const fmi3##type v[], size_t m)
enum { TIME, SIZE, CURRENT, RESISTANCE, CAPACITY, CHARGE, RATE, VOLTAGE, MOST = 8 };
enum { INSTANTIATED, CONFIGURATION, INITIALISATION, STEP, TERMINATED };
typedef const fmi3ValueReference *References;
typedef struct {
    double time, current, resistance, capacity[MOST], charge[MOST], shown[MOST];
    uint64_t size;
    int phase;
} Cells;

static double voltage(const Cells *c, uint64_t k) {
    return 3.0 + c->charge[k] + 0.2 * c->charge[k] * c->charge[k] - c->resistance * c->current;
}
static double rate(const Cells *c, uint64_t k) { return -c->current / c->capacity[k]; }
static void begin(Cells *c) {
    *c = (Cells){.current = 2.0, .resistance = 0.05, .size = 3};
    for (int k = 0; k < MOST; k++) c->capacity[k] = 40.0, c->charge[k] = 0.8;
}
static uint64_t size(const Cells *c, fmi3ValueReference r) { return r >= CAPACITY ? c->size : 1; }

API const char *fmi3GetVersion(void) { return "3.0"; }
API fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String names[]) { return fmi3OK; }
API fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, References required, size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update) {
    if (strcmp(token, "{cells-of-the-tests}")) return NULL;
    Cells *c = malloc(sizeof *c);
    begin(c);
    return c;
}
API fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) { return NULL; }
API fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) { return NULL; }
API void fmi3FreeInstance(fmi3Instance i) { free(i); }
static fmi3Status go(Cells *c, int from, int to) {
    if (c->phase != from) return fmi3Error;
    c->phase = to;
    return fmi3OK;
}
API fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { return go(i, INSTANTIATED, CONFIGURATION); }
API fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return go(i, CONFIGURATION, INSTANTIATED); }
API fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean a, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean b, fmi3Float64 stop) {
    ((Cells *)i)->time = start;
    return go(i, INSTANTIATED, INITIALISATION);
}
API fmi3Status fmi3ExitInitializationMode(fmi3Instance i) {
    Cells *c = i;
    if (IS(refuses_sizes) && c->size != 3) return fmi3Error;
    return go(c, INITIALISATION, STEP);
}
API fmi3Status fmi3Terminate(fmi3Instance i) { ((Cells *)i)->phase = TERMINATED; return fmi3OK; }
API fmi3Status fmi3Reset(fmi3Instance i) { begin(i); return fmi3OK; }
API fmi3Status fmi3GetFloat64(fmi3Instance i, References r, size_t n, double v[], size_t total) {
    Cells *c = i;
    size_t at = 0, wanted = 0;
    for (size_t a = 0; a < n; a++) wanted += size(c, r[a]);
    if (wanted != total) return fmi3Error;
    for (size_t a = 0; a < n; a++)
        for (uint64_t k = 0; k < size(c, r[a]); k++) switch (r[a]) {
            case TIME: v[at++] = c->time; break;
            case CURRENT: v[at++] = c->current; break;
            case RESISTANCE: v[at++] = c->resistance; break;
            case CAPACITY: v[at++] = c->capacity[k]; break;
            case CHARGE: v[at++] = c->charge[k]; break;
            case RATE: v[at++] = rate(c, k); break;
            case VOLTAGE: v[at++] = IS(voltage_late) && c->phase < STEP ? 0.0 : voltage(c, k); break;
            default: return fmi3Error;
        }
    return fmi3OK;
}
API fmi3Status fmi3SetFloat64(fmi3Instance i, References r, size_t n, const double v[], size_t total) {
    Cells *c = i;
    size_t at = 0, wanted = 0;
    for (size_t a = 0; a < n; a++) wanted += size(c, r[a]);
    if (wanted != total) return fmi3Error;
    for (size_t a = 0; a < n; a++) {
        if (r[a] != CURRENT && c->phase > INITIALISATION) return fmi3Error;
        for (uint64_t k = 0; k < size(c, r[a]); k++, at++) switch (r[a]) {
            case CURRENT: c->current = v[at]; break;
            case RESISTANCE: c->resistance = v[at]; break;
            case CAPACITY: if (!IS(resized_lost) || k < 3) c->capacity[k] = v[at]; break;
            case CHARGE: c->charge[k] = v[at]; break;
            default: return fmi3Error;
        }
    }
    return fmi3OK;
}
API fmi3Status fmi3GetUInt64(fmi3Instance i, References r, size_t n, uint64_t v[], size_t m) {
    for (size_t k = 0; k < n; k++) if (r[k] != SIZE) return fmi3Error; else v[k] = ((Cells *)i)->size;
    return n == m ? fmi3OK : fmi3Error;
}
API fmi3Status fmi3SetUInt64(fmi3Instance i, References r, size_t n, const uint64_t v[], size_t m) {
    Cells *c = i;
    if (n != 1 || m != 1 || r[0] != SIZE || c->phase != CONFIGURATION || v[0] < 1 || v[0] > MOST) return fmi3Error;
    c->size = v[0];
    return fmi3OK;
}
API fmi3Status fmi3GetOutputDerivatives(fmi3Instance i, References r, size_t n, const fmi3Int32 o[], fmi3Float64 v[], size_t m) {
    Cells *c = i;
    size_t at = 0;
    for (size_t a = 0; a < n; a++)
        for (uint64_t k = 0; k < size(c, r[a]); k++) {
            double slope = r[a] == CHARGE ? 1.0 : r[a] == VOLTAGE ? 1.0 + 0.4 * c->charge[k] : 0.0;
            if (o[a] != 1 || slope == 0.0) return fmi3Error;
            v[at++] = IS(first_slope) && k ? 0.0 : slope * rate(c, k);
        }
    return fmi3OK;
}
API fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no, fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early,
    fmi3Float64 *last) {
    Cells *c = i;
    if (c->phase != STEP || h <= 0.0) return fmi3Error;
    for (uint64_t k = 0; k < c->size; k++) c->charge[k] += h * rate(c, k);
    *event = *end = *early = fmi3False;
    *last = c->time = t + h;
    return fmi3OK;
}
NO_ACCESS(Float32) NO_ACCESS(Int8) NO_ACCESS(UInt8) NO_ACCESS(Int16) NO_ACCESS(UInt16) NO_ACCESS(Int32) NO_ACCESS(UInt32) NO_ACCESS(Int64)
NO_ACCESS(Boolean) NO_ACCESS(String)
NEVER(GetBinary, References r, size_t n, size_t s[], fmi3Binary v[], size_t m)
NEVER(SetBinary, References r, size_t n, const size_t s[], const fmi3Binary v[], size_t m)
NEVER(GetClock, References r, size_t n, fmi3Clock v[])
NEVER(SetClock, References r, size_t n, const fmi3Clock v[])
NEVER(GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
NEVER(GetVariableDependencies, fmi3ValueReference r, size_t a[], fmi3ValueReference b[], size_t c[], fmi3DependencyKind k[], size_t n)
NEVER(GetFMUState, fmi3FMUState *s)
NEVER(SetFMUState, fmi3FMUState s)
NEVER(FreeFMUState, fmi3FMUState *s)
NEVER(SerializedFMUStateSize, fmi3FMUState s, size_t *n)
NEVER(SerializeFMUState, fmi3FMUState s, fmi3Byte b[], size_t n)
NEVER(DeserializeFMUState, const fmi3Byte b[], size_t n, fmi3FMUState *s)
NEVER(GetDirectionalDerivative, References u, size_t n, References k, size_t m, const fmi3Float64 s[], size_t a, fmi3Float64 v[], size_t b)
NEVER(GetAdjointDerivative, References u, size_t n, References k, size_t m, const fmi3Float64 s[], size_t a, fmi3Float64 v[], size_t b)
NEVER(GetIntervalDecimal, References r, size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[])
NEVER(GetIntervalFraction, References r, size_t n, fmi3UInt64 a[], fmi3UInt64 b[], fmi3IntervalQualifier q[])
NEVER(GetShiftDecimal, References r, size_t n, fmi3Float64 v[])
NEVER(GetShiftFraction, References r, size_t n, fmi3UInt64 a[], fmi3UInt64 b[])
NEVER(SetIntervalDecimal, References r, size_t n, const fmi3Float64 v[])
NEVER(SetIntervalFraction, References r, size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
NEVER(SetShiftDecimal, References r, size_t n, const fmi3Float64 v[])
NEVER(SetShiftFraction, References r, size_t n, const fmi3UInt64 a[], const fmi3UInt64 b[])
NEVER(UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d, fmi3Boolean *e, fmi3Float64 *t)
NEVER(CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
NEVER(SetTime, fmi3Float64 t)
NEVER(SetContinuousStates, const fmi3Float64 x[], size_t n)
NEVER(GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
NEVER(GetEventIndicators, fmi3Float64 x[], size_t n)
NEVER(GetContinuousStates, fmi3Float64 x[], size_t n)
NEVER(GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
NEVER(GetNumberOfEventIndicators, size_t *n)
NEVER(GetNumberOfContinuousStates, size_t *n)
NEVER(ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)
API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance i) { return fmi3Error; }
API fmi3Status fmi3EnterEventMode(fmi3Instance i) { return fmi3Error; }
API fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return fmi3Error; }
API fmi3Status fmi3EnterStepMode(fmi3Instance i) { return fmi3Error; }
