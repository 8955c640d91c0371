/* The plant of plant.h as an FMU of FMI 2.0: co-simulation and model exchange. */

#include <strings.h>
#include "fmi2Functions.h"
#include "plant.h"

#ifndef TOKEN
#define TOKEN "{plant-of-the-tests}"
#endif
#define REFUSE(text) return refuse(self, text)

static void say(Plant *self, fmi2Status status, const char *category, const char *text) {
    if (self->log) ((fmi2CallbackLogger)self->log)(self->environment, "plant", status, category, text);
}
static fmi2Status refuse(Plant *self, const char *text) { say(self, fmi2Error, "logStatusError", text); return fmi2Error; }

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    Plant *self = c;
    for (size_t a = 0; a < n; a++)
        if (IS(category_refused) || (IS(second_category) && !strcmp(categories[a], "logAll"))) REFUSE("unknown category");
    if (IS(logging_refused)) REFUSE("not supported");
    if (IS(logging_off_refused) && !on) REFUSE("not supported");
    self->logging = on;
    return fmi2OK;
}
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources, const fmi2CallbackFunctions *callbacks,
                              fmi2Boolean visible, fmi2Boolean logging) {
    size_t length = strlen(TOKEN);
    int wrong = IS(token_prefix) ? strncmp(guid, TOKEN, 8) : IS(token_suffix) ? strncmp(guid, TOKEN, length) : IS(token_case) ? strcasecmp(guid, TOKEN)
        : IS(token_short) ? strncmp(guid, TOKEN, strlen(guid)) : IS(token_length) ? strlen(guid) != length : IS(token_contained) ? !strstr(guid, "plant") : strcmp(guid, TOKEN);
    if (wrong) return NULL;
    Plant *self = calloc(1, sizeof *self);
    self->exchange = type == fmi2ModelExchange;
    self->log = (void *)callbacks->logger;
    self->environment = callbacks->componentEnvironment;
    self->logging = logging;
    begin(self);
    return self;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real tolerance, fmi2Real start, fmi2Boolean b, fmi2Real stop) {
    Plant *self = c;
    if (IS(start_refused) && start != 0.0) REFUSE("the start must be 0");
    if (IS(start_negative) && start < 0.0) REFUSE("the start must not be negative");
    self->s.time = start;
    self->s.start = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Plant *self = c;
    if (self->phase != INSTANTIATED) REFUSE("not now");
    if (self->logging || IS(chatty_start)) say(self, fmi2OK, "logAll", "initialising");
    self->phase = INITIALISATION;
    return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Plant *self = c;
    if (self->phase != INITIALISATION) REFUSE("not now");
    leave_initialisation(self);
    self->phase = self->exchange ? EVENT : STEP;
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { ((Plant *)c)->phase = TERMINATED; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) {
    Plant *self = c;
    if (IS(reset_ended) && self->phase == TERMINATED) REFUSE("it has ended");
    if (IS(reset_initialising) && self->phase == INITIALISATION) REFUSE("it is being initialised");
    reset(self);
    return fmi2OK;
}

#define GET(Type, type, function, kind) \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, type out[]) { \
        Plant *self = c; \
        if (self->phase == TERMINATED && (IS(ended_get) || (IS(ended_##kind)))) REFUSE("it has ended"); \
        for (size_t a = 0; a < n; a++) if (!function(self, r[a], out + a)) REFUSE("unknown value reference"); \
        return fmi2OK; \
    }
#define SET(Type, type, function) \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, const type in[]) { \
        Plant *self = c; \
        for (size_t a = 0; a < n; a++) if (!function(self, r[a], in[a])) REFUSE("it cannot be set"); \
        return fmi2OK; \
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
GET(Real, fmi2Real, number, real)
GET(Integer, fmi2Integer, whole, whole)
GET(Boolean, fmi2Boolean, truth, truth)
GET(String, fmi2String, text, text)
SET(Real, fmi2Real, put)
SET(Integer, fmi2Integer, put_whole)
SET(Boolean, fmi2Boolean, put_truth)
SET(String, fmi2String, put_text)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state && IS(state_in_place)) return fmi2Error;
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Plant *)c)->s, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Plant *self = c;
    restore(self, state);
    if (self->phase < EVENT) self->phase = self->exchange ? EVENT : STEP;
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) { free(*state); *state = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) { *size = sizeof(State) - (IS(bytes_overrun) ? 64 : 0); return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte out[], size_t size) { memcpy(out, state, IS(bytes_overrun) ? sizeof(State) : size); return fmi2OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte in[], size_t size, fmi2FMUstate *state) {
    *state = malloc(sizeof(State));
    memcpy(*state, in, sizeof(State));
    lose_in_bytes(*state);
    return fmi2OK;
}
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference a[], size_t na, const fmi2ValueReference b[], size_t nb, const fmi2Real seed[], fmi2Real out[]) {
    sensitivity(c, a, na, b, nb, seed, out, false);
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer order[], const fmi2Real in[]) {
    Plant *self = c;
    if (IS(interpolation_refused)) REFUSE("not supported");
    if (IS(interpolation_second) && n && r[0] == W) REFUSE("only the first input");
    for (size_t a = 0; a < n; a++) if (r[a] == U) self->s.slope = in[a];
    return fmi2OK;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer order[], fmi2Real out[]) {
    Plant *self = c;
    for (size_t a = 0; a < n; a++) {
        State *s = &self->s;
        double dv = force(self, s, s->x, s->v);
        if (IS(slopes_refused) || (IS(second_order_refused) && order[a] > 1)) REFUSE("not supported");
        out[a] = order[a] > 1 ? 0.0 : r[a] == Y ? s->v : r[a] == Z ? dv * s->x + s->v * s->v : r[a] == X ? s->v : r[a] == YS ? s->v * sum(s) : r[a] == Q ? s->u : 0.0;
    }
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep) {
    Plant *self = c;
    if (IS(step_after_end) && self->phase == TERMINATED) return fmi2OK;
    if (self->phase != STEP || !(h > 0.0)) REFUSE("not now");
    if ((IS(clock_at_zero) || IS(start_ignored_steps)) && self->s.steps == 0 && fabs(t) > 1e-9) REFUSE("the first step must be at 0");
    if ((self->logging || IS(chatty)) && self->s.steps % 10 == 0) say(self, fmi2OK, "logAll", "a step");
    if (IS(chatty_late) && self->s.steps == 40) say(self, fmi2OK, "logAll", "a step");
    go(self, t, h);
    return fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return fmi2Error; }
static fmi2Status status(Plant *self) { REFUSE("no such status"); }
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *v) { return status(c); }
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v) { *v = ((Plant *)c)->s.time; return k == fmi2LastSuccessfulTime ? fmi2OK : status(c); }
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) { return status(c); }
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) { *v = 0; return fmi2OK; }
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *v) { return status(c); }

fmi2Status fmi2EnterEventMode(fmi2Component c) { ((Plant *)c)->phase = EVENT; return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    memset(info, 0, sizeof *info);
    info->valuesOfContinuousStatesChanged = event(c);
    return fmi2OK;
}
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { ((Plant *)c)->phase = CONTINUOUS; return fmi2OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean keep, fmi2Boolean *enter, fmi2Boolean *end) {
    *enter = *end = 0;
    complete(c);
    return fmi2OK;
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t) { ((Plant *)c)->s.time = t; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real in[], size_t n) { set_states(c, in); return fmi2OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real out[], size_t n) { states(c, out); return fmi2OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real out[], size_t n) { rates(c, out); return fmi2OK; }
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real out[], size_t n) { indicators(c, out); return fmi2OK; }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real out[], size_t n) { nominals(out); return fmi2OK; }
