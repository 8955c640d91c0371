/* Access to variables, saved states, clocks and derivatives of ball3.c. */

static double acceleration(const State *s) { return s->u - s->g; }

static fmi3Status get64(Ball *b, fmi3ValueReference r, double *out, size_t *used) {
    State *s = &b->s;
    *used = 1;
    switch (r) {
        case X: *out = s->x + s->hidden;
#ifdef HOSTILE
            if (orders.forced) *out = orders.value;
#endif
            break;
        case V: *out = s->v; break;
        case U: *out = s->u; break;
        case G: *out = s->g; break;
        case E: *out = s->e; break;
        case TIME: *out = s->time; break;
        case DER_X: *out = s->v; break;
        case DER_V: *out = acceleration(s); break;
        case SMOOTH: *out = s->smooth; break;
        case OLD: *out = s->old; break;
        case P: case Q:
            *used = s->n;
#ifdef FAULT_configuration_array
            *used = 3;
#endif
            for (size_t k = 0; k < *used; k++) out[k] = r == P ? s->p[k] : 2.0 * s->p[k];
            break;
        default: return refuse(b, "unknown value reference");
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 out[], size_t nOut) {
    Ball *b = i;
    double found[SIZE];
    size_t used, next = 0;
    AT(get);
#ifdef FAULT_python_exception
    leave_exception();
#endif
#ifdef FAULT_update_outside
    if (b->update && b->mode == STEP) { bool early = false; double when = 0.0; b->update(b->environment, b->s.time, false, true, false, false, &early, &when); }
#endif
#ifdef FAULT_update_get_refused
    if (b->updating) return refuse(b, "not in an update");
#endif
#ifdef FAULT_get_error
    if (b->s.steps == 5) return refuse(b, "no value");
#endif
    for (size_t k = 0; k < n; k++) {
#ifdef FAULT_crash_unknown
        if (r[k] > BIG) abort();
#endif
#ifdef FAULT_unknown_reference
        if (r[k] > BIG) { out[next++] = 0.0; continue; }
#endif
        if (get64(b, r[k], found, &used) != fmi3OK) return fmi3Error;
#ifdef FAULT_value_count
        if (next + used > nOut) return refuse(b, "too few values");
#else
        if (next + used > nOut) return refuse(b, "too few values");
        if (k + 1 == n && next + used != nOut) return refuse(b, "another number of values");
#endif
#ifdef FAULT_random
        if (r[k] == X && b->s.steps) found[0] += 0.01 * (double)(++seed % 7);
#endif
#ifdef FAULT_nan_output
        if (r[k] == V && b->s.steps > 5) found[0] = NAN;
#endif
#ifdef FAULT_out_of_range
        if (r[k] == X && b->s.steps > 5) found[0] += 100.0;
#endif
        memcpy(out + next, found, used * sizeof *found);
        next += used;
    }
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 in[], size_t nIn) {
    Ball *b = i;
    State *s = &b->s;
    bool early = b->mode == INSTANTIATED || b->mode == INITIALISATION;
    AT(set);
#ifdef FAULT_update_set_refused
    if (b->updating) return refuse(b, "not in an update");
#endif
    for (size_t k = 0, at = 0; k < n; k++) {
        size_t used = r[k] == P ? s->n : 1;
        if (at + used > nIn) return refuse(b, "too few values");
        double value = in[at];
        switch (r[k]) {
            case U:
#ifdef FAULT_input_refused
                if (value != 0.0) return refuse(b, "too much");
#endif
#ifdef FAULT_input_discrete
                if (b->mode == CONTINUOUS) return refuse(b, "in event mode only");
#endif
                s->u = value; break;
            case X: case V:
                if (!early && b->kind != 0) {
#ifdef FAULT_set_output
                    break;
#endif
                    return refuse(b, "outputs cannot be set");
                }
#ifdef FAULT_set_output
                if (b->kind == 0 && !early) break;
#else
                if (!early) return refuse(b, "outputs cannot be set");
#endif
#ifdef FAULT_set_initial_refused
                return refuse(b, "not this one");
#endif
                *(r[k] == X ? &s->x : &s->v) = value; break;
            case G:
#ifdef FAULT_set_refused
                return refuse(b, "not this one");
#endif
                s->g = value; break;
            case E:
#ifdef FAULT_set_effect
                s->hidden = 0.25;
#endif
                if (!early) return refuse(b, "it is fixed");
                s->e = value; break;
            case P:
                if (!early) return refuse(b, "it is fixed");
                memcpy(s->p, in + at, used * sizeof *in); break;
            default: return refuse(b, "cannot be set");
        }
        at += used;
    }
    return fmi3OK;
}

#define FIXED(b) if ((b)->mode != INSTANTIATED && (b)->mode != INITIALISATION) return refuse((b), "it is fixed")
#define ONE(type, name, reference, field) \
FMI3_Export fmi3Status fmi3Get##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, type out[], size_t nOut) { \
    Ball *b = i; \
    for (size_t k = 0; k < n; k++) { if (!(reference)) return refuse(b, "unknown value reference"); out[k] = (type)(field); } \
    return n == nOut ? fmi3OK : refuse(b, "another number of values"); \
} \
FMI3_Export fmi3Status fmi3Set##name(fmi3Instance i, const fmi3ValueReference r[], size_t n, const type in[], size_t nIn)

ONE(fmi3Float32, Float32, r[k] == SMALL, b->s.small) { FIXED((Ball *)i); if (r[0] == SMALL) ((Ball *)i)->s.small = in[0]; return fmi3OK; }
ONE(fmi3Int32, Int32, r[k] == BOUNCES || r[k] == COUNT, r[k] == BOUNCES ? b->s.bounces : b->s.count) {
    Ball *b = i;
    if (r[0] != BOUNCES || (b->mode != INSTANTIATED && b->mode != INITIALISATION)) return refuse(b, "cannot be set");
    b->s.bounces = in[0];
    return fmi3OK;
}
ONE(fmi3Boolean, Boolean, r[k] == FLAG, b->s.flag) { FIXED((Ball *)i); ((Ball *)i)->s.flag = in[0]; return fmi3OK; }
ONE(fmi3Int64, Int64, r[k] == MODE, b->s.mode) { FIXED((Ball *)i); ((Ball *)i)->s.mode = in[0]; return fmi3OK; }
ONE(fmi3UInt64, UInt64, r[k] == N || r[k] == BIG, r[k] == N ? b->s.n : b->s.big) {
    Ball *b = i;
    if (r[0] == BIG) { FIXED(b); b->s.big = in[0]; return fmi3OK; }
    if (r[0] != N || b->mode != CONFIGURATION) return refuse(b, "only in configuration mode");
    if (in[0] > SIZE) return refuse(b, "too many");
#ifndef FAULT_configuration_value
    b->s.n = in[0];
#endif
    return fmi3OK;
}
#define NONE(type, name) ONE(type, name, false, 0) { return refuse(i, "unknown value reference"); }
NONE(fmi3Int8, Int8)
NONE(fmi3UInt8, UInt8)
NONE(fmi3Int16, Int16)
NONE(fmi3UInt16, UInt16)
NONE(fmi3UInt32, UInt32)

FMI3_Export fmi3Status fmi3GetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3String out[], size_t nOut) {
    Ball *b = i;
    for (size_t k = 0; k < n; k++) {
        if (r[k] != LABEL && r[k] != TITLE) return refuse(b, "unknown value reference");
        out[k] = b->s.label;
#ifdef FAULT_null_string
        if (r[k] == TITLE) out[k] = NULL;
#endif
    }
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3String in[], size_t nIn) {
    FIXED((Ball *)i);
    for (size_t k = 0; k < n; k++) snprintf(((Ball *)i)->s.label, TEXT, "%s", in[k]);
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetBinary(fmi3Instance i, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary out[], size_t nOut) {
    Ball *b = i;
    memcpy(b->blob, &b->s.bounces, sizeof b->blob);
    for (size_t k = 0; k < n; k++) {
        sizes[k] = sizeof b->blob;
        out[k] = (fmi3Binary)b->blob;
#ifdef FAULT_null_binary
        out[k] = NULL;
#endif
    }
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetBinary(fmi3Instance i, const fmi3ValueReference r[], size_t n, const size_t s[], const fmi3Binary in[], size_t nIn) { return ((Ball *)i)->mode == INSTANTIATED ? fmi3OK : refuse(i, "cannot be set"); }
FMI3_Export fmi3Status fmi3GetClock(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Clock out[]) {
    Ball *b = i;
    for (size_t k = 0; k < n; k++) out[k] = r[k] == TICK ? b->s.tick : b->s.hit;
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetClock(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Clock in[]) {
    Ball *b = i;
#ifdef FAULT_clock_refused
    return refuse(b, "no such clock");
#endif
#ifdef FAULT_kick_refused
    for (size_t k = 0; k < n; k++) if (r[k] == KICK) return refuse(b, "no such clock");
#endif
    for (size_t k = 0; k < n; k++) if (r[k] == TICK) b->s.tick = in[k]; else if (r[k] != KICK) return refuse(b, "no input clock");
    return b->mode == EVENT ? fmi3OK : refuse(b, "only in event mode");
}

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *state) {
    Ball *b = i;
#ifdef FAULT_state_refused
    return refuse(b, "no states");
#endif
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &b->s, sizeof(State));
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState state) {
    Ball *b = i;
    State before = b->s;
    b->s = *(State *)state;
#ifdef FAULT_state_incomplete
    b->s.v = before.v;
#endif
#ifdef FAULT_state_clock
    b->s.count = before.count;
#endif
    (void)before;
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *state) {
    free(*state);
#ifndef FAULT_state_not_nulled
    *state = NULL;
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance i, fmi3FMUState state, size_t *size) {
    *size = sizeof(State);
#ifdef FAULT_serialised_empty
    *size = 0;
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance i, fmi3FMUState state, fmi3Byte out[], size_t size) { memcpy(out, state, size); return fmi3OK; }
FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance i, const fmi3Byte in[], size_t size, fmi3FMUState *state) {
#ifdef FAULT_deserialise_error
    return refuse(i, "cannot be read");
#endif
    State *s = malloc(sizeof(State));
    memcpy(s, in, size);
#ifdef FAULT_serialised_incomplete
    s->v = 0.0;
#endif
    *state = s;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance i, fmi3ValueReference r, size_t *n) { return fmi3Error; }
FMI3_Export fmi3Status fmi3GetVariableDependencies(fmi3Instance i, fmi3ValueReference r, size_t a[], fmi3ValueReference b[], size_t c[], fmi3DependencyKind d[], size_t n) { return fmi3Error; }
static double partial(fmi3ValueReference unknown, fmi3ValueReference known) {
    if (unknown == DER_X) return known == V;
#ifdef FAULT_directional_wrong
    return unknown == DER_V && known == U ? 2.0 : 0.0;
#endif
    return unknown == DER_V && known == U ? 1.0 : 0.0;
}
FMI3_Export fmi3Status fmi3GetDirectionalDerivative(fmi3Instance i, const fmi3ValueReference a[], size_t na, const fmi3ValueReference b[], size_t nb, const fmi3Float64 c[], size_t nc, fmi3Float64 d[], size_t nd) {
#ifdef FAULT_directional_refused
    return refuse(i, "no derivatives");
#endif
    for (size_t k = 0; k < na; k++) {
        d[k] = 0.0;
        for (size_t m = 0; m < nb; m++) d[k] += partial(a[k], b[m]) * c[m];
    }
    return na == nd && nb == nc ? fmi3OK : fmi3Error;
}
FMI3_Export fmi3Status fmi3GetAdjointDerivative(fmi3Instance i, const fmi3ValueReference a[], size_t na, const fmi3ValueReference b[], size_t nb, const fmi3Float64 c[], size_t nc, fmi3Float64 d[], size_t nd) {
    for (size_t m = 0; m < nb; m++) {
        d[m] = 0.0;
        for (size_t k = 0; k < na; k++) d[m] += partial(a[k], b[m]) * c[k];
#ifdef FAULT_adjoint_wrong
        d[m] *= 1.01;
#endif
    }
    return na == nc && nb == nd ? fmi3OK : fmi3Error;
}
FMI3_Export fmi3Status fmi3GetIntervalDecimal(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 out[], fmi3IntervalQualifier q[]) {
    for (size_t k = 0; k < n; k++) { out[k] = 0.1; q[k] = fmi3IntervalUnchanged; }
#ifdef FAULT_clock_interval
    out[0] = 0.2;
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetIntervalFraction(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 d[], fmi3IntervalQualifier q[]) { return fmi3Error; }
FMI3_Export fmi3Status fmi3GetShiftDecimal(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 out[]) { out[0] = 0.05; return fmi3OK; }
FMI3_Export fmi3Status fmi3GetShiftFraction(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 d[]) { return fmi3Error; }
FMI3_Export fmi3Status fmi3SetIntervalDecimal(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 in[]) {
    Ball *b = i;
    b->interval = true;
    return n == 1 && r[0] == TICK && in[0] == 0.1 ? fmi3OK : refuse(b, "no such interval");
}
FMI3_Export fmi3Status fmi3SetIntervalFraction(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 d[]) { return fmi3Error; }
FMI3_Export fmi3Status fmi3SetShiftDecimal(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 in[]) { return fmi3Error; }
FMI3_Export fmi3Status fmi3SetShiftFraction(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 d[]) { return fmi3Error; }
FMI3_Export fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance i) { return fmi3OK; }
#ifndef FAULT_missing_function
FMI3_Export fmi3Status fmi3GetOutputDerivatives(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Int32 o[], fmi3Float64 out[], size_t nOut) {
    State *s = &((Ball *)i)->s;
    for (size_t k = 0; k < n; k++) {
#ifdef FAULT_slope_refused
        return refuse(i, "no derivatives");
#endif
        if (o[k] != 1 || (r[k] != X && r[k] != V)) return refuse(i, "only the first derivative of x and v");
        out[k] = r[k] == X ? s->v : acceleration(s);
#ifdef FAULT_slope_zero
        out[k] = 0.0;
#endif
    }
    return fmi3OK;
}
#endif
