/* FMI 3.0 around a slave: its calls, in terms of slave_core.h. The file that includes it defines `counts` too: how many
 * values there are at each value reference, 0 for the elements of an array behind its first; and `scalars`: for each that
 * is a single Float64 READABLE unless it is a local variable, and IS_INPUT or IS_PARAMETER. */

#include "fmi3_absent.h"
#include "fmi3_clock.h"
#include "fmi3_modes.h"
#include "fmi3_steps.h"

enum { READABLE = 1, IS_INPUT = 2, IS_PARAMETER = 4 };

#define TIME VARIABLES /* value reference of the independent variable */

/* --- Instances ------------------------------------------------------------------------------------------------------- */

EXPORT const char *FMI(fmi3GetVersion)(void) { return "3.0"; }

EXPORT Component FMI(fmi3InstantiateCoSimulation)(String name, String token, String resources, bool visible, bool logging,
                                                  bool events, bool early_return, const Reference required[], size_t n,
                                                  void *environment, LogMessage log, IntermediateUpdate update)
{
    const Host host = {log, environment, update, events, early_return, 0.0, 0.0};
    (void)visible;
    (void)resources;
    (void)required;
    (void)n;
    return instantiate(name, CO_SIMULATION, token, "instantiationToken", &host, logging, NULL);
}

EXPORT Component FMI(fmi3InstantiateModelExchange)(String name, String token, String resources, bool visible, bool logging,
                                                   void *environment, LogMessage log)
{
    const Host host = {log, environment, NULL, true, false, 0.0, 0.0};
#ifdef CONTINUOUS_STATES
    const char *const problem = NULL;
#else
    const char *const problem = "this FMU has no model exchange";
#endif
    (void)visible;
    (void)resources;
    return instantiate(name, MODEL_EXCHANGE, token, "instantiationToken", &host, logging, problem);
}

EXPORT Component FMI(fmi3InstantiateScheduledExecution)(String name, String token, String resources, bool visible,
                                                        bool logging, void *environment, LogMessage log,
                                                        void (*update)(void *), void (*lock)(void), void (*unlock)(void))
{
    const Host host = {log, environment, NULL, false, false, 0.0, 0.0};
    (void)resources;
    (void)visible;
    (void)update;
    (void)lock;
    (void)unlock;
    return instantiate(name, CO_SIMULATION, token, "", &host, logging, "this FMU has no scheduled execution");
}

EXPORT void FMI(fmi3FreeInstance)(Component c) { free_instance(c); }

CALL(fmi3SetDebugLogging, (Component c, bool on, size_t n, const String categories[]), n == 0 || categories,
     set_logging(&s->wanted, on, n, categories))

/* --- Life cycle ------------------------------------------------------------------------------------------------------ */

CALL(fmi3EnterInitializationMode,
     (Component c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop), 1,
     ((void)has_tolerance, (void)tolerance, set_times(s, start, has_stop, stop) == OK ? enter_initialization(s) : s->worst))

EXPORT Status FMI(fmi3ExitInitializationMode)(Component c)
{
    ENTER(fmi3ExitInitializationMode, 1)
    if (agrees_with_clock(s) && exit_initialization(s) <= WARNING) {
        s->course.in_event_mode = s->host.events;
        await_first_tick(s);
    }
    return s->worst;
}

CALL(fmi3Terminate, (Component c), 1, terminate(s))
CALL(fmi3Reset, (Component c), 1, (begin_anew(s), s->host.interval = s->host.shift = 0.0, OK))

/* --- Values ------------------------------------------------------------------------------------------------------------ */

#define VALUES_GIVEN ((n == 0 || r) && (total == 0 || v))

/* Number of values at a reference, if it is of a variable of a type; else 0. */
static inline size_t count_at(Reference r, ValueType type)
{
    return HAS(r, type) ? counts[r] : r == TIME && type == REAL_VALUE;
}

/* Tell whether the references are of variables of a type, and the values as many as theirs; say so if they are not. */
static bool fit(Instance *s, const Reference r[], size_t n, size_t total, ValueType type)
{
    size_t needed = 0;
    for (size_t k = 0; k < n; k++) {
        const size_t count = count_at(r[k], type);
        if (count == 0) {
            refuse_type(s, r[k]);
            return false;
        }
        needed += count;
    }
    if (needed != total)
        say(s, ERROR, "nValues of %s must be %i, but is %i", s->function, (int64_t)needed, (int64_t)total);
    return needed == total;
}

static Status get_reals(Instance *s, const Reference r[], size_t n, double v[], size_t total)
{
    NEW_FAULT(fault);
    if (!fit(s, r, n, total, REAL_VALUE))
        return s->worst;
    for (size_t k = 0; k < n; k++) {
        const size_t count = count_at(r[k], REAL_VALUE);
        if (r[k] != TIME && variables[r[k]].causality == LOCAL)
            show_states(s, &fault);
        memcpy(v, r[k] == TIME ? &s->course.time : &s->slave.real[r[k]], count * sizeof *v);
        v += count;
    }
    return concluded(s, &fault);
}

/* Set what is left from the variable at place `k` on; those before are scalars that have been set. */
static Status set_reals(Instance *s, const Reference r[], size_t n, const double v[], size_t total, size_t k)
{
    if (!fit(s, r, n, total, REAL_VALUE))
        return s->worst;
    for (v += k; k < n; k++) {
        if (r[k] == TIME) {
            say(s, ERROR, "%s must not set the time", s->function);
            return s->worst;
        }
        if (!may_set(s, r[k], true))
            return s->worst;
        for (size_t m = 0; m < counts[r[k]]; m++)
            set_real(s, r[k] + (Reference)m, *v++);
    }
    return s->worst;
}

/* Most variables are scalars that `scalars` knows: they are taken by themselves, what is left by the other half of each
 * function. */
#define IS_SCALAR(r, kinds) ((r) < VARIABLES && (scalars[r] & (kinds)))

static inline bool within_limits(Reference r, double value)
{
    return variables[r].low <= value && value <= variables[r].high;
}

EXPORT Status FMI(fmi3GetFloat64)(Component c, const Reference r[], size_t n, double v[], size_t total)
{
    size_t k = 0;
    ENTER(fmi3GetFloat64, VALUES_GIVEN)
    NEW_FAULT(fault);
    recompute(s, &fault);
    if (n == total)
        for (; k < n && IS_SCALAR(r[k], READABLE); k++)
            v[k] = s->slave.real[r[k]];
    if (fault.kind)
        say_fault(s, &fault);
    return k == total || fault.kind ? s->worst : get_reals(s, r, n, v, total);
}

EXPORT Status FMI(fmi3SetFloat64)(Component c, const Reference r[], size_t n, const double v[], size_t total)
{
    size_t k = 0;
    ENTER(fmi3SetFloat64, VALUES_GIVEN)
    if (!may_set_clocked(s, r, n))
        return s->worst;
    const int kinds = s->course.phase < STEPPING ? IS_INPUT | IS_PARAMETER : s->course.phase == STEPPING ? IS_INPUT : 0;
    s->fresh = false;
    if (n == total)
        for (; k < n && IS_SCALAR(r[k], kinds) && within_limits(r[k], v[k]); k++)
            s->slave.real[r[k]] = v[k];
    return k == total ? s->worst : set_reals(s, r, n, v, total, k);
}

/* Whole numbers: Int32 for those that count, Int64 for the items of an enumeration. */
#define WHOLE_CALLS(name, number, type) \
    EXPORT Status FMI(fmi3Get##name)(Component c, const Reference r[], size_t n, number v[], size_t total) \
    { \
        ENTER(fmi3Get##name, VALUES_GIVEN) \
        if (!fit(s, r, n, total, type) || !bring_up_to_date(s)) \
            return s->worst; \
        for (size_t k = 0; k < n; k++) \
            v[k] = s->slave.integer[r[k]]; \
        return s->worst; \
    } \
    EXPORT Status FMI(fmi3Set##name)(Component c, const Reference r[], size_t n, const number v[], size_t total) \
    { \
        ENTER(fmi3Set##name, VALUES_GIVEN) \
        if (!fit(s, r, n, total, type)) \
            return s->worst; \
        s->fresh = false; \
        for (size_t k = 0; k < n && may_set(s, r[k], true); k++) \
            set_whole(s, r[k], v[k]); \
        return s->worst; \
    }
WHOLE_CALLS(Int32, int32_t, WHOLE_VALUE)
WHOLE_CALLS(Int64, int64_t, CHOICE_VALUE)

/* --- Saved states ------------------------------------------------------------------------------------------------------ */

SAVED_STATE_CALLS(fmi3GetFMUState, fmi3SetFMUState, fmi3FreeFMUState, fmi3SerializedFMUStateSize, fmi3SerializeFMUState,
                  fmi3DeserializeFMUState, Byte)

#ifdef DIRECTIONAL
EXPORT Status FMI(fmi3GetDirectionalDerivative)(Component c, const Reference unknown[], size_t n, const Reference known[],
                                                size_t m, const double seed[], size_t seeds, double sensitivity[],
                                                size_t sensitivities)
{
    ENTER(fmi3GetDirectionalDerivative, (n == 0 || (unknown && sensitivity)) && (m == 0 || (known && seed)))
    if (seeds != m || sensitivities != n) {
        say(s, ERROR, "nSeed and nSensitivity must be %i and %i, but are %i and %i", (int64_t)m, (int64_t)n, (int64_t)seeds,
            (int64_t)sensitivities);
        return s->worst;
    }
    return directional_derivative(s, unknown, n, known, m, seed, sensitivity);
}
#endif
