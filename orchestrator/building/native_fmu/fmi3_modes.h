/* What all parts of fmi3_slave.h stand on: how a message goes to the host, modes, values of now, a piece of a step. */
#ifndef FMI3_MODES_H
#define FMI3_MODES_H

#include "fmi3_types.h"
#include "slave_core.h"
#ifdef CONTINUOUS_STATES
#include "slave_exchange.h"
#endif

static void deliver(const Instance *s, Status status, const char *category, const char *text)
{
    if (s->host.log)
        s->host.log(s->host.environment, status, category, text);
}

/* Tell whether an instance is in event mode, or in step or continuous-time mode; say so if it is not. */
static bool in_mode(Instance *s, bool event_mode)
{
    if (s->course.phase != STEPPING)
        say(s, ERROR, "%s must not be called %s", s->function, mode_name(s));
    else if (!s->course.in_event_mode == event_mode)
        say(s, ERROR, "%s must %sbe called in event mode", s->function, event_mode ? "" : "not ");
    return s->worst == OK;
}

static bool is_type(Instance *s, Type type)
{
    if (s->course.type != (int32_t)type)
        say(s, ERROR, "%s must not be called in %s", s->function, type == CO_SIMULATION ? "model exchange" : "co-simulation");
    return s->worst == OK;
}

static bool bring_up_to_date(Instance *s)
{
    NEW_FAULT(fault);
    recompute(s, &fault);
    concluded(s, &fault);
    return !fault.kind;
}

#ifdef CONTINUOUS_STATES
static bool takes_events(const Instance *s) { return s->host.events && s->host.early_return; }
#endif

/* Advance over a piece of a step, or to the first event in it where the host takes events; return how far. */
static double advance_piece(Instance *s, double time, double step, Fault *fault)
{
#ifdef CONTINUOUS_STATES
    if (takes_events(s)) {
        const double taken = slave_advance_to_event(&s->slave, time, step, fault);
        s->course.event_due = !fault->kind && HAS_EVENT(&s->slave);
        return taken;
    }
#endif
#ifdef SAMPLE_TIME
    if (s->host.events)
        return step;
#endif
    advance_slave(s, time, step, fault);
    return step;
}

#endif
