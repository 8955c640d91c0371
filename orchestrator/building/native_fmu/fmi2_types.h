/* The types of FMI 2.0, as in fmi2TypesPlatform.h and fmi2FunctionTypes.h. */

#ifndef FMI2_TYPES_H
#define FMI2_TYPES_H

#include "slave_types.h"

typedef void *Component;
typedef void *FmuState;
typedef int Boolean;
typedef void (*Logger)(void *environment, const char *instance, Status status, const char *category, const char *message, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

#endif
