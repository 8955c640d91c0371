/* Event mode, continuous time, steps and model partitions of ball3.c. */

static void partition(Ball *b) {
    b->s.count++;
    b->s.old = b->s.smooth;
    b->s.smooth = 0.5 * b->s.smooth + 0.5 * b->s.x;
}

static void bounce(State *s) {
    s->x = 0.0;
    s->v *= -s->e;
    s->bounces++;
    s->echo = s->steps;
}

FMI3_Export fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
    fmi3Boolean *states, fmi3Boolean *defined, fmi3Float64 *next) {
    Ball *b = i;
    State *s = &b->s;
    if (b->mode != EVENT) return refuse(b, "only in event mode");
    *again = *terminate = *nominals = *states = *defined = false;
    *next = 0.0;
#ifdef FAULT_event_endless
    *again = true;
#endif
#ifdef FAULT_event_past
    *defined = true;
    *next = s->time - 1.0;
#endif
#ifdef FAULT_event_nan
    *defined = true;
    *next = NAN;
#endif
#ifdef FAULT_clock_always
    partition(b);
#else
    if (s->tick) partition(b);
#endif
    s->tick = false;
#ifndef FAULT_clock_stays
    s->hit = false;
#endif
    if (s->x <= 1e-9 && s->v < 0.0) {
        bounce(s);
        s->hit = true;
        *states = true;
#ifndef FAULT_clock_stays
        *again = true;  /* the clock ticks in the next instant */
#endif
    }
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3CompletedIntegratorStep(fmi3Instance i, fmi3Boolean prior, fmi3Boolean *event, fmi3Boolean *terminate) {
    *event = *terminate = false;
    ((Ball *)i)->s.steps++;
#ifdef FAULT_completed_error
    return refuse(i, "step not accepted");
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetTime(fmi3Instance i, fmi3Float64 t) { ((Ball *)i)->s.time = t; return fmi3OK; }
FMI3_Export fmi3Status fmi3SetContinuousStates(fmi3Instance i, const fmi3Float64 x[], size_t n) {
    Ball *b = i;
    if (n != 2) return refuse(b, "two states");
    b->s.x = x[0];
    b->s.v = x[1];
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance i, fmi3Float64 out[], size_t n) {
    Ball *b = i;
    out[0] = b->s.v;
    out[1] = acceleration(&b->s);
#ifdef FAULT_discard_below
    if (b->s.x < -1e-3) return fmi3Discard;
#endif
#ifdef FAULT_derivative_error
    if (b->s.steps == 5) return refuse(b, "no derivative");
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetEventIndicators(fmi3Instance i, fmi3Float64 out[], size_t n) {
    Ball *b = i;
    out[0] = b->s.x == 0.0 && b->s.v > 0.0 ? 1e-12 : b->s.x;
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetContinuousStates(fmi3Instance i, fmi3Float64 out[], size_t n) {
    out[0] = ((Ball *)i)->s.x;
    out[1] = ((Ball *)i)->s.v;
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance i, fmi3Float64 out[], size_t n) {
    out[0] = out[1] = 1.0;
#ifdef FAULT_nominal_zero
    out[1] = 0.0;
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance i, size_t *n) {
    *n = 1;
#ifdef FAULT_indicators_count
    *n = 2;
#endif
    return fmi3OK;
}
FMI3_Export fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance i, size_t *n) {
    *n = 2;
#ifdef FAULT_states_count
    *n = 3;
#endif
    return fmi3OK;
}

/* Seconds to the next contact, at most `h`; `hit` says whether there is one. */
static double free_flight(const State *s, double h, bool *hit) {
    double a = acceleration(s), root = s->v * s->v - 2.0 * a * s->x;
    *hit = false;
    if (a >= 0.0 || root < 0.0) return h;
    double t = (-s->v - sqrt(root)) / a;
    if (t > h || t <= 1e-12) return h;
    *hit = true;
    return t;
}

static void move(State *s, double h) {
    double a = acceleration(s);
    s->x += s->v * h + 0.5 * a * h * h;
    s->v += a * h;
    s->time += h;
#ifdef FAULT_slow_physics
    s->x += 0.3 * h;
#endif
}

/* Announce that the time `t` has been reached; whether the importer wants to return. */
static bool announce(Ball *b, double t, bool more) {
    bool early = false, finished = false;
    double when = t;
    if (!b->update) return false;
#ifdef FAULT_update_missing
    return false;
#endif
#ifdef FAULT_update_backwards
    finished = true;
    if (!more) t -= 0.9 * 0.02;
#endif
#ifdef FAULT_update_beyond
    t += 5.0;
#endif
    b->updating = 1;
    b->update(b->environment, t, true, true, finished, more, &early, &when);
    b->updating = 0;
#ifdef FAULT_update_no_return
    return false;
#endif
    return early && more;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 t, fmi3Float64 h, fmi3Boolean noSetState, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Ball *b = i;
    State *s = &b->s;
    *event = *terminate = *early = false;
    AT(step);
#ifndef FAULT_step_before_init
    if (b->mode != STEP) return refuse(b, "not initialised");
#endif
#ifndef FAULT_negative_step
    if (!(h > 0.0)) return refuse(b, "a step must be positive");
#endif
    s->steps++;
    s->time = t;
#ifdef FAULT_error_step
    if (s->steps == 5) return refuse(b, "solver failed");
#endif
#ifdef FAULT_discard_step
    if (s->steps == 5) { s->steps--; return fmi3Discard; }
#endif
#ifdef FAULT_discard_first
    return fmi3Discard;
#endif
#ifdef FAULT_discard_long
    if (h > 0.012) { s->steps--; return fmi3Discard; }
#endif
#ifdef FAULT_fatal_step
    if (s->steps == 5) return fmi3Fatal;
#endif
#ifdef FAULT_illegal_status
    if (s->steps == 5) return (fmi3Status)5;
#endif
#ifdef FAULT_crash_step
    if (s->steps == 5) raise(11);
#endif
#ifdef FAULT_exit_step
    if (s->steps == 5) exit(0);
#endif
#ifdef FAULT_hang_step
    if (s->steps == 5) for (;;) usleep(10000);
#endif
#ifdef FAULT_eat_memory
    if (s->steps >= 5) for (;;) memset(malloc(1 << 22), 1, 1 << 22);
#endif
#ifdef FAULT_step_leak
    memset(malloc(1 << 16), 1, 1 << 16);
#endif
#ifdef FAULT_shared
    if (latest && latest != b && alive > 1) s->hidden += 0.1;
    latest = b;
#endif
#ifdef FAULT_write_file
    if (s->steps == 5) { FILE *f = fopen("result.txt", "w"); if (f) { fputs("x", f); fclose(f); } }
#endif
#ifdef FAULT_write_resources
    if (s->steps == 5) { char p[600]; snprintf(p, sizeof p, "%sreadme.txt", b->resources); FILE *f = fopen(p, "a"); if (f) { fputs("x", f); fclose(f); } }
#endif
#ifdef FAULT_chatter
    for (int k = 0; k < 400; k++) { char line[4096]; memset(line, 'x', sizeof line); fwrite(line, 1, sizeof line, stdout); }
    fflush(stdout);
#endif
    double asked = t + h;
#ifdef FAULT_ignores_step
    h = 0.02;
#endif
#ifdef FAULT_no_progress
    if (s->steps > 5) { *early = true; *last = t; return fmi3OK; }
#endif
#ifdef FAULT_last_time
    *last = t + 2.0 * h;
    if (s->steps == 5) return fmi3OK;
#endif
#if defined(FAULT_early_unflagged) || defined(FAULT_early_always)
    if (s->steps == 5) { move(s, 0.5 * h); *early = true; *last = t + 0.5 * h; return fmi3OK; }
#endif
#ifdef FAULT_event_not_used
    if (s->steps == 5 && !b->events) *event = true;
#endif
#ifdef FAULT_event_without_cause
    if (b->events && s->bounces > 0 && s->steps == s->echo + 1) *event = true;
#endif
#ifdef FAULT_event_silent
    if (s->steps == 5 && b->events) *event = true;  /* no fault: what an event changes may be hidden */
#endif
    double end = t + h;
    if (b->update) {
        bool hit;
        double first = free_flight(s, 0.5 * h, &hit);
        if (!hit) {
            move(s, first);
#ifdef FAULT_update_trial
            announce(b, end, false);  /* no fault: a trial step to the end, which is not accepted */
#endif
            if (announce(b, s->time, true)) { *early = true; *last = s->time; return fmi3OK; }
        }
    }
    for (int k = 0; k < 100 && s->time < end - 1e-12; k++) {
        bool hit;
        double flight = free_flight(s, end - s->time, &hit);
        move(s, flight);
        if (!hit) break;
        s->x = 0.0;
        if (b->events) {
            *event = true;
            if (!b->early) {  /* the event waits for the end of the step */
                s->time = end;
                break;
            }
            *early = s->time < end - 1e-12;
            *last = s->time;
            return fmi3OK;
        }
        bounce(s);
    }
    s->time = asked;
    *last = asked;
    if (b->update) announce(b, asked, false);
#ifdef FAULT_last_time
    *last = t + 2.0 * h;
#endif
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3ActivateModelPartition(fmi3Instance i, fmi3ValueReference clock, fmi3Float64 t) {
    Ball *b = i;
    AT(step);
    if (clock != TICK || b->mode != ACTIVATION) return refuse(b, "no such partition");
    b->s.steps++;
#ifdef FAULT_partition_error
    return refuse(b, "overrun");
#endif
    b->lock();
    b->s.time = t;
    partition(b);
#ifndef FAULT_lock_kept
    b->unlock();
#endif
    return fmi3OK;
}
