/* Model exchange of FMI 2.0; a part of fmi2_slave.h. */

#include "slave_exchange.h"

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
    ENTER_EXCHANGE(fmi2EnterEventMode, 1)
    return s->worst;
}

EXPORT Status FMI(fmi2NewDiscreteStates)(Component c, EventInfo *info)
{
    bool jumped;
    ENTER_EXCHANGE(fmi2NewDiscreteStates, info != NULL)
    update_slave(s, &jumped);
    memset(info, 0, sizeof *info);
    info->values_changed = jumped;
    return s->worst;
}

EXPORT Status FMI(fmi2EnterContinuousTimeMode)(Component c)
{
    ENTER_EXCHANGE(fmi2EnterContinuousTimeMode, 1)
    return s->worst;
}

EXPORT Status FMI(fmi2CompletedIntegratorStep)(Component c, Boolean no_return, Boolean *enter_event_mode, Boolean *end)
{
    bool event;
    ENTER_EXCHANGE(fmi2CompletedIntegratorStep, enter_event_mode != NULL && end != NULL)
    (void)no_return;
    completed_step(s, &event);
    *enter_event_mode = event;
    *end = 0;
    return s->worst;
}

EXPORT Status FMI(fmi2SetTime)(Component c, double time)
{
    ENTER_EXCHANGE(fmi2SetTime, 1)
    s->course.time = time;
    return OK;
}

EXPORT Status FMI(fmi2SetContinuousStates)(Component c, const double x[], size_t n)
{
    ENTER_EXCHANGE(fmi2SetContinuousStates, x != NULL && n == CONTINUOUS_STATES)
    return set_states(s, 0, x, CONTINUOUS_STATES);
}

EXPORT Status FMI(fmi2GetContinuousStates)(Component c, double x[], size_t n)
{
    ENTER_EXCHANGE(fmi2GetContinuousStates, x != NULL && n == CONTINUOUS_STATES)
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
    ENTER_EXCHANGE(fmi2GetDerivatives, derivatives != NULL && n == CONTINUOUS_STATES)
    return derivatives_of(s, derivatives);
}

EXPORT Status FMI(fmi2GetEventIndicators)(Component c, double values[], size_t n)
{
    ENTER_EXCHANGE(fmi2GetEventIndicators, values != NULL && n == INDICATORS)
    return indicators_of(s, values);
}
