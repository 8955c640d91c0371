/* A simulation inside a web page: FMUs stepped one after the other, each with the newest values there are, as the
 * master's Gauss-Seidel does. What is connected to what comes from the page as numbers; see `live_system.py`.
 *
 * `live_fmus.h` is generated: the functions of each FMU in the module, and `live_gains` where there is a regulator. */

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2_types.h"

typedef struct {
    const char *guid;
    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, Boolean, Boolean);
    void (*release)(Component);
    Status (*setup)(Component, Boolean, double, double, Boolean, double);
    Status (*enter)(Component);
    Status (*leave)(Component);
    Status (*step)(Component, double, double, Boolean);
    Status (*get_real)(Component, const Reference[], size_t, double[]);
    Status (*get_integer)(Component, const Reference[], size_t, int[]);
    Status (*set_real)(Component, const Reference[], size_t, const double[]);
    Status (*set_integer)(Component, const Reference[], size_t, const int[]);
} Fmu;

#include "live_fmus.h"

#define WEB(name) __attribute__((export_name(#name)))
#define MOST_INSTANCES 8
#define MOST_INPUTS 64
#define MOST_SWEEPS 100

/* An input: what is connected to it, and the row of the table that is added; -1 where there is none. */
typedef struct {
    int instance;
    Reference reference;
    int from;
    Reference output;
    int row;
} Input;

typedef struct {
    int count;
    const Fmu *fmus[MOST_INSTANCES];
    Component slaves[MOST_INSTANCES];
    int inputs;
    Input input[MOST_INPUTS];
} System;

static char said[512];

static void note(void *environment, const char *instance, Status status, const char *category, const char *message, ...)
{
    (void)environment;
    (void)status;
    (void)category;
    said[0] = '\0';
    strncat(said, instance, 100);
    strncat(said, ": ", 3);
    strncat(said, message, sizeof said - 104);
}

static const Callbacks host = {note, NULL, NULL, NULL, NULL};

/* What the last refused call said. */
WEB(live_message) const char *live_message(void) { return said; }

/* Room for numbers, for as long as the page is open. */
WEB(live_room) double *live_room(int count) { return malloc((size_t)count * sizeof(double)); }

static double read(const System *s, int instance, Reference r, bool whole)
{
    double value = 0.0;
    int number = 0;
    if (whole) {
        s->fmus[instance]->get_integer(s->slaves[instance], &r, 1, &number);
        return number;
    }
    s->fmus[instance]->get_real(s->slaves[instance], &r, 1, &value);
    return value;
}

/* Give an instance its inputs; return the largest change. */
static double feed(const System *s, int instance, const double *column, int length, double last[])
{
    double change = 0.0;
    for (int n = 0; n < s->inputs; n++) {
        const Input *to = &s->input[n];
        if (to->instance != instance)
            continue;
        double value = to->from < 0 ? 0.0 : read(s, to->from, to->output, false);
        if (to->row >= 0)
            value += column[(size_t)to->row * (size_t)length];
        change = fmax(change, fabs(value - last[n]));
        last[n] = value;
        s->fmus[instance]->set_real(s->slaves[instance], &to->reference, 1, &value);
    }
    return change;
}

/* Make the slaves and give them their values; return where the plan goes on, or NULL. */
static const double *begin(System *s, const double *plan)
{
    s->count = (int)*plan++;
    for (int n = 0; n < s->count; n++) {
        static const char *const names[MOST_INSTANCES] = {"1", "2", "3", "4", "5", "6", "7", "8"};
        const Fmu *fmu = &fmus[(int)*plan++];
        const int values = (int)*plan++;
        s->fmus[n] = fmu;
        s->slaves[n] = fmu->instantiate(names[n], 1, fmu->guid, "", &host, 0, 0);
        if (!s->slaves[n] || fmu->setup(s->slaves[n], 0, 0.0, 0.0, 0, 0.0) != OK)
            return NULL;
        for (int k = 0; k < values; k++, plan += 3) {
            const Reference r = (Reference)plan[0];
            const int number = (int)plan[2];
            const Status done = plan[1] != 0.0 ? fmu->set_integer(s->slaves[n], &r, 1, &number)
                                               : fmu->set_real(s->slaves[n], &r, 1, &plan[2]);
            if (done > WARNING)
                return NULL;
        }
    }
    s->inputs = (int)*plan++;
    for (int n = 0; n < s->inputs; n++, plan += 5)
        s->input[n] = (Input){(int)plan[0], (Reference)plan[1], (int)plan[2], (Reference)(plan[3] > 0.0 ? plan[3] : 0.0),
                              (int)plan[4]};
    return plan;
}

static bool initialise(const System *s, const double *table, int length, double last[])
{
    for (int n = 0; n < s->count; n++)
        if (s->fmus[n]->enter(s->slaves[n]) != OK)
            return false;
    for (int sweep = 0; sweep < MOST_SWEEPS; sweep++) {
        double change = 0.0;
        for (int n = 0; n < s->count; n++)
            change = fmax(change, feed(s, n, table, length, last));
        if (change == 0.0)
            break;
    }
    for (int n = 0; n < s->count; n++)
        if (s->fmus[n]->leave(s->slaves[n]) > WARNING)
            return false;
    return true;
}

/* Run a plan; `table` has a row of `steps` + 1 numbers for each outer signal, `out` gets one for each record.
 * Return how many rows of `out` are filled: fewer than `steps` + 1 where a slave refused. */
WEB(live_run) int live_run(const double *plan, const double *table, double *out)
{
    System s = {0};
    double last[MOST_INPUTS] = {0};
    const double h = plan[0];
    const int steps = (int)plan[1], length = steps + 1;
    int done = 0;
    said[0] = '\0';
    plan = begin(&s, plan + 2);
    if (plan && initialise(&s, table, length, last)) {
        const int records = (int)*plan++;
        for (bool well = true; well && done <= steps; done++) {
            for (int n = 0; done > 0 && well && n < s.count; n++) {
                feed(&s, n, table + done, length, last);
                well = s.fmus[n]->step(s.slaves[n], (done - 1) * h, h, 1) <= WARNING;
            }
            for (int k = 0; well && k < records; k++)
                out[(size_t)k * (size_t)length + (size_t)done] =
                    read(&s, (int)plan[3 * k], (Reference)plan[3 * k + 1], plan[3 * k + 2] != 0.0);
            if (!well)
                break;
        }
    }
    for (int n = 0; n < s.count; n++)
        if (s.slaves[n])
            s.fmus[n]->release(s.slaves[n]);
    return done;
}
