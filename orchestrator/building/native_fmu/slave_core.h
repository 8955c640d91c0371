/* One slave behind FMI of either version: life cycle, refusals, messages, values, sample clock.
 *
 * It does in C what pyfmu_sources/adapters/slave_base.py and sampled_slave.py do in Python, with the same statuses and
 * messages. The file that includes it defines the slave: the type SLAVE with its values and hidden state, the
 * functions slave_*, the tables `variables` and `lists`, and the constants GUID, VARIABLES, FIXED_BYTES and
 * FEEDTHROUGH; CONTINUOUS_STATES is there for model exchange, SAMPLE_TIME is the value reference of a sampled slave's
 * period. fmi2_slave.h or fmi3_slave.h defines Host and `deliver`. All state is in the instance. */

#include "log_categories.h"

#define LARGEST_REAL 1.7976931348623157e308
#define TIME_TOLERANCE 1e-9
#define SAMPLE_SLACK 1e-6
#define MOST_SAMPLES 1000000

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;

/* What a saved state holds beside the slave's own values. */
typedef struct {
    double start_time;
    double time;
    double stop;
    int64_t samples;
    int32_t at_sample;
    int32_t phase;
    int32_t type;
    int32_t in_event_mode; /* FMI 3.0: within STEPPING */
    int32_t event_due;     /* FMI 3.0: a step has ended at an event that has had no effect yet */
} Course;

typedef struct {
    Host host;
    const char *function; /* of FMI, which is being called */
    char *name;
    Wanted wanted;
    Status worst;
    bool fresh;
    bool warned;
    Course course;
    SLAVE slave;
} Instance;

static const char *const phase_names[] = {"before initialization", "in initialization mode", "in step mode",
                                          "after termination"};

/* Give the host a message. */
static void deliver(const Instance *s, Status status, const char *category, const char *text);

/* --- Messages ---------------------------------------------------------------------------------------------------- */

/* Log; the worst status that a call has logged is the one that it returns. */
static void say(Instance *s, Status status, const char *format, ...)
{
    static const char *const categories[] = {"logStatusOk", "logStatusWarning", "logStatusDiscard", "logStatusError"};
    char text[LONGEST_MESSAGE];
    va_list values;
    va_start(values, format);
    format_message(text, format, &values);
    va_end(values);
    if (status > s->worst)
        s->worst = status;
    if (is_wanted(&s->wanted, status, categories[status]))
        deliver(s, status, categories[status], text);
}

static void say_fault(Instance *s, const Fault *fault)
{
    static const char *const names[] = {"",           "StepRefusedError", "ValueError", "ZeroDivisionError",
                                        "OverflowError", "IndexError"};
    say(s, ERROR, "%s failed: %s: %s", s->function, names[fault->kind], fault->message);
}

/* The status of a call that may have raised. */
static Status concluded(Instance *s, const Fault *fault)
{
    if (fault->kind)
        say_fault(s, fault);
    return s->worst;
}

static const char *name_of(Reference r, char text[64])
{
    if (r < VARIABLES)
        return variables[r].shown;
    snprintf(text, 64, "value reference %u", r);
    return text;
}

static const char *mode_name(const Instance *s)
{
    const bool exchange = s->course.phase == STEPPING && s->course.type == MODEL_EXCHANGE;
    return exchange ? "in event or continuous-time mode" : phase_names[s->course.phase];
}

static bool expects(Instance *s, Phase phase)
{
    if (s->course.phase == (int32_t)phase)
        return true;
    say(s, ERROR, "%s must not be called %s; ignored", s->function, mode_name(s));
    return false;
}

/* A fault that nothing has raised yet; its message stays unset. */
#define NEW_FAULT(fault) \
    Fault fault; \
    fault.kind = NO_FAULT

/* Every call starts here: a null instance is an error, and so are null pointers where values are promised. */
#define ENTER(name, condition) \
    Instance *s = c; \
    if (!s) \
        return ERROR; \
    s->worst = OK; \
    s->function = #name; \
    if (!(condition)) { \
        say(s, ERROR, "%s must not be given null pointers", s->function); \
        return ERROR; \
    }

/* A call that is one expression, its status. */
#define CALL(name, parameters, condition, status) \
    EXPORT Status FMI(name) parameters \
    { \
        ENTER(name, condition) \
        return status; \
    }

static Status refuse_call(Instance *s, Status status)
{
    say(s, status, "FMI function not supported: %s", s->function);
    return s->worst;
}

/* --- The slave ----------------------------------------------------------------------------------------------------- */

#ifdef SAMPLE_TIME
static void initialise(Instance *s, Fault *fault)
{
    slave_take_parameters(&s->slave, fault);
    s->course.samples = 0;
    s->course.at_sample = 1;
    if (!fault->kind)
        slave_begin(&s->slave, fault);
}

static void warn(Instance *s, double due, double end, double period)
{
    if (!s->warned)
        say(s, WARNING,
            "a step should end at the sample at t = %r, but ends at %r: that sample saw the inputs held over the step; a "
            "step that divides `sample_time` = %r s a whole number of times avoids this", due, end, period);
    s->warned = true;
}

/* Hold the outputs, or take every sample that is due by the end of the step. */
static void advance_slave(Instance *s, double time, double step, Fault *fault)
{
    const double period = s->slave.real[SAMPLE_TIME], slack = SAMPLE_SLACK * period, end = time + step;
    if (step > MOST_SAMPLES * period) {
        raise_fault(fault, STEP_REFUSED, "a step must hold at most %i samples, but is %r s long", (int64_t)MOST_SAMPLES,
                    step);
        return;
    }
    s->course.at_sample = 0;
    while (!s->course.at_sample) {
        const double due = s->course.start_time + (double)(s->course.samples + 1) * period;
        if (due > end + slack)
            return;
        slave_predict(&s->slave, fault);
        if (!fault->kind)
            slave_correct(&s->slave, fault);
        if (fault->kind)
            return;
        s->course.samples++;
        s->course.at_sample = due >= end - slack;
        if (!s->course.at_sample)
            warn(s, due, end, period);
    }
}

static void refresh(Instance *s, Fault *fault)
{
    if (s->course.at_sample && s->course.samples)
        slave_correct(&s->slave, fault);
    else if (s->course.at_sample)
        slave_begin(&s->slave, fault);
}
#else
static void initialise(Instance *s, Fault *fault) { slave_initialise(&s->slave, fault); }
static void refresh(Instance *s, Fault *fault) { slave_refresh(&s->slave, fault); }
static void advance_slave(Instance *s, double time, double step, Fault *fault)
{
    slave_advance(&s->slave, time, step, fault);
}
#endif

/* Bring outputs up to date after something was set. */
static void recompute(Instance *s, Fault *fault)
{
    if (s->fresh)
        return;
    s->fresh = true;
    if (s->course.phase < STEPPING)
        initialise(s, fault);
#ifdef CONTINUOUS_STATES
    else if (s->course.type == MODEL_EXCHANGE)
        slave_observe(&s->slave, fault);
#endif
    else if (FEEDTHROUGH && s->course.phase == STEPPING)
        refresh(s, fault);
}

static void begin_anew(Instance *s)
{
    const int32_t type = s->course.type;
    memset(&s->course, 0, sizeof s->course);
    memset(&s->slave, 0, sizeof s->slave);
    s->course.stop = LARGEST_REAL;
    s->course.type = type;
    s->fresh = s->warned = false;
    for (Reference r = 0; r < VARIABLES; r++) {
        if (variables[r].type == REAL_VALUE)
            s->slave.real[r] = variables[r].start;
        else
            s->slave.integer[r] = (int)variables[r].start;
    }
}

/* --- Instances ------------------------------------------------------------------------------------------------------- */

static void free_instance(Instance *s)
{
    if (!s)
        return;
    forget_categories(&s->wanted);
    free(s->name);
    free(s);
}

/* Return an instance, or NULL after a message: `problem`, or that the token is not this FMU's. */
static Instance *instantiate(const char *name, Type type, const char *token, const char *token_name, const Host *host,
                             bool logging, const char *problem)
{
    Instance *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    if (host)
        s->host = *host;
    s->wanted.on = logging;
    s->name = copied(name ? name : "");
    if (!name || !*name)
        say(s, ERROR, "instanceName must not be empty");
    else if (problem)
        say(s, ERROR, "%s", problem);
    else if (!token)
        say(s, ERROR, "%s must not be null", token_name);
    else if (strcmp(token, GUID) != 0)
        say(s, ERROR, "%s must be %s, but is %s", token_name, GUID, token);
    if (s->worst != OK || !s->name) {
        free_instance(s);
        return NULL;
    }
    s->course.type = type;
    begin_anew(s);
    return s;
}

/* --- Life cycle ------------------------------------------------------------------------------------------------------ */

static Status set_times(Instance *s, double start, bool has_stop, double stop)
{
    if (!expects(s, INSTANTIATED))
        return s->worst;
    if (!has_stop)
        stop = LARGEST_REAL;
    if (!(-LARGEST_REAL <= start && start <= LARGEST_REAL && start <= stop)) {
        say(s, ERROR, "start time must be finite and before %r, but is %r; ignored", stop, start);
        return s->worst;
    }
    s->course.start_time = s->course.time = start;
    s->course.stop = stop;
    return OK;
}

static Status enter_initialization(Instance *s)
{
    if (expects(s, INSTANTIATED)) {
        s->course.phase = INITIALIZING;
        s->fresh = false;
    }
    return s->worst;
}

static Status exit_initialization(Instance *s)
{
    NEW_FAULT(fault);
    if (!expects(s, INITIALIZING))
        return s->worst;
    initialise(s, &fault);
#ifdef CONTINUOUS_STATES
    if (s->course.type == MODEL_EXCHANGE && !fault.kind)
        slave_begin_exchange(&s->slave, &fault);
    if (s->course.type == MODEL_EXCHANGE && !fault.kind)
        slave_update(&s->slave, s->course.time, &fault);
#endif
    if (!fault.kind) {
        s->fresh = true;
        s->course.phase = STEPPING;
    }
    return concluded(s, &fault);
}

static Status terminate(Instance *s)
{
    if (expects(s, STEPPING))
        s->course.phase = TERMINATED;
    return s->worst;
}

static Status refuse_step(Instance *s, double time, double step)
{
    if (s->course.type != CO_SIMULATION)
        say(s, ERROR, "%s must not be called in model exchange", s->function);
    else if (s->course.phase != STEPPING)
        say(s, ERROR, "%s must not be called %s", s->function, mode_name(s));
    else if (!(0.0 < step && step <= LARGEST_REAL))
        say(s, DISCARD, "communicationStepSize must be positive and finite, but is %r", step);
    else if (!(fabs(time - s->course.time) <= TIME_TOLERANCE * (1.0 + fabs(time))))
        say(s, DISCARD, "currentCommunicationPoint must be %r, but is %r", s->course.time, time);
    else
        say(s, ERROR, "a step must end at or before the stop time %r, but ends at %r", s->course.stop, time + step);
    return s->worst;
}

static bool may_step(const Instance *s, double time, double step)
{
    const double slack = TIME_TOLERANCE * (1.0 + fabs(time)), ahead = time - s->course.time;
    return s->course.type == CO_SIMULATION && s->course.phase == STEPPING && -slack <= ahead && ahead <= slack &&
           0.0 < step && step <= LARGEST_REAL && !(time + step > s->course.stop + slack);
}

static Status conclude_step(Instance *s, double end, const Fault *fault)
{
    if (fault->kind == STEP_REFUSED)
        say(s, DISCARD, "%s", fault->message);
    else if (fault->kind)
        say_fault(s, fault);
    if (fault->kind)
        return s->worst;
    s->course.time = end;
    s->fresh = true;
    return s->worst;
}

/* --- Values ------------------------------------------------------------------------------------------------------------ */

#define HAS(r, t) ((r) < VARIABLES && variables[r].type == (t))
#define IS_WHOLE(r) ((r) < VARIABLES && variables[r].type != REAL_VALUE)

/* Bring states, derivatives and event indicators among the variables up to date. */
static void show_states(Instance *s, Fault *fault)
{
#ifdef CONTINUOUS_STATES
    memcpy(s->slave.real + FIRST_STATE, STATES(&s->slave), CONTINUOUS_STATES * sizeof(double));
    slave_derivatives(&s->slave, s->slave.real + FIRST_STATE + CONTINUOUS_STATES, fault);
#ifdef FIRST_INDICATOR
    slave_indicators(&s->slave, s->slave.real + FIRST_INDICATOR, fault);
#endif
#else
    (void)s;
    (void)fault;
#endif
}

static Status refuse_type(Instance *s, Reference r)
{
    char text[64];
    say(s, ERROR, "%s must not be used for %s, which is of another type", s->function, name_of(r, text));
    return s->worst;
}

static Status refuse_types(Instance *s, const Reference r[], size_t n)
{
    for (size_t k = 0; k < n; k++)
        refuse_type(s, r[k]);
    return s->worst;
}

#ifdef CONTINUOUS_STATES
/* Whether a host may set a continuous state by its variable, as CasADi does: when it may set them all. */
static bool is_state_to_set(const Instance *s, Reference r)
{
    return r >= FIRST_STATE && r < FIRST_STATE + CONTINUOUS_STATES && s->course.type == MODEL_EXCHANGE &&
           s->course.phase == STEPPING && !s->course.in_event_mode;
}
#endif

static bool settable(const Instance *s, Reference r)
{
    const Causality causality = variables[r].causality;
#ifdef CONTINUOUS_STATES
    if (is_state_to_set(s, r))
        return true;
#endif
    return (causality == INPUT && s->course.phase <= STEPPING) || (causality == PARAMETER && s->course.phase < STEPPING);
}

/* Tell whether a variable of that type can be set now; say so if it cannot. */
static bool may_set(Instance *s, Reference r, bool of_type)
{
    static const char *const causalities[] = {"is an input, read-only", "is an FMU output, read-only",
                                              "is an FMU parameter, read-only", "is an FMU local, read-only"};
    char text[64];
    if (of_type && settable(s, r))
        return true;
    say(s, ERROR, "%s must not set %s, which %s %s", s->function, name_of(r, text),
        of_type ? causalities[variables[r].causality] : "has another type", mode_name(s));
    return false;
}

#ifdef CONTINUOUS_STATES
/* Set continuous states from the k-th on, if all are finite. */
static Status set_states(Instance *s, size_t k, const double x[], size_t n)
{
    for (size_t m = 0; m < n; m++)
        if (!(-LARGEST_REAL <= x[m] && x[m] <= LARGEST_REAL)) {
            say(s, DISCARD, "continuous states must be finite, but %s is %r", variables[FIRST_STATE + k + m].shown, x[m]);
            return s->worst;
        }
    memcpy(STATES(&s->slave) + k, x, n * sizeof *x);
    s->fresh = false;
    return s->worst;
}
#endif

static void set_real(Instance *s, Reference r, double value)
{
    const Variable *variable = &variables[r];
#ifdef CONTINUOUS_STATES
    if (is_state_to_set(s, r)) {
        set_states(s, r - FIRST_STATE, &value, 1);
        return;
    }
#endif
    if (variable->low <= value && value <= variable->high)
        s->slave.real[r] = value;
    else
        say(s, DISCARD, "%s must be within [%g, %g], but is %r; ignored", variable->shown, variable->low,
            variable->high, value);
}

static void set_whole(Instance *s, Reference r, int64_t value)
{
    const Variable *variable = &variables[r];
    if (variable->low <= (double)value && (double)value <= variable->high)
        s->slave.integer[r] = (int)value;
    else
        say(s, DISCARD, "%s must be within [%g, %g], but is %i; ignored", variable->shown, variable->low,
            variable->high, value);
}

#include "slave_states.h"
