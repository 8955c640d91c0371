/* FMI 2.0 around a slave: its calls, in terms of slave_core.h. */

#include "fmi2_types.h"

typedef Callbacks Host;

#include "slave_core.h"

/* Hosts take messages as printf formats. */
static void deliver(const Instance *s, Status status, const char *category, const char *text)
{
    char doubled[2 * LONGEST_MESSAGE];
    size_t n = 0;
    for (const char *c = text; *c; c++) {
        doubled[n++] = *c;
        if (*c == '%')
            doubled[n++] = '%';
    }
    doubled[n] = '\0';
    if (s->host.logger)
        s->host.logger(s->host.environment, s->name, status, category, doubled);
}

/* --- Instances ------------------------------------------------------------------------------------------------------- */

EXPORT const char *FMI(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT const char *FMI(fmi2GetVersion)(void) { return "2.0"; }

static const char *refusal(int type)
{
#ifndef CONTINUOUS_STATES
    if (type != CO_SIMULATION)
        return "fmuType must be fmi2CoSimulation: this FMU has no model exchange";
#endif
    if (type != CO_SIMULATION && type != MODEL_EXCHANGE)
        return "fmuType must be fmi2ModelExchange or fmi2CoSimulation";
    return NULL;
}

EXPORT Component FMI(fmi2Instantiate)(const char *name, int type, const char *guid, const char *uri,
                                      const Callbacks *host, Boolean visible, Boolean logging)
{
    (void)uri;
    (void)visible;
    return instantiate(name, (Type)type, guid, "fmuGUID", host, logging != 0, refusal(type));
}

EXPORT void FMI(fmi2FreeInstance)(Component c) { free_instance(c); }

CALL(fmi2SetDebugLogging, (Component c, Boolean on, size_t n, const char *const categories[]), 1,
     set_logging(&s->wanted, on != 0, n, categories))

/* --- Life cycle ------------------------------------------------------------------------------------------------------ */

CALL(fmi2SetupExperiment,
     (Component c, Boolean has_tolerance, double tolerance, double start, Boolean has_stop, double stop), 1,
     ((void)has_tolerance, (void)tolerance, set_times(s, start, has_stop != 0, stop)))
CALL(fmi2EnterInitializationMode, (Component c), 1, enter_initialization(s))
CALL(fmi2ExitInitializationMode, (Component c), 1, exit_initialization(s))
CALL(fmi2Terminate, (Component c), 1, terminate(s))
CALL(fmi2Reset, (Component c), 1, (begin_anew(s), OK))

EXPORT Status FMI(fmi2DoStep)(Component c, double time, double step, Boolean no_return)
{
    ENTER(fmi2DoStep, 1)
    (void)no_return;
    NEW_FAULT(fault);
    if (!may_step(s, time, step))
        return refuse_step(s, time, step);
    advance_slave(s, time, step, &fault);
    return conclude_step(s, time + step, &fault);
}

/* --- Values ------------------------------------------------------------------------------------------------------------ */

#define VALUES_GIVEN (n == 0 || (r && v))

#define GET_VALUES(name, type, fits, value, none) \
    EXPORT Status FMI(name)(Component c, const Reference r[], size_t n, type v[]) \
    { \
        ENTER(name, VALUES_GIVEN) \
        NEW_FAULT(fault); \
        recompute(s, &fault); \
        for (size_t k = 0; k < n; k++) { \
            if (HAS(r[k], REAL_VALUE) && variables[r[k]].causality == LOCAL) \
                show_states(s, &fault); \
            v[k] = (fits) ? (value) : (none); \
            if (!(fits) && s->worst == OK) \
                refuse_type(s, r[k]); \
        } \
        return s->worst == OK ? concluded(s, &fault) : s->worst; \
    }
GET_VALUES(fmi2GetReal, double, HAS(r[k], REAL_VALUE), s->slave.real[r[k]], NAN)
GET_VALUES(fmi2GetInteger, int, IS_WHOLE(r[k]), s->slave.integer[r[k]], 0)

#define SET_VALUES(name, type, fits, set) \
    EXPORT Status FMI(name)(Component c, const Reference r[], size_t n, const type v[]) \
    { \
        ENTER(name, VALUES_GIVEN) \
        s->fresh = false; \
        for (size_t k = 0; k < n && may_set(s, r[k], fits); k++) \
            set(s, r[k], v[k]); \
        return s->worst; \
    }
SET_VALUES(fmi2SetReal, double, HAS(r[k], REAL_VALUE), set_real)
SET_VALUES(fmi2SetInteger, int, IS_WHOLE(r[k]), set_whole)

/* No variable is of that type. */
#define NO_VALUES(name, type, none) \
    EXPORT Status FMI(fmi2Get##name)(Component c, const Reference r[], size_t n, type v[]) \
    { \
        ENTER(fmi2Get##name, VALUES_GIVEN) \
        for (size_t k = 0; k < n; k++) \
            v[k] = none; \
        return refuse_types(s, r, n); \
    } \
    CALL(fmi2Set##name, (Component c, const Reference r[], size_t n, type const v[]), VALUES_GIVEN, refuse_types(s, r, n))
NO_VALUES(Boolean, Boolean, 0)
NO_VALUES(String, const char *, "")

/* --- Saved states ------------------------------------------------------------------------------------------------------ */

SAVED_STATE_CALLS(fmi2GetFMUstate, fmi2SetFMUstate, fmi2FreeFMUstate, fmi2SerializedFMUstateSize, fmi2SerializeFMUstate,
                  fmi2DeSerializeFMUstate, char)

#ifdef DIRECTIONAL
CALL(fmi2GetDirectionalDerivative,
     (Component c, const Reference unknown[], size_t n, const Reference known[], size_t m, const double seed[],
      double sensitivity[]),
     (n == 0 || (unknown && sensitivity)) && (m == 0 || (known && seed)),
     directional_derivative(s, unknown, n, known, m, seed, sensitivity))
#endif

/* --- Not supported ----------------------------------------------------------------------------------------------------- */

#define UNSUPPORTED(status, name, parameters) CALL(name, parameters, 1, refuse_call(s, status))

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#ifndef DIRECTIONAL
UNSUPPORTED(ERROR, fmi2GetDirectionalDerivative, (Component c, const Reference u[], size_t n, const Reference k[], size_t m,
                                                  const double dk[], double du[]))
#endif
UNSUPPORTED(ERROR, fmi2SetRealInputDerivatives,
            (Component c, const Reference r[], size_t n, const int o[], const double v[]))
UNSUPPORTED(ERROR, fmi2GetRealOutputDerivatives, (Component c, const Reference r[], size_t n, const int o[], double v[]))
UNSUPPORTED(ERROR, fmi2CancelStep, (Component c))
UNSUPPORTED(ERROR, fmi2GetStatus, (Component c, int kind, Status *v))
UNSUPPORTED(DISCARD, fmi2GetIntegerStatus, (Component c, int kind, int *v))
UNSUPPORTED(DISCARD, fmi2GetStringStatus, (Component c, int kind, const char **v))
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

EXPORT Status FMI(fmi2GetRealStatus)(Component c, int kind, double *v)
{
    enum { LAST_SUCCESSFUL_TIME = 2 };
    ENTER(fmi2GetRealStatus, v != NULL)
    if (kind != LAST_SUCCESSFUL_TIME) {
        say(s, DISCARD, "Invalid status inquiry for fmi2GetRealStatus");
        return s->worst;
    }
    *v = s->course.time;
    return OK;
}

/* A refused step is no wish to end the simulation. */
EXPORT Status FMI(fmi2GetBooleanStatus)(Component c, int kind, Boolean *v)
{
    enum { TERMINATED_STATUS = 3 };
    ENTER(fmi2GetBooleanStatus, v != NULL)
    if (kind != TERMINATED_STATUS)
        return DISCARD;
    *v = 0;
    return OK;
}

#ifdef CONTINUOUS_STATES
#include "fmi2_model_exchange.h"
#endif
