/* Model exchange: states, derivatives, event indicators, event update; a part of fmi2_slave.h.
 *
 * The slave's mode is part of its hidden state: it changes in event mode only, so that between events all is smooth. */

#define ENTER_CONTINUOUS(function, condition) \
    ENTER(function, condition) \
    if (s->course.type != MODEL_EXCHANGE || s->course.phase != STEPPING) { \
        say(s, ERROR, "%s must not be called %s", #function, \
            s->course.type != MODEL_EXCHANGE ? "in co-simulation" : phase_names[s->course.phase]); \
        return s->worst; \
    }

typedef struct {
    Boolean new_discrete_states_needed;
    Boolean terminate_simulation;
    Boolean nominals_changed;
    Boolean values_changed;
    Boolean next_event_time_defined;
    double next_event_time;
} EventInfo;

EXPORT Status FMI(fmi2EnterEventMode)(Component c)
{
    ENTER_CONTINUOUS(fmi2EnterEventMode, 1)
    return s->worst;
}

/* The slave settles by itself: one call is enough. */
EXPORT Status FMI(fmi2NewDiscreteStates)(Component c, EventInfo *info)
{
    Fault fault;
    double before[CONTINUOUS_STATES];
    ENTER_CONTINUOUS(fmi2NewDiscreteStates, info != NULL)
    fault.kind = NO_FAULT;
    memcpy(before, STATES(&s->slave), sizeof before);
    slave_update(&s->slave, s->course.time, &fault);
    memset(info, 0, sizeof *info);
    info->values_changed = memcmp(before, STATES(&s->slave), sizeof before) != 0;
    s->fresh = 1;
    if (fault.kind)
        say_fault(s, "fmi2NewDiscreteStates", &fault);
    return s->worst;
}

EXPORT Status FMI(fmi2EnterContinuousTimeMode)(Component c)
{
    ENTER_CONTINUOUS(fmi2EnterContinuousTimeMode, 1)
    return s->worst;
}

static void indicators_of(Instance *s, double values[], const char *function)
{
    Fault fault;
    fault.kind = NO_FAULT;
    slave_indicators(&s->slave, values, &fault);
    if (fault.kind)
        say_fault(s, function, &fault);
}

EXPORT Status FMI(fmi2CompletedIntegratorStep)(Component c, Boolean no_return, Boolean *enter_event_mode, Boolean *terminate)
{
    double values[INDICATORS];
    ENTER_CONTINUOUS(fmi2CompletedIntegratorStep, enter_event_mode != NULL && terminate != NULL)
    (void)no_return;
    indicators_of(s, values, "fmi2CompletedIntegratorStep");
    *enter_event_mode = *terminate = 0;
    for (size_t n = 0; n < INDICATORS; n++)
        *enter_event_mode |= values[n] <= 0.0;
    return s->worst;
}

EXPORT Status FMI(fmi2SetTime)(Component c, double time)
{
    ENTER_CONTINUOUS(fmi2SetTime, 1)
    s->course.time = time;
    return OK;
}

EXPORT Status FMI(fmi2SetContinuousStates)(Component c, const double x[], size_t n)
{
    ENTER_CONTINUOUS(fmi2SetContinuousStates, x != NULL && n == CONTINUOUS_STATES)
    for (size_t k = 0; k < n; k++)
        if (!(-LARGEST_REAL <= x[k] && x[k] <= LARGEST_REAL)) {
            say(s, DISCARD, "continuous states must be finite, but %s is %r", variables[FIRST_STATE + k].shown, x[k]);
            return s->worst;
        }
    memcpy(STATES(&s->slave), x, n * sizeof *x);
    s->fresh = 0;
    return OK;
}

EXPORT Status FMI(fmi2GetContinuousStates)(Component c, double x[], size_t n)
{
    ENTER_CONTINUOUS(fmi2GetContinuousStates, x != NULL && n == CONTINUOUS_STATES)
    memcpy(x, STATES(&s->slave), n * sizeof *x);
    return OK;
}

EXPORT Status FMI(fmi2GetNominalsOfContinuousStates)(Component c, double x[], size_t n)
{
    ENTER(fmi2GetNominalsOfContinuousStates, x != NULL && n == CONTINUOUS_STATES)
    memcpy(x, nominals, n * sizeof *x);
    return OK;
}

EXPORT Status FMI(fmi2GetDerivatives)(Component c, double derivatives[], size_t n)
{
    Fault fault;
    ENTER_CONTINUOUS(fmi2GetDerivatives, derivatives != NULL && n == CONTINUOUS_STATES)
    fault.kind = NO_FAULT;
    slave_derivatives(&s->slave, derivatives, &fault);
    if (fault.kind)
        say_fault(s, "fmi2GetDerivatives", &fault);
    return s->worst;
}

EXPORT Status FMI(fmi2GetEventIndicators)(Component c, double values[], size_t n)
{
    ENTER_CONTINUOUS(fmi2GetEventIndicators, values != NULL && n == INDICATORS)
    indicators_of(s, values, "fmi2GetEventIndicators");
    return s->worst;
}
