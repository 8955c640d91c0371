/* The types of FMI 3.0, as in fmi3PlatformTypes.h and fmi3FunctionTypes.h. */

#ifndef FMI3_TYPES_H
#define FMI3_TYPES_H

#include <stdbool.h>

#include "slave_types.h"

typedef void *Component;
typedef void *FmuState;
typedef const char *String;
typedef unsigned char Byte;
typedef enum { NOT_YET_KNOWN, UNCHANGED, CHANGED } IntervalQualifier;
typedef void (*LogMessage)(void *environment, Status status, String category, String message);
typedef void (*IntermediateUpdate)(void *environment, double time, bool set_requested, bool get_allowed, bool finished,
                                   bool can_return_early, bool *return_requested, double *return_time);

/* What an instance was made with, and what has been set for its clock. */
typedef struct {
    LogMessage log;
    void *environment;
    IntermediateUpdate update;
    bool events;
    bool early_return;
    double interval; /* [s]; 0: as described */
    double shift;    /* [s] */
} Host;

#endif
