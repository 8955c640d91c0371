/* The plant of plant.h as an FMU of FMI 3.0: co-simulation and model exchange, with an array, a binary and a clock. */

#include <strings.h>
#include "fmi3Functions.h"
#include "plant.h"

#ifndef TOKEN
#define TOKEN "{plant-of-the-tests}"
#endif
#define API FMI3_Export
#define REFUSE(text) return refuse(self, text)
#define NEVER(name, ...) API fmi3Status fmi3##name(fmi3Instance self, __VA_ARGS__) { REFUSE(#name " is not supported"); }
typedef fmi3ValueReference Reference;

static void say(Plant *self, fmi3Status status, const char *category, const char *text) {
    if (self->log) ((fmi3LogMessageCallback)self->log)(self->environment, status, category, text);
}
static fmi3Status refuse(Plant *self, const char *text) { say(self, fmi3Error, "logStatusError", text); return fmi3Error; }

API const char *fmi3GetVersion(void) { return "3.0"; }
API fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    Plant *self = i;
    for (size_t a = 0; a < n; a++)
        if (IS(category_refused) || (IS(second_category) && !strcmp(categories[a], "logAll"))) REFUSE("unknown category");
    if (IS(logging_refused)) REFUSE("not supported");
    if (IS(logging_off_refused) && !on) REFUSE("not supported");
    self->logging = on;
    return fmi3OK;
}
static Plant *make(fmi3String token, fmi3Boolean logging, void *environment, fmi3LogMessageCallback log, int exchange) {
    size_t length = strlen(TOKEN);
    int wrong = IS(token_prefix) ? strncmp(token, TOKEN, 8) : IS(token_suffix) ? strncmp(token, TOKEN, length) : IS(token_case) ? strcasecmp(token, TOKEN)
        : IS(token_short) ? strncmp(token, TOKEN, strlen(token)) : IS(token_length) ? strlen(token) != length : IS(token_contained) ? !strstr(token, "plant") : strcmp(token, TOKEN);
    if (wrong) return NULL;
    Plant *self = calloc(1, sizeof *self);
    self->exchange = exchange;
    self->log = (void *)log;
    self->environment = environment;
    self->logging = logging;
    begin(self);
    return self;
}
API fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) { return make(token, logging, environment, log, 1); }
API fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, const Reference required[], size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update) {
    Plant *self = make(token, logging, environment, log, 0);
    if (self) self->events = events;
    return self;
}
API fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) { return NULL; }
API void fmi3FreeInstance(fmi3Instance i) { free(i); }
API fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean a, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean b, fmi3Float64 stop) {
    Plant *self = i;
    if (self->phase != INSTANTIATED) REFUSE("not now");
    if (IS(start_refused) && start != 0.0) REFUSE("the start must be 0");
    if (IS(start_negative) && start < 0.0) REFUSE("the start must not be negative");
    if (self->logging || IS(chatty_start)) say(self, fmi3OK, "logAll", "initialising");
    self->s.time = self->s.start = start;
    self->phase = INITIALISATION;
    return fmi3OK;
}
API fmi3Status fmi3ExitInitializationMode(fmi3Instance i) {
    Plant *self = i;
    if (self->phase != INITIALISATION) REFUSE("not now");
    leave_initialisation(self);
    self->phase = self->exchange || self->events ? EVENT : STEP;
    return fmi3OK;
}
API fmi3Status fmi3EnterEventMode(fmi3Instance i) {
    Plant *self = i;
    if (!self->exchange && !self->events) REFUSE("event mode is not used");
    self->phase = EVENT;
    return fmi3OK;
}
API fmi3Status fmi3EnterStepMode(fmi3Instance i) { ((Plant *)i)->phase = STEP; return fmi3OK; }
API fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { ((Plant *)i)->phase = CONTINUOUS; return fmi3OK; }
API fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) {
    Plant *self = i;
    if (self->phase != INSTANTIATED) REFUSE("not now");
    self->phase = CONFIGURATION;
    return fmi3OK;
}
API fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { ((Plant *)i)->phase = INSTANTIATED; return fmi3OK; }
API fmi3Status fmi3Terminate(fmi3Instance i) { ((Plant *)i)->phase = TERMINATED; return fmi3OK; }
API fmi3Status fmi3Reset(fmi3Instance i) {
    Plant *self = i;
    if (IS(reset_ended) && self->phase == TERMINATED) REFUSE("it has ended");
    if (IS(reset_initialising) && self->phase == INITIALISATION) REFUSE("it is being initialised");
    reset(self);
    return fmi3OK;
}

/* Values of numbers; only P has several. */
API fmi3Status fmi3GetFloat64(fmi3Instance i, const Reference r[], size_t n, fmi3Float64 out[], size_t size) {
    Plant *self = i;
    size_t at = 0;
    if (self->phase == TERMINATED && (IS(ended_get) || IS(ended_real))) REFUSE("it has ended");
    for (size_t a = 0; a < n; a++) {
        size_t used = r[a] == P ? (size_t)self->s.n : 1;
        if (at + used > size || (a + 1 == n && at + used != size)) REFUSE("another number of values");
        if (r[a] == P) memcpy(out + at, self->s.p, used * sizeof *out);
        else if (!number(self, r[a], out + at)) REFUSE("unknown value reference");
        at += used;
    }
    return fmi3OK;
}
API fmi3Status fmi3SetFloat64(fmi3Instance i, const Reference r[], size_t n, const fmi3Float64 in[], size_t size) {
    Plant *self = i;
    size_t at = 0;
    for (size_t a = 0; a < n; a++) {
        size_t used = r[a] == P ? (size_t)self->s.n : 1;
        if (at + used > size) REFUSE("another number of values");
        if (r[a] == P) {
            if (self->phase >= EVENT) REFUSE("it cannot be set now");
            memcpy(self->s.p, in + at, (IS(first_element) ? 1 : IS(last_element) ? used - 1 : used) * sizeof *in);
            if (IS(elements_reversed)) for (size_t b = 0; b < used; b++) self->s.p[b] = in[at + used - 1 - b];
        } else if (!put(self, r[a], in[at])) REFUSE("it cannot be set now");
        at += used;
    }
    return fmi3OK;
}
#define VALUES(Type, type, inner, getter, setter, kind) \
    API fmi3Status fmi3Get##Type(fmi3Instance i, const Reference r[], size_t n, type out[], size_t size) { \
        Plant *self = i; \
        if (self->phase == TERMINATED && (IS(ended_get) || IS(ended_##kind))) REFUSE("it has ended"); \
        if (size != n) REFUSE("another number of values"); \
        for (size_t a = 0; a < n; a++) { \
            inner value; \
            if (!getter(self, r[a], &value)) REFUSE("unknown value reference"); \
            out[a] = value; \
        } \
        return fmi3OK; \
    } \
    API fmi3Status fmi3Set##Type(fmi3Instance i, const Reference r[], size_t n, const type in[], size_t size) { \
        Plant *self = i; \
        for (size_t a = 0; a < n; a++) if (!setter(self, r[a], in[a])) REFUSE("it cannot be set now"); \
        return fmi3OK; \
    }
static bool text(Plant *self, unsigned r, const char **out) {
    if (IS(text_shared)) {
        snprintf(self->text, sizeof self->text, r == T ? "<%.60s>" : "%.60s", self->s.label);
        *out = self->text;
        return true;
    }
    *out = IS(text_latin) && r == T ? "pl\xe4ne" : r == T && IS(text_later) && self->s.steps > 30 ? "a\xff" : self->s.label;
    return r == L || r == T;
}
static bool put_text(Plant *self, unsigned r, const char *value) {
    if (r != L || self->phase >= EVENT) return false;
    if (!IS(drop_text)) snprintf(self->s.label, IS(short_text) ? 6 : sizeof self->s.label, "%s", value);
    for (char *a = self->s.label; IS(text_plain) && *a; a++) if (*a & 0x80) *a = '?';
    return true;
}
static bool size_of(Plant *self, unsigned r, uint64_t *out) { *out = self->s.n; return r == N; }
static bool put_size(Plant *self, unsigned r, uint64_t value) {
    if (r != N || self->phase != CONFIGURATION || value > SIZE) return false;
    for (uint64_t a = self->s.n; a < value; a++) self->s.p[a] = 0.0;
    self->s.n = (int)value;
    return true;
}
VALUES(Int32, fmi3Int32, int, whole, put_whole, whole)
VALUES(Int64, fmi3Int64, int, whole, put_whole, item)
VALUES(String, fmi3String, const char *, text, put_text, text)
VALUES(UInt64, fmi3UInt64, uint64_t, size_of, put_size, size)
API fmi3Status fmi3GetBoolean(fmi3Instance i, const Reference r[], size_t n, fmi3Boolean out[], size_t size) {
    Plant *self = i;
    if (self->phase == TERMINATED && (IS(ended_get) || IS(ended_truth))) REFUSE("it has ended");
    for (size_t a = 0; a < n; a++) {
        int value;
        if (!truth(self, r[a], &value)) REFUSE("unknown value reference");
        ((unsigned char *)out)[a] = (unsigned char)value;
    }
    return fmi3OK;
}
API fmi3Status fmi3SetBoolean(fmi3Instance i, const Reference r[], size_t n, const fmi3Boolean in[], size_t size) {
    Plant *self = i;
    for (size_t a = 0; a < n; a++) if (!put_truth(self, r[a], in[a])) REFUSE("it cannot be set now");
    return fmi3OK;
}
API fmi3Status fmi3GetBinary(fmi3Instance i, const Reference r[], size_t n, size_t sizes[], fmi3Binary out[], size_t size) {
    static const unsigned char bytes[16];
    Plant *self = i;
    for (size_t a = 0; a < n; a++) {
        if (r[a] != BLOB) REFUSE("unknown value reference");
        sizes[a] = IS(binary_long) ? 9 : IS(binary_later) && self->s.steps > 30 ? 16 : 4;
        out[a] = bytes;
    }
    return fmi3OK;
}
NEVER(SetBinary, const Reference r[], size_t n, const size_t sizes[], const fmi3Binary in[], size_t size)
#define NUMBERS(Type) \
    NEVER(Get##Type, const Reference r[], size_t n, fmi3##Type out[], size_t size) \
    NEVER(Set##Type, const Reference r[], size_t n, const fmi3##Type in[], size_t size)
NUMBERS(Float32)
NUMBERS(Int8)
NUMBERS(UInt8)
NUMBERS(Int16)
NUMBERS(UInt16)
NUMBERS(UInt32)

API fmi3Status fmi3GetClock(fmi3Instance i, const Reference r[], size_t n, fmi3Clock out[]) { for (size_t a = 0; a < n; a++) out[a] = false; return fmi3OK; }
API fmi3Status fmi3SetClock(fmi3Instance i, const Reference r[], size_t n, const fmi3Clock in[]) {
    for (size_t a = 0; a < n; a++) ((Plant *)i)->tick = in[a];
    return fmi3OK;
}
API fmi3Status fmi3GetIntervalDecimal(fmi3Instance i, const Reference r[], size_t n, fmi3Float64 out[], fmi3IntervalQualifier q[]) {
    for (size_t a = 0; a < n; a++) { out[a] = 0.1; q[a] = fmi3IntervalUnchanged; }
    return fmi3OK;
}
API fmi3Status fmi3GetIntervalFraction(fmi3Instance self, const Reference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 d[], fmi3IntervalQualifier q[]) {
    if (IS(fraction_refused)) REFUSE("not supported");
    for (size_t a = 0; a < n; a++) { c[a] = IS(fraction_wrong) ? 2 : 1; d[a] = 10; q[a] = fmi3IntervalUnchanged; }
    return fmi3OK;
}
API fmi3Status fmi3GetShiftDecimal(fmi3Instance i, const Reference r[], size_t n, fmi3Float64 out[]) { out[0] = 0.05; return fmi3OK; }
API fmi3Status fmi3GetShiftFraction(fmi3Instance i, const Reference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 d[]) {
    for (size_t a = 0; a < n; a++) { c[a] = 1; d[a] = 20; }
    return fmi3OK;
}
NEVER(SetIntervalDecimal, const Reference r[], size_t n, const fmi3Float64 in[])
NEVER(SetIntervalFraction, const Reference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 d[])
NEVER(SetShiftDecimal, const Reference r[], size_t n, const fmi3Float64 in[])
NEVER(SetShiftFraction, const Reference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 d[])
API fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance self) {
    if (IS(evaluate_refused)) REFUSE("not supported");
    return fmi3OK;
}
API fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *again, fmi3Boolean *end, fmi3Boolean *nominals_changed, fmi3Boolean *changed,
    fmi3Boolean *defined, fmi3Float64 *next) {
    *again = *end = *nominals_changed = *defined = false;
    *next = 0.0;
    *changed = event(i);
    return fmi3OK;
}

API fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *state) {
    if (*state && IS(state_in_place)) return fmi3Error;
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Plant *)i)->s, sizeof(State));
    return fmi3OK;
}
API fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState state) {
    Plant *self = i;
    restore(self, state);
    if (self->phase < EVENT) self->phase = self->exchange ? EVENT : STEP;
    return fmi3OK;
}
API fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *state) { free(*state); *state = NULL; return fmi3OK; }
API fmi3Status fmi3SerializedFMUStateSize(fmi3Instance i, fmi3FMUState state, size_t *size) { *size = sizeof(State) - (IS(bytes_overrun) ? 64 : 0); return fmi3OK; }
API fmi3Status fmi3SerializeFMUState(fmi3Instance i, fmi3FMUState state, fmi3Byte out[], size_t size) { memcpy(out, state, IS(bytes_overrun) ? sizeof(State) : size); return fmi3OK; }
API fmi3Status fmi3DeserializeFMUState(fmi3Instance i, const fmi3Byte in[], size_t size, fmi3FMUState *state) {
    *state = malloc(sizeof(State));
    memcpy(*state, in, sizeof(State));
    lose_in_bytes(*state);
    return fmi3OK;
}

API fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance self, Reference r, size_t *n) { REFUSE("not supported"); }
API fmi3Status fmi3GetVariableDependencies(fmi3Instance self, Reference r, size_t element[], Reference known[], size_t of[], fmi3DependencyKind kind[], size_t n) { REFUSE("not supported"); }
API fmi3Status fmi3GetDirectionalDerivative(fmi3Instance i, const Reference a[], size_t na, const Reference b[], size_t nb, const fmi3Float64 seed[], size_t ns, fmi3Float64 out[], size_t no) {
    sensitivity(i, a, na, b, nb, seed, out, false);
    return fmi3OK;
}
API fmi3Status fmi3GetAdjointDerivative(fmi3Instance i, const Reference a[], size_t na, const Reference b[], size_t nb, const fmi3Float64 seed[], size_t ns, fmi3Float64 out[], size_t no) {
    sensitivity(i, a, na, b, nb, seed, out, true);
    return fmi3OK;
}
API fmi3Status fmi3GetOutputDerivatives(fmi3Instance i, const Reference r[], size_t n, const fmi3Int32 order[], fmi3Float64 out[], size_t size) {
    Plant *self = i;
    for (size_t a = 0; a < n; a++) {
        State *s = &self->s;
        double dv = force(self, s, s->x, s->v);
        if (IS(slopes_refused) || (IS(second_order_refused) && order[a] > 1)) REFUSE("not supported");
        out[a] = order[a] > 1 ? 0.0 : r[a] == Y ? s->v : r[a] == Z ? dv * s->x + s->v * s->v : r[a] == X ? s->v : r[a] == YS ? s->v * sum(s) : r[a] == Q ? s->u : 0.0;
    }
    return fmi3OK;
}

API fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event, fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *last) {
    Plant *self = i;
    if (IS(step_after_end) && self->phase == TERMINATED) return fmi3OK;
    if (self->phase != STEP || !(h > 0.0)) REFUSE("not now");
    if (IS(clock_at_zero) && self->s.steps == 0 && fabs(t) > 1e-9) REFUSE("the first step must be at 0");
    if ((self->logging || IS(chatty)) && self->s.steps % 10 == 0) say(self, fmi3OK, "logAll", "a step");
    if (IS(chatty_late) && self->s.steps == 40) say(self, fmi3OK, "logAll", "a step");
    go(self, t, h);
    *event = *end = *early = false;
    *last = IS(last_before) ? t : t + h;
    *end = IS(ends_early) && self->s.steps > 20;
    return fmi3OK;
}
API fmi3Status fmi3ActivateModelPartition(fmi3Instance self, Reference clock, fmi3Float64 t) { REFUSE("not supported"); }
API fmi3Status fmi3CompletedIntegratorStep(fmi3Instance i, fmi3Boolean keep, fmi3Boolean *enter, fmi3Boolean *end) {
    *enter = *end = 0;
    complete(i);
    return fmi3OK;
}
API fmi3Status fmi3SetTime(fmi3Instance i, fmi3Float64 t) { ((Plant *)i)->s.time = t; return fmi3OK; }
API fmi3Status fmi3SetContinuousStates(fmi3Instance i, const fmi3Float64 in[], size_t n) { set_states(i, in); return fmi3OK; }
API fmi3Status fmi3GetContinuousStates(fmi3Instance i, fmi3Float64 out[], size_t n) { states(i, out); return fmi3OK; }
API fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance i, fmi3Float64 out[], size_t n) { rates(i, out); return fmi3OK; }
API fmi3Status fmi3GetEventIndicators(fmi3Instance i, fmi3Float64 out[], size_t n) { indicators(i, out); return fmi3OK; }
API fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance i, fmi3Float64 out[], size_t n) { nominals(out); return fmi3OK; }
API fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance i, size_t *n) { *n = 3; return fmi3OK; }
API fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance i, size_t *n) { *n = 3; return fmi3OK; }
