/* The clock of a sampled slave; a part of fmi3_slave.h.
 *
 * In event mode the host ticks it. A tick takes the sample: outputs that are read in that instant follow inputs that are
 * set in it, and the end of the instant moves the hidden state on towards the next tick. Without event mode the slave
 * samples by itself, as in FMI 2.0. The interval is the value of `sample_time`. */
#ifndef FMI3_CLOCK_H
#define FMI3_CLOCK_H

#include "fmi3_modes.h"

#ifdef SAMPLE_TIME
#define CLOCK (VARIABLES + 1) /* value reference */
#define INTERVAL(s) ((s)->slave.real[SAMPLE_TIME])

static double told_interval(const Instance *s)
{
    return s->host.interval > 0.0 ? s->host.interval : variables[SAMPLE_TIME].start;
}

/* Tell whether a time is half an interval after the next tick, or more; before it, with a negative sign. */
static bool misses_tick(Instance *s, double time, double sign)
{
    const double due = s->course.start_time + (double)s->course.samples * INTERVAL(s);
    if (!s->host.events || !(sign * (time - due) > 0.5 * INTERVAL(s)))
        return false;
    say(s, ERROR, "the clock `sample` must tick at %r, but %s %r", due, sign > 0.0 ? "a step goes on to" : "ticks at", time);
    return true;
}

/* Refuse to leave initialisation with a `sample_time` that is not the clock's interval. */
static bool agrees_with_clock(Instance *s)
{
    if (s->host.events && s->course.phase == INITIALIZING && INTERVAL(s) != told_interval(s))
        say(s, ERROR, "`sample_time` must be the interval of the clock `sample`, %r s, but is %r s", told_interval(s),
            INTERVAL(s));
    return s->worst == OK;
}

/* Time counts from the first tick. */
static void await_first_tick(Instance *s)
{
    if (s->host.events) {
        s->course.start_time += s->host.shift;
        s->course.at_sample = 0;
    }
}

/* Tell whether inputs may be set: in event mode while the clock ticks. */
static bool may_set_clocked(Instance *s, const Reference r[], size_t n)
{
    char text[64];
    if (!s->host.events || s->course.phase != STEPPING || s->course.at_sample)
        return true;
    for (size_t k = 0; k < n; k++)
        if (r[k] < VARIABLES && variables[r[k]].causality == INPUT) {
            say(s, ERROR, "%s must set %s while its clock ticks", s->function, name_of(r[k], text));
            return false;
        }
    return true;
}

/* End an instant in which the clock ticks. */
static void end_tick(Instance *s)
{
    NEW_FAULT(fault);
    if (!s->course.at_sample)
        return;
    recompute(s, &fault);
    if (!fault.kind)
        slave_predict(&s->slave, &fault);
    concluded(s, &fault);
    s->course.samples++;
    s->course.at_sample = 0;
}

static bool are_clocks(Instance *s, const Reference r[], size_t n)
{
    for (size_t k = 0; k < n; k++)
        if (r[k] != CLOCK)
            refuse_type(s, r[k]);
    return s->worst == OK;
}

EXPORT Status FMI(fmi3GetClock)(Component c, const Reference r[], size_t n, bool v[])
{
    ENTER(fmi3GetClock, n == 0 || (r && v))
    if (are_clocks(s, r, n) && in_mode(s, true))
        for (size_t k = 0; k < n; k++)
            v[k] = s->course.at_sample;
    return s->worst;
}

EXPORT Status FMI(fmi3SetClock)(Component c, const Reference r[], size_t n, const bool v[])
{
    ENTER(fmi3SetClock, n == 0 || (r && v))
    if (!are_clocks(s, r, n) || !in_mode(s, true))
        return s->worst;
    for (size_t k = 0; k < n; k++) {
        if (!v[k] && s->course.at_sample)
            say(s, ERROR, "%s must not deactivate the clock `sample`", s->function);
        else if (v[k] && !s->course.at_sample && !misses_tick(s, s->course.time, -1.0))
            s->course.at_sample = 1, s->fresh = false;
    }
    return s->worst;
}

/* Tell whether a call for the times of clocks is in its place. */
static bool asks_clocks(Instance *s, const Reference r[], size_t n)
{
    return are_clocks(s, r, n) && expects(s, INITIALIZING);
}

EXPORT Status FMI(fmi3GetIntervalDecimal)(Component c, const Reference r[], size_t n, double v[], IntervalQualifier q[])
{
    ENTER(fmi3GetIntervalDecimal, n == 0 || (r && v && q))
    if (are_clocks(s, r, n))
        for (size_t k = 0; k < n; k++) {
            v[k] = INTERVAL(s);
            q[k] = UNCHANGED;
        }
    return s->worst;
}

EXPORT Status FMI(fmi3GetShiftDecimal)(Component c, const Reference r[], size_t n, double v[])
{
    ENTER(fmi3GetShiftDecimal, n == 0 || (r && v))
    if (are_clocks(s, r, n))
        for (size_t k = 0; k < n; k++)
            v[k] = s->host.shift;
    return s->worst;
}

EXPORT Status FMI(fmi3SetIntervalDecimal)(Component c, const Reference r[], size_t n, const double v[])
{
    ENTER(fmi3SetIntervalDecimal, n == 0 || (r && v))
    if (!asks_clocks(s, r, n))
        return s->worst;
    for (size_t k = 0; k < n && s->worst == OK; k++) {
        if (INTERVAL(s) != told_interval(s) && INTERVAL(s) != v[k]) {
            say(s, ERROR, "the interval of the clock `sample` must be `sample_time` where that is set, %r s, but is %r s",
                INTERVAL(s), v[k]);
            return s->worst;
        }
        set_real(s, SAMPLE_TIME, v[k]);
        if (s->worst == OK)
            s->host.interval = v[k];
        s->fresh = false;
    }
    return s->worst;
}

EXPORT Status FMI(fmi3SetShiftDecimal)(Component c, const Reference r[], size_t n, const double v[])
{
    ENTER(fmi3SetShiftDecimal, n == 0 || (r && v))
    if (!asks_clocks(s, r, n))
        return s->worst;
    for (size_t k = 0; k < n; k++)
        if (0.0 <= v[k] && v[k] <= LARGEST_REAL)
            s->host.shift = v[k];
        else
            say(s, ERROR, "the shift of the clock `sample` must be finite and not negative, but is %r s", v[k]);
    return s->worst;
}
#else /* a slave without a clock */
#define misses_tick(s, time, sign) false
#define agrees_with_clock(s) true
#define await_first_tick(s) ((void)0)
#define may_set_clocked(s, r, n) true
#define end_tick(s) ((void)0)
#endif

#endif
