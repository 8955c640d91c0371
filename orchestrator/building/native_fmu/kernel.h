/* What translated kernels need beside translated.h: arrays, and how a caller reaches a kernel. */

#ifndef KERNEL_H
#define KERNEL_H

#include "translated.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef struct { double *v; int64_t n[1]; } Reals1;
typedef struct { double *v; int64_t n[2]; } Reals2;
typedef struct { double *v; int64_t n[3]; } Reals3;
typedef struct { int64_t *v; int64_t n[1]; } Wholes1;
typedef struct { int64_t *v; int64_t n[2]; } Wholes2;
typedef struct { int64_t *v; int64_t n[3]; } Wholes3;

/* Status of a slave's function at an address: getters and setters of FMI 2.0 and, with a count of values, of 3.0. */
static inline int64_t call_transfer(int64_t address, int64_t component, int64_t references, int64_t count, int64_t values)
{
    typedef int (*Transfer)(void *, const void *, size_t, void *);
    return ((Transfer)(intptr_t)address)((void *)(intptr_t)component, (void *)(intptr_t)references, (size_t)count,
                                         (void *)(intptr_t)values);
}

static inline int64_t call_sized_transfer(int64_t address, int64_t component, int64_t references, int64_t count,
                                          int64_t values)
{
    typedef int (*Transfer)(void *, const void *, size_t, void *, size_t);
    return ((Transfer)(intptr_t)address)((void *)(intptr_t)component, (void *)(intptr_t)references, (size_t)count,
                                         (void *)(intptr_t)values, (size_t)count);
}

/* Status of a step of FMI 2.0; and of 3.0, which fills event, end, early (1: yes) and the time reached. */
static inline int64_t call_step(int64_t address, int64_t component, double time, double length)
{
    typedef int (*Step)(void *, double, double, int);
    return ((Step)(intptr_t)address)((void *)(intptr_t)component, time, length, 1);
}

static inline int64_t call_reporting_step(int64_t address, int64_t component, double time, double length, Reals1 report)
{
    typedef int (*Step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    bool event = false, end = false, early = false;
    double reached = report.v[3];
    const int status = ((Step)(intptr_t)address)((void *)(intptr_t)component, time, length, true, &event, &end, &early,
                                                 &reached);
    report.v[0] = event;
    report.v[1] = end;
    report.v[2] = early;
    report.v[3] = reached;
    return status;
}

#endif
