/* FMI 2.0 around one translated slave: life cycle, refusals, messages, values, saved states, sample clock.
 *
 * It does in C what pyfmu_sources/slave_base.py and sampled_slave.py do in Python, with the same statuses and
 * messages. The file that includes it defines the slave: the type SLAVE with its values and hidden state, the
 * functions slave_*, the tables `variables` and `lists`, and the constants GUID, VARIABLES, FIXED_BYTES and
 * FEEDTHROUGH; CONTINUOUS_STATES is there for model exchange, SAMPLE_TIME is the value reference of a sampled slave's period. All state is in the instance. */

#include <stddef.h>

#include "fmi2_types.h"

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
} Course;

typedef struct {
    Callbacks host;
    char *name;
    Boolean logging;
    size_t category_count;
    char **categories;
    Status worst;
    Boolean fresh;
    Boolean warned;
    Course course;
    SLAVE slave;
} Instance;

/* A saved state: this header, the slave's fixed part, then each list as its length and its items. */
typedef struct {
    char guid[40];
    uint64_t size;
    Course course;
} Saved;

static const char *const phase_names[] = {"before initialization", "in initialization mode", "in step mode",
                                          "after termination"};

/* --- Messages ---------------------------------------------------------------------------------------------------- */

static bool wanted(const Instance *s, Status status, const char *category)
{
    if (status != OK)
        return true; /* refusals and warnings are for everyone */
    for (size_t n = 0; n < s->category_count; n++)
        if (s->logging && strcmp(category, s->categories[n]) == 0)
            return true;
    return s->logging && s->category_count == 0;
}

/* Log; the worst status that a call has logged is the one that it returns. Hosts take messages as printf formats. */
static void say(Instance *s, Status status, const char *format, ...)
{
    static const char *const categories[] = {"logStatusOk", "logStatusWarning", "logStatusDiscard", "logStatusError"};
    char text[LONGEST_MESSAGE], doubled[2 * LONGEST_MESSAGE];
    size_t n = 0;
    va_list values;
    va_start(values, format);
    format_message(text, format, &values);
    va_end(values);
    for (const char *c = text; *c; c++) {
        doubled[n++] = *c;
        if (*c == '%')
            doubled[n++] = '%';
    }
    doubled[n] = '\0';
    if (status > s->worst)
        s->worst = status;
    if (s->host.logger && wanted(s, status, categories[status]))
        s->host.logger(s->host.environment, s->name, status, categories[status], doubled);
}

static void say_fault(Instance *s, const char *function, const Fault *fault)
{
    static const char *const names[] = {"",           "StepRefusedError", "ValueError", "ZeroDivisionError",
                                        "OverflowError", "IndexError"};
    say(s, ERROR, "%s failed: %s: %s", function, names[fault->kind], fault->message);
}

static const char *name_of(Reference r, char text[64])
{
    if (r < VARIABLES)
        return variables[r].shown;
    snprintf(text, 64, "value reference %u", r);
    return text;
}

static bool expects(Instance *s, const char *function, Phase phase)
{
    if (s->course.phase == (int32_t)phase)
        return true;
    say(s, ERROR, "%s must not be called %s; ignored", function, phase_names[s->course.phase]);
    return false;
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
    s->warned = 1;
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
    s->fresh = 1;
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
    s->fresh = s->warned = 0;
    for (Reference r = 0; r < VARIABLES; r++) {
        if (variables[r].type == REAL_VALUE)
            s->slave.real[r] = variables[r].start;
        else
            s->slave.integer[r] = (int)variables[r].start;
    }
}

/* --- Instances ------------------------------------------------------------------------------------------------------- */

EXPORT const char *FMI(fmi2GetTypesPlatform)(void) { return "default"; }
EXPORT const char *FMI(fmi2GetVersion)(void) { return "2.0"; }

static char *copied(const char *text)
{
    char *copy = malloc(strlen(text) + 1);
    return copy ? strcpy(copy, text) : NULL;
}

static const char *refusal(const char *name, int type, const char *guid)
{
    if (!name || !*name)
        return "instanceName must not be empty";
#ifndef CONTINUOUS_STATES
    if (type != CO_SIMULATION)
        return "fmuType must be fmi2CoSimulation: this FMU has no model exchange";
#endif
    if (type != CO_SIMULATION && type != MODEL_EXCHANGE)
        return "fmuType must be fmi2ModelExchange or fmi2CoSimulation";
    return guid ? NULL : "fmuGUID must not be null";
}

EXPORT Component FMI(fmi2Instantiate)(const char *name, int type, const char *guid, const char *uri,
                                      const Callbacks *host, Boolean visible, Boolean logging)
{
    const char *problem = refusal(name, type, guid);
    Instance *s = calloc(1, sizeof *s);
    (void)uri;
    (void)visible;
    if (!s)
        return NULL;
    if (host)
        s->host = *host;
    s->logging = logging;
    s->name = copied(name ? name : "");
    if (problem)
        say(s, ERROR, "%s", problem);
    else if (strcmp(guid, GUID) != 0)
        say(s, ERROR, "fmuGUID must be %s, but is %s", GUID, guid);
    if (s->worst != OK || !s->name) {
        free(s->name);
        free(s);
        return NULL;
    }
    s->course.type = type;
    begin_anew(s);
    return s;
}

static void forget_categories(Instance *s)
{
    for (size_t n = 0; n < s->category_count; n++)
        free(s->categories[n]);
    free(s->categories);
    s->categories = NULL;
    s->category_count = 0;
}

EXPORT void FMI(fmi2FreeInstance)(Component c)
{
    Instance *s = c;
    if (!s)
        return;
    forget_categories(s);
    free(s->name);
    free(s);
}

EXPORT Status FMI(fmi2SetDebugLogging)(Component c, Boolean on, size_t n, const char *const categories[])
{
    Instance *s = c;
    if (!s)
        return ERROR;
    forget_categories(s);
    s->logging = on;
    s->categories = n && categories ? calloc(n, sizeof *s->categories) : NULL;
    for (size_t k = 0; s->categories && k < n; k++)
        if (categories[k] && (s->categories[s->category_count] = copied(categories[k])) != NULL)
            s->category_count++;
    return OK;
}

/* Every call starts here: a null component is an error, and so are null pointers where values are promised. */
#define ENTER(function, condition) \
    Instance *s = c; \
    if (!s) \
        return ERROR; \
    s->worst = OK; \
    if (!(condition)) { \
        say(s, ERROR, "%s must not be given null pointers", #function); \
        return ERROR; \
    }

/* --- Life cycle ------------------------------------------------------------------------------------------------------ */

EXPORT Status FMI(fmi2SetupExperiment)(Component c, Boolean has_tolerance, double tolerance, double start, Boolean has_stop,
                                       double stop)
{
    ENTER(fmi2SetupExperiment, 1)
    (void)has_tolerance;
    (void)tolerance;
    if (!expects(s, "fmi2SetupExperiment", INSTANTIATED))
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

EXPORT Status FMI(fmi2EnterInitializationMode)(Component c)
{
    ENTER(fmi2EnterInitializationMode, 1)
    if (expects(s, "fmi2EnterInitializationMode", INSTANTIATED)) {
        s->course.phase = INITIALIZING;
        s->fresh = 0;
    }
    return s->worst;
}

EXPORT Status FMI(fmi2ExitInitializationMode)(Component c)
{
    Fault fault;
    ENTER(fmi2ExitInitializationMode, 1)
    fault.kind = NO_FAULT;
    if (!expects(s, "fmi2ExitInitializationMode", INITIALIZING))
        return s->worst;
    initialise(s, &fault);
#ifdef CONTINUOUS_STATES
    if (s->course.type == MODEL_EXCHANGE && !fault.kind)
        slave_update(&s->slave, s->course.time, &fault);
#endif
    if (fault.kind) {
        say_fault(s, "fmi2ExitInitializationMode", &fault);
    } else {
        s->fresh = 1;
        s->course.phase = STEPPING;
    }
    return s->worst;
}

EXPORT Status FMI(fmi2Terminate)(Component c)
{
    ENTER(fmi2Terminate, 1)
    if (expects(s, "fmi2Terminate", STEPPING))
        s->course.phase = TERMINATED;
    return s->worst;
}

EXPORT Status FMI(fmi2Reset)(Component c)
{
    ENTER(fmi2Reset, 1)
    begin_anew(s);
    return OK;
}

static Status refuse_step(Instance *s, double time, double step)
{
    if (s->course.type != CO_SIMULATION)
        say(s, ERROR, "fmi2DoStep must not be called in model exchange");
    else if (s->course.phase != STEPPING)
        say(s, ERROR, "fmi2DoStep must not be called %s", phase_names[s->course.phase]);
    else if (!(0.0 < step && step <= LARGEST_REAL))
        say(s, DISCARD, "communicationStepSize must be positive and finite, but is %r", step);
    else if (!(fabs(time - s->course.time) <= TIME_TOLERANCE * (1.0 + fabs(time))))
        say(s, DISCARD, "currentCommunicationPoint must be %r, but is %r", s->course.time, time);
    else
        say(s, ERROR, "a step must end at or before the stop time %r, but ends at %r", s->course.stop, time + step);
    return s->worst;
}

EXPORT Status FMI(fmi2DoStep)(Component c, double time, double step, Boolean no_return)
{
    Fault fault;
    ENTER(fmi2DoStep, 1)
    fault.kind = NO_FAULT;
    const double end = time + step, slack = TIME_TOLERANCE * (1.0 + fabs(time)), ahead = time - s->course.time;
    (void)no_return;
    if (s->course.type != CO_SIMULATION || s->course.phase != STEPPING || !(-slack <= ahead && ahead <= slack) || !(0.0 < step && step <= LARGEST_REAL) ||
        end > s->course.stop + slack)
        return refuse_step(s, time, step);
    advance_slave(s, time, step, &fault);
    if (fault.kind == STEP_REFUSED)
        say(s, DISCARD, "%s", fault.message);
    else if (fault.kind)
        say_fault(s, "fmi2DoStep", &fault);
    if (fault.kind)
        return s->worst;
    s->course.time = end;
    s->fresh = 1;
    return s->worst;
}

/* --- Values ------------------------------------------------------------------------------------------------------------ */

#define HAS(r, t) ((r) < VARIABLES && variables[r].type == (t))
#define VALUES_GIVEN (n == 0 || (r && v))

/* Bring states and derivatives among the variables up to date. */
static void show_states(Instance *s, Fault *fault)
{
#ifdef CONTINUOUS_STATES
    memcpy(s->slave.real + FIRST_STATE, STATES(&s->slave), CONTINUOUS_STATES * sizeof(double));
    slave_derivatives(&s->slave, s->slave.real + FIRST_STATE + CONTINUOUS_STATES, fault);
#else
    (void)s;
    (void)fault;
#endif
}

static Status refuse_read(Instance *s, const char *function, const Reference r[], size_t n, ValueType type,
                          const Fault *fault)
{
    char text[64];
    for (size_t k = 0; k < n; k++)
        if (!HAS(r[k], type)) {
            say(s, ERROR, "%s must not be used for %s, which is of another type", function, name_of(r[k], text));
            return s->worst;
        }
    if (fault->kind)
        say_fault(s, function, fault);
    return s->worst;
}

EXPORT Status FMI(fmi2GetReal)(Component c, const Reference r[], size_t n, double v[])
{
    Fault fault;
    bool all = true;
    ENTER(fmi2GetReal, VALUES_GIVEN)
    fault.kind = NO_FAULT;
    recompute(s, &fault);
    for (size_t k = 0; k < n; k++) {
        const bool there = HAS(r[k], REAL_VALUE);
        if (there && variables[r[k]].causality == LOCAL)
            show_states(s, &fault);
        v[k] = there ? s->slave.real[r[k]] : NAN;
        all = all && there;
    }
    return all && !fault.kind ? s->worst : refuse_read(s, "fmi2GetReal", r, n, REAL_VALUE, &fault);
}

EXPORT Status FMI(fmi2GetInteger)(Component c, const Reference r[], size_t n, int v[])
{
    Fault fault;
    bool all = true;
    ENTER(fmi2GetInteger, VALUES_GIVEN)
    fault.kind = NO_FAULT;
    recompute(s, &fault);
    for (size_t k = 0; k < n; k++) {
        const bool there = HAS(r[k], WHOLE_VALUE);
        v[k] = there ? s->slave.integer[r[k]] : 0;
        all = all && there;
    }
    return all && !fault.kind ? s->worst : refuse_read(s, "fmi2GetInteger", r, n, WHOLE_VALUE, &fault);
}

static bool settable(const Instance *s, Reference r)
{
    const Causality causality = variables[r].causality;
    return (causality == INPUT && s->course.phase <= STEPPING) || (causality == PARAMETER && s->course.phase < STEPPING);
}

static void refuse_write(Instance *s, const char *function, Reference r, ValueType type)
{
    static const char *const causalities[] = {"is an input, read-only", "is an FMU output, read-only",
                                              "is an FMU parameter, read-only", "is an FMU local, read-only"};
    char text[64];
    say(s, ERROR, "%s must not set %s, which %s %s", function, name_of(r, text),
        HAS(r, type) ? causalities[variables[r].causality] : "has another type", phase_names[s->course.phase]);
}

EXPORT Status FMI(fmi2SetReal)(Component c, const Reference r[], size_t n, const double v[])
{
    ENTER(fmi2SetReal, VALUES_GIVEN)
    s->fresh = 0;
    for (size_t k = 0; k < n; k++) {
        if (!HAS(r[k], REAL_VALUE) || !settable(s, r[k])) {
            refuse_write(s, "fmi2SetReal", r[k], REAL_VALUE);
            break;
        }
        const Variable *variable = &variables[r[k]];
        if (variable->low <= v[k] && v[k] <= variable->high)
            s->slave.real[r[k]] = v[k];
        else
            say(s, DISCARD, "%s must be within [%g, %g], but is %r; ignored", variable->shown, variable->low,
                variable->high, v[k]);
    }
    return s->worst;
}

EXPORT Status FMI(fmi2SetInteger)(Component c, const Reference r[], size_t n, const int v[])
{
    ENTER(fmi2SetInteger, VALUES_GIVEN)
    s->fresh = 0;
    for (size_t k = 0; k < n; k++) {
        if (!HAS(r[k], WHOLE_VALUE) || !settable(s, r[k])) {
            refuse_write(s, "fmi2SetInteger", r[k], WHOLE_VALUE);
            break;
        }
        const Variable *variable = &variables[r[k]];
        if (variable->low <= v[k] && v[k] <= variable->high)
            s->slave.integer[r[k]] = v[k];
        else
            say(s, DISCARD, "%s must be within [%g, %g], but is %i; ignored", variable->shown, variable->low,
                variable->high, (int64_t)v[k]);
    }
    return s->worst;
}

static Status refuse_type(Instance *s, const char *function, const Reference r[], size_t n)
{
    char text[64];
    for (size_t k = 0; k < n; k++)
        say(s, ERROR, "%s must not be used for %s, which is of another type", function, name_of(r[k], text));
    return s->worst;
}

EXPORT Status FMI(fmi2GetBoolean)(Component c, const Reference r[], size_t n, Boolean v[])
{
    ENTER(fmi2GetBoolean, VALUES_GIVEN)
    for (size_t k = 0; k < n; k++)
        v[k] = 0;
    return refuse_type(s, "fmi2GetBoolean", r, n);
}

EXPORT Status FMI(fmi2GetString)(Component c, const Reference r[], size_t n, const char *v[])
{
    ENTER(fmi2GetString, VALUES_GIVEN)
    for (size_t k = 0; k < n; k++)
        v[k] = "";
    return refuse_type(s, "fmi2GetString", r, n);
}

EXPORT Status FMI(fmi2SetBoolean)(Component c, const Reference r[], size_t n, const Boolean v[])
{
    ENTER(fmi2SetBoolean, VALUES_GIVEN)
    return refuse_type(s, "fmi2SetBoolean", r, n);
}

EXPORT Status FMI(fmi2SetString)(Component c, const Reference r[], size_t n, const char *const v[])
{
    ENTER(fmi2SetString, VALUES_GIVEN)
    return refuse_type(s, "fmi2SetString", r, n);
}

#ifdef CONTINUOUS_STATES
#include "fmi2_model_exchange.h"
#endif
#include "fmi2_states.h"
