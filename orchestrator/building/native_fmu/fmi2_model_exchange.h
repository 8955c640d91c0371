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

#define EXCHANGE_CALL(name, parameters, condition, status) \
    EXPORT Status FMI(name) parameters \
    { \
        ENTER_EXCHANGE(name, condition) \
        return status; \
    }

EXCHANGE_CALL(fmi2EnterEventMode, (Component c), 1, s->worst)

EXPORT Status FMI(fmi2NewDiscreteStates)(Component c, EventInfo *info)
{
    bool jumped;
    ENTER_EXCHANGE(fmi2NewDiscreteStates, info != NULL)
    update_slave(s, &jumped);
    memset(info, 0, sizeof *info);
    info->values_changed = jumped;
    return s->worst;
}

EXCHANGE_CALL(fmi2EnterContinuousTimeMode, (Component c), 1, s->worst)

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

EXCHANGE_CALL(fmi2SetTime, (Component c, double time), 1, (s->course.time = time, OK))
EXCHANGE_CALL(fmi2SetContinuousStates, (Component c, const double x[], size_t n), x != NULL && n == CONTINUOUS_STATES,
              set_states(s, 0, x, CONTINUOUS_STATES))
EXCHANGE_CALL(fmi2GetContinuousStates, (Component c, double x[], size_t n), x != NULL && n == CONTINUOUS_STATES,
              (memcpy(x, STATES(&s->slave), n * sizeof *x), OK))
CALL(fmi2GetNominalsOfContinuousStates, (Component c, double x[], size_t n), x != NULL && n == CONTINUOUS_STATES,
     (memcpy(x, nominals, n * sizeof *x), OK))
EXCHANGE_CALL(fmi2GetDerivatives, (Component c, double x[], size_t n), x != NULL && n == CONTINUOUS_STATES,
              derivatives_of(s, x))
EXCHANGE_CALL(fmi2GetEventIndicators, (Component c, double x[], size_t n), x != NULL && n == INDICATORS,
              indicators_of(s, x))
