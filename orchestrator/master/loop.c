/* The loop of fixed_step.py in machine code: same values, same order, no interpreter between the slaves' calls.
 *
 * The functions of an FMU (FMI 2.0) are called by address; all else is arithmetic on arrays that compiled.py owns.
 * Signals are doubles in one array, `values`. A slave's inputs lie side by side in it, and so do its outputs: Reals,
 * then Integers, then Booleans. */

#include <math.h>
#include <stddef.h>
#include <stdint.h>

typedef int (*Set)(void *component, const uint32_t *references, size_t count, const void *values);
typedef int (*Get)(void *component, const uint32_t *references, size_t count, void *values);
typedef int (*Step)(void *component, double time, double length, int no_rollback);

enum { WARNING = 1, KINDS = 3, DO_STEP = 3, FIRST_GET = 4 };

typedef struct {
    void *component;
    Step step;
    Set set[KINDS];
    Get get[KINDS];
    const uint32_t *inputs[KINDS];
    const uint32_t *outputs[KINDS];
    int64_t input_counts[KINDS];
    int64_t output_counts[KINDS];
    int64_t first_input;
    int64_t first_output;
    int64_t first_feed;
    int64_t feeds;
    int *whole; /* as many as the longest list of Integers or Booleans */
    int64_t warnings; /* calls that returned a warning, and which was the first: call and step as in Failure */
    int64_t first_call;
    int64_t first_step;
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
    int64_t call; /* 0 to 2: fmi2SetReal, -Integer, -Boolean; 3: fmi2DoStep; 4 to 6: fmi2GetReal, ... */
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

static int whole_of(double value)
{
    return value >= -2147483648.0 && value <= 2147483647.0 ? (int)value : INT32_MIN;
}

static int noted(Slave *slave, int status, int64_t call, int64_t step)
{
    if (status == WARNING && !slave->warnings++) {
        slave->first_call = call;
        slave->first_step = step;
    }
    return status;
}

/* Send the inputs and step; `call` is what was called last. */
static int advance(Slave *slave, double *values, double time, double length, int64_t n, int64_t *call)
{
    const double *inputs = values + slave->first_input;
    for (int kind = 0; kind < KINDS; kind++) {
        const int64_t count = slave->input_counts[kind];
        int status;
        if (!count)
            continue;
        *call = kind;
        for (int64_t k = 0; kind && k < count; k++)
            slave->whole[k] = whole_of(inputs[k]);
        status = slave->set[kind](slave->component, slave->inputs[kind], (size_t)count,
                                  kind ? (const void *)slave->whole : (const void *)inputs);
        if (noted(slave, status, *call, n) > WARNING)
            return status;
        inputs += count;
    }
    *call = DO_STEP;
    return noted(slave, slave->step(slave->component, time, length, 1), DO_STEP, n);
}

static int receive(Slave *slave, double *values, int64_t n, int64_t *call)
{
    double *outputs = values + slave->first_output;
    for (int kind = 0; kind < KINDS; kind++) {
        const int64_t count = slave->output_counts[kind];
        int status;
        if (!count)
            continue;
        *call = FIRST_GET + kind;
        status = slave->get[kind](slave->component, slave->outputs[kind], (size_t)count,
                                  kind ? (void *)slave->whole : (void *)outputs);
        if (noted(slave, status, *call, n) > WARNING)
            return status;
        for (int64_t k = 0; kind && k < count; k++)
            outputs[k] = slave->whole[k];
        outputs += count;
    }
    return 0;
}

static int one_step(const Run *run, int64_t n, Failure *failure)
{
    const double time = run->start + (double)n * run->length;
    int status = 0;
    if (run->simultaneous)
        for (int64_t k = 0; k < run->slave_count; k++)
            gather(run, run->slaves + k, n + 1);
    for (int64_t k = 0; k < run->slave_count; k++) {
        Slave *slave = run->slaves + k;
        failure->slave = k;
        if (!run->simultaneous)
            gather(run, slave, n + 1);
        status = advance(slave, run->values, time, run->length, n, &failure->call);
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
    return 0;
}

/* Take steps `begin` to `end - 1`; return 0, or the status that was worse than a warning. */
int run_steps(const Run *run, int64_t begin, int64_t end, Failure *failure)
{
    for (int64_t n = begin; n < end; n++) {
        double *row = run->rows + (n + 1) * run->records;
        int status;
        failure->step = n;
        status = one_step(run, n, failure);
        if (status > WARNING)
            return status;
        for (int64_t j = 0; j < run->records; j++)
            row[j] = run->values[run->recorded[j]];
    }
    return 0;
}
