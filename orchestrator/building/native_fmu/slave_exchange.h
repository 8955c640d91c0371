/* Model exchange in terms of the slave: states, derivatives, event indicators, event update; a part of slave_core.h.
 *
 * The slave's mode is part of its hidden state: it changes in event mode only, so that between events all is smooth. */

#define ENTER_EXCHANGE(name, condition) \
    ENTER(name, condition) \
    if (s->course.type != MODEL_EXCHANGE || s->course.phase != STEPPING) { \
        say(s, ERROR, "%s must not be called %s", s->function, \
            s->course.type != MODEL_EXCHANGE ? "in co-simulation" : mode_name(s)); \
        return s->worst; \
    }

/* Settle state and mode; the slave does it by itself: one call is enough. Tell whether states have jumped. */
static Status update_slave(Instance *s, bool *jumped)
{
    double before[CONTINUOUS_STATES];
    NEW_FAULT(fault);
    memcpy(before, STATES(&s->slave), sizeof before);
    slave_update(&s->slave, s->course.time, &fault);
    *jumped = memcmp(before, STATES(&s->slave), sizeof before) != 0;
    s->fresh = true;
    return concluded(s, &fault);
}

static Status indicators_of(Instance *s, double values[])
{
    NEW_FAULT(fault);
    slave_indicators(&s->slave, values, &fault);
    return concluded(s, &fault);
}

static Status completed_step(Instance *s, bool *event)
{
    *event = false;
#if INDICATORS > 0
    double values[INDICATORS];
    indicators_of(s, values);
    for (size_t n = 0; n < INDICATORS; n++)
        *event = *event || values[n] <= 0.0;
#endif
    return s->worst;
}

static Status derivatives_of(Instance *s, double derivatives[])
{
    NEW_FAULT(fault);
    slave_derivatives(&s->slave, derivatives, &fault);
    return concluded(s, &fault);
}
