/* What plant2.c and plant3.c share: a mass on a spring with a wall, a switch and inputs and parameters of every type.
 *
 *     dx/dt = v,   dv/dt = u + w x - k x - d v - v^3 / 10 + forces of switches and whole numbers,   dq/dt = u
 *
 * It is correct, or has the one fault that the macro FAULT names. */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef FAULT
#define FAULT ""
#endif
#define IS(name) (!strcmp(FAULT, #name))
#define WALL (IS(event_silent) || IS(near_wall) ? -0.15 : -0.2)
enum { U = 1, W, K, D, C, X, V, DX, DV, Y, Z, TIME, Q, E, DQ, P, YS, R, I = 20, M, J, O, G, B = 30, ON, SW, L = 40, T, BLOB = 50, N, TICK = 60, CC, CU, Z0 = 70, Z1, Z2 };
enum { INSTANTIATED, CONFIGURATION, INITIALISATION, EVENT, CONTINUOUS, STEP, TERMINATED };
enum { SIZE = 8 };

typedef struct {
    double u, w, k, d, x, v, q, time, start, lead, slope, p[SIZE], old[4];
    int i, m, j, o, b, on, sw, n, cc, steps;
    char label[64];
    double cu;
    const char *owner;
} State;

typedef struct {
    State s;
    int phase, exchange, logging, events, held, tick, before;
    double shown[2], dead, dead_w, param, tuned, last[3], early_k;
    int dead_b;
    char text[64];
    void *environment, *log;
} Plant;

static State initial(void) {
    State s = {.k = 4.0, .d = 0.5, .x = 0.3, .i = 2, .m = 2, .b = 1, .n = 3, .p = {1.0, 2.0, 3.0}, .label = "plant"};
    return s;
}

static double common;

static double force(const Plant *self, const State *s, double x, double v) {
    double k = IS(dead_parameter) ? 4.0 : IS(shared_value) && common != 0.0 ? common : s->k, d = IS(interfaces) && !self->exchange ? 3.0 * s->d : s->d, w = IS(dead_input) ? 0.0 : s->w;
    double more = IS(rate_of_integral) && s->q > 0.02 ? s->q : IS(rates_by_steps) ? 0.01 * s->steps : 0.0;
    if (IS(derived_early)) k = self->early_k;
    return more + s->u + w * x - k * x - d * v - 0.1 * v * v * v + 0.2 * s->sw + 0.1 * s->j + 0.3 * s->on + 0.05 * s->i
        + 0.02 * s->m - (s->b ? 0.0 : 0.4);
}

static double sum(const State *s) {
    double total = 0.0;
    for (int a = 0; a < s->n; a++) total += (a + 1) * s->p[a];
    return total;
}

static void indicators(const Plant *self, double out[]);

/* A real number by its value reference; false: there is none. */
static bool number(Plant *self, unsigned r, double *out) {
    const State *s = &self->s;
    switch (r) {
        case U: *out = IS(input_lags) && self->phase == STEP ? s->old[0] : s->u; return true;
        case W: *out = s->w; return true;
        case K: *out = s->k; return true;
        case D: *out = s->d; return true;
        case C: *out = IS(calculated_default) ? 16.0 : s->k * s->k; return true;
        case E: *out = IS(calculated_late) && s->start > 0.0 ? 2.0 * self->tuned : 2.0 * s->d; return true;
        case X: *out = s->x; return true;
        case V: *out = IS(restored_local) && self->phase == STEP ? self->dead_w : IS(state_variable_stale) && self->phase == CONTINUOUS ? 0.0 : s->v; return true;
        case Q: *out = s->q; return true;
        case DX: *out = s->v; return true;
        case DV: *out = IS(rate_named) ? s->v : force(self, s, s->x, s->v); return true;
        case DQ: *out = s->u; return true;
        case Y:
            *out = s->x + 0.3 * s->u * s->u;
            if (IS(feeds_at_times) && s->u > 0.05) *out += 0.4 * s->w;
            if (IS(feeds_switched) && s->on) *out += 0.4 * s->w;
            if (IS(feeds_unswitched) && !s->on) *out += 0.4 * s->w;
            if (IS(output_cached) && self->phase == CONTINUOUS) *out = self->shown[1];
            if (IS(output_stale) && self->phase == INITIALISATION) {
                if (!self->held) self->shown[0] = *out;
                self->held = 1;
                *out = self->shown[0];
            }
            if (IS(restored_output) && self->phase == STEP) *out = self->shown[1];
            return true;
        case Z: *out = IS(restored_other) && self->phase == STEP ? self->shown[0] : s->v * s->x + (IS(hidden_feed) ? 0.2 * s->w : 0.0); return true;
        case YS: *out = s->x * sum(s); return true;
        case TIME: *out = IS(start_ignored) ? s->time - s->start : IS(start_zero) && self->phase < STEP ? 0.0 : s->time + (IS(time_runs) ? s->lead : 0.0); return true;
        case R: *out = 9.81; return true;
        case CU: *out = s->cu; return true;
        case Z0: case Z1: case Z2: {
            double signs[3];
            indicators(self, signs);
            *out = signs[r - Z0];
            return true;
        }
        default: return false;
    }
}

/* Where a number that can be set is kept; NULL: it cannot be set now. */
static double *place(Plant *self, unsigned r) {
    State *s = &self->s;
    bool early = self->phase == INSTANTIATED || self->phase == INITIALISATION;
    switch (r) {
        case U: return &s->u;
        case W: return &s->w;
        case D: return IS(tunable_refused) && !early ? NULL : &s->d;
        case K: return early || IS(fixed_accepted) ? &s->k : NULL;
        case X: return early ? &s->x : NULL;
        case V: return early ? &s->v : NULL;
        case Q: return early ? &s->q : NULL;
        default: return NULL;
    }
}

static bool put(Plant *self, unsigned r, double value) {
    double *where = place(self, r);
    static double nowhere;
    if (IS(constant_accepted) && r == R) where = &nowhere;
    if (!where || !isfinite(value)) return false;
    if (IS(drop_parameter) && r == K) return true;
    if (IS(drop_start) && r == X) return true;
    if (IS(drop_input) && r == W) return true;
    if (IS(tunable_ignored) && r == D && self->phase == STEP) return true;
    if (IS(tunable_late) && r == D && self->s.steps > 30) return true;
    if (IS(early_only) && r == K && self->phase == INITIALISATION) return true;
    if (r == K && self->phase == INSTANTIATED) self->early_k = value;
    if (IS(rounded) && r == K) value = floor(value);
    if (IS(single) && r == K) value = (float)value;
    if (IS(saturated) && r == U) value = fmax(-1.0, fmin(1.0, value));
    if (IS(late_only) && r == K && self->phase == INSTANTIATED) return true;
    if (IS(once_set) && r == U && self->s.u != 0.0) return true;
    if (IS(shared_value) && r == K) common = value;
    if (IS(next_to) && r == W) self->s.u = value;
    if (IS(negated) && r == V) value = -value;
    *where = value;
    return true;
}

static bool put_whole(Plant *self, unsigned r, int value) {
    State *s = &self->s;
    bool early = self->phase == INSTANTIATED || self->phase == INITIALISATION;
    if (r == J && !(IS(drop_whole_input) && self->phase == STEP)) s->j = value;
    else if (r == J) return true;
    else if (!early && !IS(fixed_whole_accepted)) return false;
    else if (r == I) s->i = IS(drop_whole) ? s->i : IS(clipped) && value > 2 ? 2 : IS(clipped_far) && value > 5 ? 5 : value;
    else if (r == M) s->m = IS(drop_item) ? s->m : value;
    else return false;
    return true;
}

static bool put_truth(Plant *self, unsigned r, int value) {
    bool early = self->phase == INSTANTIATED || self->phase == INITIALISATION;
    if (r == ON) self->s.on = IS(drop_truth_input) ? self->s.on : IS(truth_sticks) ? self->s.on || value : value;
    else if (r == B && (early || IS(fixed_truth_accepted))) self->s.b = IS(drop_truth) ? self->s.b : value;
    else return false;
    return true;
}

static bool whole(Plant *self, unsigned r, int *out) {
    State *s = &self->s;
    int item = s->x > 0.1 ? 1 : s->x > -0.1 ? 2 : 3;
    switch (r) {
        case I: *out = s->i; return true;
        case M: *out = IS(item_of_parameter) && self->phase == STEP ? 0 : s->m; return true;
        case J: *out = s->j; return true;
        case O: *out = s->o + 2 * s->j; return true;
        case G:
            *out = IS(item_zero) ? item - 1 : IS(item_beyond) && item == 3 ? 7 : IS(item_start) && self->phase < STEP ? 0
                : IS(item_negative) && s->steps > 30 ? -1 : IS(item_switch) && s->sw ? 4 : item;
            return true;
        case CC: *out = s->cc; return true;
        default: return false;
    }
}

static bool truth(Plant *self, unsigned r, int *out) {
    State *s = &self->s;
    switch (r) {
        case B: *out = IS(truth_of_parameter) ? -1 : s->b; return true;
        case ON: *out = s->on; return true;
        case SW:
            *out = IS(truth_minus) ? -s->sw : IS(truth_seven) ? 7 * s->sw : IS(truth_bits) ? 2 + s->sw : IS(truth_later) && s->steps > 40 ? 5 : s->sw;
            if (IS(restored_switch) && self->phase == STEP) *out = self->dead_b;
            return true;
        default: return false;
    }
}

static void discrete(Plant *self) {
    State *s = &self->s;
    if (s->x <= WALL + 1e-9 && s->v < 0.0) { s->x = WALL; s->v *= -0.7; }
    int count = !(IS(count_in_steps) && self->exchange);
    if (!s->sw && s->x < -0.1) { s->sw = 1; s->o += count; }
    if (s->sw && s->x > 0.35) { s->sw = 0; s->o += count; }
}

static void show(Plant *self) {
    State *s = &self->s;
    s->old[0] = s->u;
    self->shown[0] = s->v * s->x;
    self->shown[1] = s->x + 0.3 * s->u * s->u;
    self->dead_b = s->sw;
    self->dead_w = s->v;
}

static void integrate(Plant *self, double duration) {
    State *s = &self->s;
    int n = (int)ceil(duration / 2e-3 - 1e-9);
    double h = duration / (n < 1 ? 1 : n);
    for (int a = 0; a < n; a++) {
        double x = s->x, v = s->v;
        double a1 = force(self, s, x, v), v2 = v + 0.5 * h * a1, a2 = force(self, s, x + 0.5 * h * v, v2);
        double v3 = v + 0.5 * h * a2, a3 = force(self, s, x + 0.5 * h * v2, v3), v4 = v + h * a3, a4 = force(self, s, x + h * v3, v4);
        s->x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
        s->v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
        s->q += h * (s->u + s->slope * h * (a + 0.5));
        discrete(self);
    }
}

/* One communication step, or steps of a clock of its own. */
static void go(Plant *self, double t, double h) {
    State *s = &self->s;
    double own = IS(own_step) || IS(own_drift) || IS(own_round) || IS(own_behind) ? 0.01 : IS(own_coarse) ? 0.03 : IS(own_fine) ? 0.004
        : IS(own_sampled) ? 0.012 : IS(own_slow) ? 0.05 : 0.0;
    if (own > 0.0) {
        double inside = s->time + s->lead, end = t + h;
        long steps = IS(own_drift) ? (long)ceil(h / own - 1e-9) : IS(own_round) ? lround(h / own)
            : IS(own_behind) ? (long)floor((end - inside) / own + 1e-9) : (long)ceil((end - inside) / own - 1e-9);
        for (long a = 0; a < steps; a++) integrate(self, own);
        s->lead = inside + steps * own - end;
    } else {
        integrate(self, h);
        if (IS(time_runs)) s->lead += 0.1 * h;
    }
    s->time = t + h;
    s->slope = 0.0;
    s->steps++;
    show(self);
}

static void begin(Plant *self) {
    self->s = initial();
    self->phase = INSTANTIATED;
    self->held = 0;
    self->tuned = self->s.d;
    self->early_k = self->s.k;
    self->s.owner = self->text;
}

static void reset(Plant *self) {
    State old = self->s;
    if (IS(reset_once) && self->before++) { self->phase = INSTANTIATED; self->s.time = 0.0; return; }
    begin(self);
    State *s = &self->s;
    if (IS(reset_leaks)) { volatile char *lost = malloc(2 << 20); for (int a = 0; a < 2 << 20; a += 512) lost[a] = 1; }
    if (IS(keep_parameter)) s->k = old.k;
    if (IS(keep_tunable)) s->d = old.d;
    if (IS(keep_text)) memcpy(s->label, old.label, sizeof s->label);
    if (IS(keep_whole)) s->i = old.i;
    if (IS(keep_whole_input)) s->j = old.j;
    if (IS(keep_item)) s->m = old.m;
    if (IS(keep_truth)) s->b = old.b;
    if (IS(keep_truth_input)) s->on = old.on;
    if (IS(keep_input)) s->u = old.u;
    if (IS(keep_second_input)) s->w = old.w;
    if (IS(keep_integrator)) s->q = old.q;
    if (IS(keep_switch)) s->sw = old.sw;
    if (IS(keep_count)) s->o = old.o;
    if (IS(keep_array)) memcpy(s->p + 1, old.p + 1, sizeof s->p - sizeof *s->p);
    if (IS(keep_size)) s->n = old.n;
    if (IS(keep_ticks)) s->cc = old.cc;
    if (IS(keep_speed)) s->v = 0.5 * old.v;
    if (IS(keep_when_switched) && old.sw) s->k = old.k;
    if (IS(keep_start)) s->x = old.steps ? 0.9 * s->x + 0.1 * old.x : s->x;
}

static void leave_initialisation(Plant *self) {
    if (IS(start_lost)) self->s.x = 0.3;
    if (IS(parameter_lost)) self->s.k = 4.0;
    if (IS(inputs_cleared)) self->s.u = 0.0;
    if (IS(start_blended)) self->s.x = 0.5 * (self->s.x + 0.3);
    self->tuned = self->s.d;
    self->s.start = self->s.time + 1e-300;
    show(self);
}

static void restore(Plant *self, const State *saved) {
    State now = self->s;
    self->s = *saved;
    State *s = &self->s;
    if (IS(lose_input)) s->u = now.u;
    if (IS(clear_inputs)) s->u = s->w = 0.0;
    if (IS(lose_speed)) s->v = now.v;
    if (IS(add_count)) s->o = now.o + 1;
    if (IS(start_anew) && s->steps == 0) { double u = s->u; *s = initial(); s->u = u; }
    if (IS(lose_tunable)) s->d = now.d;
    if (IS(lose_text)) memcpy(s->label, now.label, sizeof s->label);
    if (IS(lose_whole_input)) s->j = now.j;
    if (IS(lose_truth_input)) s->on = now.on;
    if (IS(lose_switch)) s->sw = now.sw;
    if (IS(lose_count)) s->o = now.o;
    if (IS(lose_integrator)) s->q = now.q;
    if (IS(lose_time)) s->time = now.time;
    if (IS(lose_ticks)) s->cc = now.cc;
    if (IS(lose_array)) memcpy(s->p, now.p, sizeof s->p);
    if (!IS(restored_local) && !IS(restored_output) && !IS(restored_other) && !IS(restored_switch)) show(self);
}

static void lose_in_bytes(State *s) {
    if (IS(bytes_input)) s->w = 0.0;
    if (IS(bytes_text)) strcpy(s->label, "plant");
    if (IS(bytes_whole)) s->j = 0;
    if (IS(bytes_parameter)) s->k = 4.0;
    if (IS(bytes_pointer) && s->owner[0] == 'p') s->k = 4.0;
}

static double partial(Plant *self, unsigned a, unsigned b) {
    const State *s = &self->s;
    double x = IS(at_start) ? 0.3 : s->x, v = IS(at_rest) ? 0.0 : s->v, u = IS(without_feed) ? 0.0 : s->u;
    if (a == DX) return b == V;
    if (a == DQ) return b == U;
    if (a == Y) return b == X ? 1.0 : b == U ? (IS(feed_sign) ? -0.6 : 0.6) * u : 0.0;
    if (a == Z) return b == V ? (IS(wrong_output) ? 1.0 : x) : b == X ? v : 0.0;
    if (a == YS) return b == X ? sum(s) : 0.0;
    if (a != DV) return 0.0;
    if (b == X) return IS(state_sign) ? s->k - s->w : IS(without_state) ? 0.0 : (IS(without_product) ? 0.0 : s->w) - s->k;
    if (b == V) return -s->d - (IS(linearised) ? 0.0 : 0.3 * v * v);
    return b == U ? 1.0 : b == W ? x : 0.0;
}

static bool sensitivity(Plant *self, const unsigned unknowns[], size_t nu, const unsigned knowns[], size_t nk, const double seed[], double out[], bool adjoint) {
    static const unsigned first[] = {X};
    if (IS(asked_alone) && (adjoint ? nk : nu) == 1) { if (adjoint) knowns = first; else unknowns = first; }
    for (size_t a = 0; a < (adjoint ? nk : nu); a++) {
        out[a] = 0.0;
        for (size_t b = 0; b < (adjoint ? nu : nk); b++) {
            double scale = IS(seed_ignored) ? (seed[b] != 0.0) : IS(second_seed) && b > 0 && seed[0] != 0.0 ? 0.0 : seed[b];
            out[a] += scale * (adjoint ? partial(self, unknowns[b], knowns[a]) : partial(self, unknowns[a], knowns[b]));
        }
        if (IS(adjoint_state) && adjoint && knowns[a] == X) out[a] *= 1.5;
    }
    return true;
}

/* Continuous time. */
static void states(Plant *self, double out[]) {
    bool swap = IS(states_order);
    out[swap] = self->s.x; out[!swap] = self->s.v; out[2] = self->s.q;
}
static void set_states(Plant *self, const double in[]) {
    bool swap = IS(states_order) || IS(states_order_in);
    if (IS(small_ignored) && fabs(self->s.v - in[1]) < 0.05) { self->s.x = in[0]; self->s.q = in[2]; return; }
    self->s.x = in[swap]; self->s.v = in[!swap];
    if (!IS(state_not_set)) self->s.q = in[2];
}
static void rates(Plant *self, double out[]) {
    if (IS(output_cached)) show(self);
    if (IS(rates_late)) {
        double now[3] = {self->s.v, force(self, &self->s, self->s.x, self->s.v), self->s.u};
        memcpy(out, self->last, sizeof now); memcpy(self->last, now, sizeof now);
        return;
    }
    bool swap = IS(rates_order);
    out[swap] = self->s.v; out[!swap] = force(self, &self->s, self->s.x, self->s.v); out[2] = IS(rate_wrong) ? 2.0 * self->s.u : self->s.u;
}
static void nominals(double out[]) {
    bool swap = IS(nominals_order);
    out[swap] = IS(nominals_others) ? 50.0 : 1.0; out[!swap] = 2.0; out[2] = 1.0;
}
static void indicators(const Plant *self, double out[]) {
    const State *s = &self->s;
    out[0] = s->x <= WALL + 1e-12 && s->v >= 0.0 ? 1e-12 : s->x - WALL;
    out[1] = s->x + 0.1;
    out[2] = s->x - 0.35;
}
static void complete(Plant *self) {
    State *s = &self->s;
    s->steps++;
    if (IS(quiet_count) && s->steps % 7 == 0) s->o++;
    if (IS(quiet_jump) && s->steps % 7 == 0) s->q += 0.01;
}
/* Whether states have changed, as the FMU says. */
static bool event(Plant *self) {
    State *s = &self->s, old = *s;
    if (self->tick) { s->cc++; s->cu = s->u; }
    self->tick = 0;
    if (self->exchange) discrete(self);
    if (IS(event_jump) && old.sw != s->sw) s->q += 0.1;
    return !IS(event_silent) && !IS(event_jump) && (old.x != s->x || old.v != s->v);
}
