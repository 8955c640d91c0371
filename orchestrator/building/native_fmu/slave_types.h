/* The types of a slave's tables, and those that FMI 2.0 and 3.0 have in common. */

#ifndef SLAVE_TYPES_H
#define SLAVE_TYPES_H

#include <stddef.h>
#include <stdint.h>

typedef unsigned int Reference;
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Type;

/* Where sources are compiled into a program, a prefix keeps the functions of several FMUs apart. */
#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI2_FUNCTION_PREFIX)
#define FMI2_FUNCTION_PREFIX FMI3_FUNCTION_PREFIX
#endif
#define JOINED_(a, b) a##b
#define JOINED(a, b) JOINED_(a, b)
#ifdef FMI2_FUNCTION_PREFIX
#define FMI(function) JOINED(FMI2_FUNCTION_PREFIX, function)
#else
#define FMI(function) function
#endif

#if defined(FMI2_FUNCTION_PREFIX)
#define EXPORT
#elif defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { REAL_VALUE, WHOLE_VALUE, CHOICE_VALUE } ValueType;
typedef enum { INPUT, OUTPUT, PARAMETER, LOCAL } Causality;

/* One variable; its place in the table is its value reference. */
typedef struct {
    const char *shown; /* the name as messages show it */
    ValueType type;
    Causality causality;
    double start;
    double low;
    double high;
} Variable;

/* A list in the slave's hidden state: only the items in use are saved. */
typedef struct {
    size_t place; /* of its length; the items follow */
    size_t items; /* place of the first item */
    size_t item_size;
    int64_t capacity;
} List;

#endif
