/* The loop of fixed_step.py in machine code: same values, same order, no interpreter between the slaves' calls.
 *
 * The functions of a slave are called by address; all else is arithmetic on arrays that compiled.py owns. Signals are
 * doubles in one array, `values`. A slave's inputs lie side by side in it, and so do its outputs, in the order of the
 * transfers that set and read them. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int (*Set)(void *component, const uint32_t *references, size_t variables, const void *values);
typedef int (*SizedSet)(void *component, const uint32_t *references, size_t variables, const void *values, size_t count);
typedef int (*Get)(void *component, const uint32_t *references, size_t variables, void *values);
typedef int (*SizedGet)(void *component, const uint32_t *references, size_t variables, void *values, size_t count);
typedef int (*Step)(void *component, double time, double length, int no_rollback);
typedef int (*ReportingStep)(void *component, double time, double length, bool no_rollback, bool *event, bool *end,
                             bool *early, double *reached);
typedef void (*Function)(void);

/* Share of a step within which its end and the time that a slave came to are one. */
#define NEAR 1e-6

enum { WARNING = 1, ENDED = 16, LEFT_EARLY = 17 };
typedef enum { F8, F4, I1, U1, I2, U2, I4, U4, I8, U8, B1 } Number;

typedef struct {
    Function function;
    const uint32_t *references;
    int64_t variables;
    int64_t count; /* of values */
    int64_t number;
    int64_t sized; /* the function takes `count` too */
} Transfer;

typedef struct {
    void *component;
    Function step;
    int64_t reports; /* `step` is a ReportingStep */
    const Transfer *inputs;
    const Transfer *outputs;
    int64_t input_transfers;
    int64_t output_transfers;
    int64_t first_input;
    int64_t first_output;
    int64_t first_feed;
    int64_t feeds;
    void *scratch; /* 8 bytes for each value of the longest transfer */
    int64_t warnings; /* calls that returned a warning, and which was the first: call and step as in Failure */
    int64_t first_call;
    int64_t first_step;
    int64_t astray; /* steps after which it says to be at another time than asked; the first; the largest difference [s] */
    int64_t first_astray;
    double farthest;
    double reached; /* where it says to be [s] */
} Slave;

/* values[slot] = round_to(quantum, factor * values[source] + offset + table[row]); a source or row below 0 is none. */
typedef struct {
    int64_t slot;
    int64_t source;
    int64_t row;
    int64_t plain; /* a mere copy of the source */
    double factor;
    double offset;
    double quantum;
} Feed;

typedef struct {
    Slave *slaves;
    const Feed *feeds;
    double *values;
    const double *table; /* signals x columns: column n + 1 counts in step n */
    const int64_t *recorded;
    double *rows; /* steps + 1 x records */
    int64_t slave_count;
    int64_t columns;
    int64_t records;
    double start;
    double length;
    int64_t simultaneous;
} Run;

/* Where a run ended that a slave did not go on with. */
typedef struct {
    int64_t call; /* counted: the transfers of the inputs, the step, the transfers of the outputs */
    int64_t slave;
    int64_t step;
} Failure;

static void gather(const Run *run, const Slave *slave, int64_t column)
{
    double *values = run->values;
    const Feed *end = run->feeds + slave->first_feed + slave->feeds;
    for (const Feed *feed = run->feeds + slave->first_feed; feed < end; feed++) {
        double value = feed->offset;
        if (feed->plain) {
            values[feed->slot] = values[feed->source];
            continue;
        }
        if (feed->source >= 0)
            value += feed->factor * values[feed->source];
        if (feed->row >= 0)
            value += run->table[feed->row * run->columns + column];
        if (feed->quantum > 0.0) {
            const double scaled = value / feed->quantum;
            if (fabs(scaled) < 9007199254740992.0) /* 2^53: beyond it all doubles are whole */
                value = feed->quantum * rint(scaled);
        }
        values[feed->slot] = value;
    }
}

/* Whole numbers beyond a type's range, and what is none, become its least one. */
#define PACK(type, least, most) \
    for (int64_t k = 0; k < count; k++) \
        ((type *)scratch)[k] = values[k] >= (double)(least) && values[k] <= (double)(most) ? (type)values[k] : (least); \
    break;

static void pack(Number number, const double *values, int64_t count, void *scratch)
{
    switch (number) {
    case F8:
        break;
    case F4:
        for (int64_t k = 0; k < count; k++)
            ((float *)scratch)[k] = (float)values[k];
        break;
    case I1: PACK(int8_t, INT8_MIN, INT8_MAX)
    case U1: PACK(uint8_t, 0, UINT8_MAX)
    case I2: PACK(int16_t, INT16_MIN, INT16_MAX)
    case U2: PACK(uint16_t, 0, UINT16_MAX)
    case I4: PACK(int32_t, INT32_MIN, INT32_MAX)
    case U4: PACK(uint32_t, 0, UINT32_MAX)
    case I8: PACK(int64_t, INT64_MIN, 9223372036854774784.0)
    case U8: PACK(uint64_t, 0, 18446744073709549568.0)
    case B1:
        for (int64_t k = 0; k < count; k++)
            ((bool *)scratch)[k] = values[k] != 0.0;
    }
}

#define UNPACK(type) \
    for (int64_t k = 0; k < count; k++) \
        values[k] = (double)((const type *)scratch)[k]; \
    break;

static void unpack(Number number, double *values, int64_t count, const void *scratch)
{
    switch (number) {
    case F8: break;
    case F4: UNPACK(float)
    case I1: UNPACK(int8_t)
    case U1: UNPACK(uint8_t)
    case I2: UNPACK(int16_t)
    case U2: UNPACK(uint16_t)
    case I4: UNPACK(int32_t)
    case U4: UNPACK(uint32_t)
    case I8: UNPACK(int64_t)
    case U8: UNPACK(uint64_t)
    case B1: UNPACK(bool)
    }
}

static int noted(Slave *slave, int status, int64_t call, int64_t step)
{
    if (status == WARNING && !slave->warnings++) {
        slave->first_call = call;
        slave->first_step = step;
    }
    return status;
}

static int set(const Slave *slave, const Transfer *t, const double *values)
{
    const void *given = t->number == F8 ? (const void *)values : slave->scratch;
    pack((Number)t->number, values, t->count, slave->scratch);
    return t->sized ? ((SizedSet)t->function)(slave->component, t->references, (size_t)t->variables, given, (size_t)t->count)
                    : ((Set)t->function)(slave->component, t->references, (size_t)t->variables, given);
}

static int get(const Slave *slave, const Transfer *t, double *values)
{
    void *taken = t->number == F8 ? (void *)values : slave->scratch;
    const int status =
        t->sized ? ((SizedGet)t->function)(slave->component, t->references, (size_t)t->variables, taken, (size_t)t->count)
                 : ((Get)t->function)(slave->component, t->references, (size_t)t->variables, taken);
    if (status <= WARNING)
        unpack((Number)t->number, values, t->count, slave->scratch);
    return status;
}

static int step(Slave *slave, double time, double length, int64_t n)
{
    bool event = false, end = false, early = false;
    if (!slave->reports)
        return ((Step)slave->step)(slave->component, time, length, 1);
    slave->reached = time + length;
    const int status =
        ((ReportingStep)slave->step)(slave->component, time, length, true, &event, &end, &early, &slave->reached);
    const double off = fabs(slave->reached - (time + length));
    if (status > WARNING)
        return status;
    if (end || event || early || !isfinite(off))
        return end ? ENDED : LEFT_EARLY;
    if (off > NEAR * length) {
        if (!slave->astray++)
            slave->first_astray = n;
        slave->farthest = fmax(slave->farthest, off);
    }
    return status;
}

/* Send the inputs and step; `call` is what was called last. */
static int advance(Slave *slave, double *values, double time, double length, int64_t n, int64_t *call)
{
    const double *inputs = values + slave->first_input;
    for (*call = 0; *call < slave->input_transfers; ++*call) {
        const Transfer *transfer = slave->inputs + *call;
        const int status = noted(slave, set(slave, transfer, inputs), *call, n);
        if (status > WARNING)
            return status;
        inputs += transfer->count;
    }
    return noted(slave, step(slave, time, length, n), *call, n);
}

/* Tell whether a slave ended the run at the end of its step, which the others then do too. */
static bool ends_there(const Slave *slave, int status, double end)
{
    return status == ENDED && slave->reached >= end - 1e-9 * fmax(1.0, fabs(end));
}

static int receive(Slave *slave, double *values, int64_t n, int64_t *call)
{
    double *outputs = values + slave->first_output;
    for (int64_t k = 0; k < slave->output_transfers; k++) {
        const Transfer *transfer = slave->outputs + k;
        *call = slave->input_transfers + 1 + k;
        const int status = noted(slave, get(slave, transfer, outputs), *call, n);
        if (status > WARNING)
            return status;
        outputs += transfer->count;
    }
    return 0;
}

static int one_step(const Run *run, int64_t n, Failure *failure)
{
    const double time = run->start + (double)n * run->length;
    int status = 0;
    Failure ended = {.step = -1};
    if (run->simultaneous)
        for (int64_t k = 0; k < run->slave_count; k++)
            gather(run, run->slaves + k, n + 1);
    for (int64_t k = 0; k < run->slave_count; k++) {
        Slave *slave = run->slaves + k;
        failure->slave = k;
        if (!run->simultaneous)
            gather(run, slave, n + 1);
        status = advance(slave, run->values, time, run->length, n, &failure->call);
        if (ends_there(slave, status, time + run->length)) {
            ended = *failure;
            status = 0;
        }
        if (status <= WARNING && !run->simultaneous)
            status = receive(slave, run->values, n, &failure->call);
        if (status > WARNING)
            return status;
    }
    for (int64_t k = 0; run->simultaneous && k < run->slave_count; k++) {
        failure->slave = k;
        status = receive(run->slaves + k, run->values, n, &failure->call);
        if (status > WARNING)
            return status;
    }
    if (ended.step < 0)
        return 0;
    *failure = ended;
    return ENDED;
}

/* Take steps `begin` to `end - 1`; return 0, or the status that was worse than a warning. */
int run_steps(const Run *run, int64_t begin, int64_t end, Failure *failure)
{
    for (int64_t n = begin; n < end; n++) {
        double *row = run->rows + (n + 1) * run->records;
        int status;
        failure->step = n;
        status = one_step(run, n, failure);
        if (status > WARNING && status != ENDED)
            return status;
        for (int64_t j = 0; j < run->records; j++)
            row[j] = run->values[run->recorded[j]];
        if (status == ENDED)
            return status;
    }
    return 0;
}
