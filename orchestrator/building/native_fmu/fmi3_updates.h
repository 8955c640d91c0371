/* Steps with intermediate updates; a part of fmi3_steps.h.
 *
 * The slave holds its inputs over a step. The host is asked for them at the middle and at the end of a step, and each half
 * of it is taken with constants that have the mean and the first moment of the parabola through the three values: that
 * is of order four in the step. At the end of each half the host may read, and ask to return. A slave that follows its
 * inputs (FOLLOWS_INPUTS: slave_take_node, slave_advance_along) is given the three values instead. */

#include "fmi3_modes.h"

/* Ask the host for inputs at a time, or let it read; return whether it wants to return there. */
static bool call_host(Instance *s, double time, bool set)
{
    const char *const function = s->function;
    const Status worst = s->worst;
    bool wanted = false;
    double until = time;
    s->host.update(s->host.environment, time, set, !set, !set, !set && s->host.early_return, &wanted, &until);
    s->function = function;
    s->worst = s->worst > worst ? s->worst : worst; /* what the host's calls inside have said */
    return !set && s->host.early_return && wanted && until <= time;
}

#ifdef FOLLOWS_INPUTS
static double advance_with_updates(Instance *s, double time, double step, Fault *fault)
{
    void *before = NULL;
    if (save_state(s, &before) > WARNING)
        return 0.0;
    for (int node = 0; node < 3 && !fault->kind; node++) {
        if (node)
            call_host(s, time + 0.5 * node * step, true);
        slave_take_node(&s->slave, node, fault);
    }
    const double taken = fault->kind ? 0.0 : slave_advance_along(&s->slave, time, step, takes_events(s), fault);
    if (fault->kind) {
        restore_state(s, before);
    } else {
        s->course.event_due = HAS_EVENT(&s->slave);
        s->course.time = taken == step ? time + step : time + taken;
        call_host(s, s->course.time, false);
    }
    free_state(&before);
    return taken;
}
#else
static void read_inputs(const Instance *s, double u[])
{
    for (Reference r = 0; r < VARIABLES; r++)
        u[r] = variables[r].causality == INPUT ? s->slave.real[r] : 0.0;
}

/* Set the inputs as they are at a share of the step: on the parabola through begin, middle and end. */
static void set_inputs(Instance *s, const double begin[], const double middle[], const double end[], double share,
                       Fault *fault)
{
    for (Reference r = 0; r < VARIABLES; r++)
        if (variables[r].causality == INPUT && share < 1.0)
            s->slave.real[r] = begin[r] + share * (4.0 * middle[r] - 3.0 * begin[r] - end[r] +
                                                   2.0 * share * (begin[r] - 2.0 * middle[r] + end[r]));
        else if (variables[r].causality == INPUT)
            s->slave.real[r] = end[r];
    if (FEEDTHROUGH)
        refresh(s, fault);
}

/* Take the inputs of one half: with the mean and the first moment of the parabola over the whole step. */
static void hold_inputs(Instance *s, const double begin[], const double middle[], const double end[], int half)
{
    for (Reference r = 0; r < VARIABLES; r++)
        if (variables[r].causality == INPUT)
            s->slave.real[r] = (begin[r] + 4.0 * middle[r] + end[r]) / 6.0 + (half ? 1.0 : -1.0) * (end[r] - begin[r]) / 3.0;
}

static double advance_with_updates(Instance *s, double time, double step, Fault *fault)
{
    double begin[VARIABLES], middle[VARIABLES], end[VARIABLES], taken = 0.0;
    void *before = NULL;
    read_inputs(s, begin);
    if (save_state(s, &before) > WARNING)
        return 0.0;
    call_host(s, time + 0.5 * step, true);
    read_inputs(s, middle);
    call_host(s, time + step, true);
    read_inputs(s, end);
    if (memcmp(begin, middle, sizeof begin) == 0 && memcmp(begin, end, sizeof begin) == 0) {
        taken = advance_piece(s, time, step, fault);
        s->course.time = taken == step ? time + step : time + taken;
        if (!fault->kind)
            call_host(s, s->course.time, false);
        free_state(&before);
        return taken;
    }
    for (int half = 0; half < 2 && !fault->kind; half++) {
        const double from = half ? 0.5 * step : 0.0, length = half ? step - from : 0.5 * step;
        hold_inputs(s, begin, middle, end, half);
        const double moved = advance_piece(s, time + from, length, fault);
        if (fault->kind)
            break;
        taken = half && moved == length ? step : from + moved;
        s->course.time = half && moved == length ? time + step : time + taken;
        set_inputs(s, begin, middle, end, taken / step, fault);
        if (call_host(s, s->course.time, false) || moved < length || s->course.event_due)
            break;
    }
    if (fault->kind)
        restore_state(s, before);
    free_state(&before);
    return taken;
}
#endif
