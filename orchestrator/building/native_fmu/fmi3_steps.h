/* Steps, events and model exchange of FMI 3.0; a part of fmi3_slave.h. */

#include "fmi3_clock.h"
#include "fmi3_modes.h"
#ifdef CONTINUOUS_STATES
#include "fmi3_updates.h"
#endif

EXPORT Status FMI(fmi3EnterEventMode)(Component c)
{
    ENTER(fmi3EnterEventMode, 1)
    if (!s->host.events)
        say(s, ERROR, "%s must not be called by a host that has said that it does not use events", s->function);
    else if (in_mode(s, false))
        s->course.in_event_mode = true;
    return s->worst;
}

/* The slave settles by itself: one call is enough. */
EXPORT Status FMI(fmi3UpdateDiscreteStates)(Component c, bool *again, bool *end, bool *nominals_changed, bool *jumped,
                                            bool *has_next, double *next)
{
    ENTER(fmi3UpdateDiscreteStates, again && end && nominals_changed && jumped && has_next && next)
    *again = *end = *nominals_changed = *jumped = *has_next = false;
    *next = 0.0;
    if (!in_mode(s, true))
        return s->worst;
#ifdef CONTINUOUS_STATES
    if (update_slave(s, jumped) <= WARNING)
        s->course.event_due = false;
#endif
    end_tick(s);
    return s->worst;
}

static Status leave_event_mode(Instance *s, Type type)
{
    if (is_type(s, type) && in_mode(s, true))
        s->course.in_event_mode = false;
    return s->worst;
}

CALL(fmi3EnterStepMode, (Component c), 1, leave_event_mode(s, CO_SIMULATION))
CALL(fmi3EnterContinuousTimeMode, (Component c), 1, leave_event_mode(s, MODEL_EXCHANGE))

/* --- Steps ------------------------------------------------------------------------------------------------------------- */

EXPORT Status FMI(fmi3DoStep)(Component c, double time, double step, bool no_return, bool *event, bool *end,
                              bool *early_return, double *reached)
{
    double taken = step;
    ENTER(fmi3DoStep, event && end && early_return && reached)
    (void)no_return;
    *event = *end = *early_return = false;
    *reached = s->course.time;
    NEW_FAULT(fault);
    if (!may_step(s, time, step))
        return refuse_step(s, time, step);
    if (s->course.in_event_mode && !in_mode(s, false))
        return s->worst;
    if (s->course.event_due) {
        say(s, ERROR, "%s must not be called before the event has been handled in event mode", s->function);
        return s->worst;
    }
    if (misses_tick(s, time + step, 1.0))
        return s->worst;
#ifdef CONTINUOUS_STATES
    if (s->host.update)
        taken = advance_with_updates(s, time, step, &fault);
    else
#endif
        taken = advance_piece(s, time, step, &fault);
    conclude_step(s, taken == step ? time + step : time + taken, &fault);
    *event = s->course.event_due;
    *early_return = !fault.kind && taken < step;
    *reached = s->course.time;
    return s->worst;
}

#ifdef CONTINUOUS_STATES
/* First derivatives, with the inputs held. */
EXPORT Status FMI(fmi3GetOutputDerivatives)(Component c, const Reference r[], size_t n, const int32_t orders[], double v[],
                                            size_t total)
{
    double rates[OUTPUT_RATES];
    char text[64];
    ENTER(fmi3GetOutputDerivatives, n == 0 || (r && orders && v))
    NEW_FAULT(fault);
    if (!is_type(s, CO_SIMULATION) || !expects(s, STEPPING))
        return s->worst;
    slave_output_rates(&s->slave, rates, &fault);
    if (fault.kind)
        return concluded(s, &fault);
    for (size_t k = 0; k < n; k++) {
        size_t place = 0;
        while (place < OUTPUT_RATES && rated_outputs[place] != r[k])
            place++;
        if (place == OUTPUT_RATES || orders[k] != 1 || k >= total) {
            say(s, ERROR, "%s must be asked for first derivatives of Float64 outputs, but is for order %i of %s", s->function,
                (int64_t)orders[k], name_of(r[k], text));
            return s->worst;
        }
        v[k] = rates[place];
    }
    return s->worst;
}
#endif

/* --- Model exchange ---------------------------------------------------------------------------------------------------- */

CALL(fmi3SetTime, (Component c, double time), 1,
     is_type(s, MODEL_EXCHANGE) && in_mode(s, false) ? (s->course.time = time, OK) : s->worst)

#ifdef CONTINUOUS_STATES
static bool takes_numbers(Instance *s, size_t n, size_t count)
{
    if (n != count)
        say(s, ERROR, "%s must be given room for %i numbers, but is for %i", s->function, (int64_t)count, (int64_t)n);
    return n == count && is_type(s, MODEL_EXCHANGE);
}

/* A call of model exchange that needs room for so many numbers. */
#define NUMBERS_CALL(name, numbers, count, status) \
    CALL(name, (Component c, numbers, size_t n), x != NULL, takes_numbers(s, n, count) ? status : s->worst)

CALL(fmi3GetNumberOfContinuousStates, (Component c, size_t *n), n != NULL, (*n = CONTINUOUS_STATES, OK))
CALL(fmi3GetNumberOfEventIndicators, (Component c, size_t *n), n != NULL, (*n = INDICATORS, OK))
NUMBERS_CALL(fmi3SetContinuousStates, const double x[], CONTINUOUS_STATES,
             in_mode(s, false) ? set_states(s, 0, x, CONTINUOUS_STATES) : s->worst)
NUMBERS_CALL(fmi3GetContinuousStates, double x[], CONTINUOUS_STATES,
             (bring_up_to_date(s), memcpy(x, STATES(&s->slave), n * sizeof *x), s->worst))
NUMBERS_CALL(fmi3GetNominalsOfContinuousStates, double x[], CONTINUOUS_STATES, (memcpy(x, nominals, n * sizeof *x), OK))
NUMBERS_CALL(fmi3GetContinuousStateDerivatives, double x[], CONTINUOUS_STATES,
             bring_up_to_date(s) ? derivatives_of(s, x) : s->worst)
NUMBERS_CALL(fmi3GetEventIndicators, double x[], INDICATORS, bring_up_to_date(s) ? indicators_of(s, x) : s->worst)
CALL(fmi3CompletedIntegratorStep, (Component c, bool no_return, bool *event, bool *end), event && end,
     ((void)no_return, *event = *end = false,
      is_type(s, MODEL_EXCHANGE) && in_mode(s, false) ? completed_step(s, event) : s->worst))
#endif
