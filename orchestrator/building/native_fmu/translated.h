/* What the translated sources need: arithmetic that raises where Python does. Nothing here has a state of its own.
 *
 * A function that can raise takes a `Fault`. The first thing raised is kept; the function goes on with a zero
 * in place of the result, loops end, and the slave's methods return, so that nothing of it is stored. */

#ifndef TRANSLATED_H
#define TRANSLATED_H

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LONGEST_MESSAGE 512

typedef enum { NO_FAULT, STEP_REFUSED, VALUE_ERROR, ZERO_DIVISION_ERROR, OVERFLOW_ERROR, INDEX_ERROR } FaultKind;

typedef struct {
    FaultKind kind;
    char message[LONGEST_MESSAGE];
} Fault;

/* Append to a text of LONGEST_MESSAGE bytes at most. */
static void append_text(char *text, const char *more)
{
    const size_t used = strlen(text);
    snprintf(text + used, LONGEST_MESSAGE - used, "%s", more);
}

/* Append a number as Python's repr writes it: the shortest digits that read back as the same number. */
static void append_number(char *text, double value)
{
    char digits[40];
    if (isnan(value) || isinf(value)) {
        append_text(text, isnan(value) ? "nan" : value > 0.0 ? "inf" : "-inf");
        return;
    }
    int precision = 0;
    do {
        snprintf(digits, sizeof digits, "%.*e", precision, value);
    } while (strtod(digits, NULL) != value && precision++ < 17);
    const int exponent = atoi(strchr(digits, 'e') + 1);
    if (exponent < -4 || exponent >= 16)
        snprintf(digits, sizeof digits, "%.*g", precision + 1, value);
    else
        snprintf(digits, sizeof digits, "%.*f", precision - exponent > 1 ? precision - exponent : 1, value);
    append_text(text, digits);
}

/* Append one value of a message: %r a double as repr writes it, %g a double, %i an int64_t, %t doubles and how many. */
static void append_value(char *text, char letter, va_list *values)
{
    char piece[40];
    if (letter == 'r') {
        append_number(text, va_arg(*values, double));
    } else if (letter == 'g') {
        snprintf(piece, sizeof piece, "%g", va_arg(*values, double));
        append_text(text, piece);
    } else if (letter == 'i') {
        snprintf(piece, sizeof piece, "%lld", (long long)va_arg(*values, int64_t));
        append_text(text, piece);
    } else if (letter == 's') {
        append_text(text, va_arg(*values, const char *));
    } else if (letter == 't') {
        const double *items = va_arg(*values, const double *);
        const int count = va_arg(*values, int);
        for (int n = 0; n < count; n++) {
            append_text(text, n ? ", " : "(");
            append_number(text, items[n]);
        }
        append_text(text, count == 1 ? ",)" : ")");
    } else {
        append_text(text, "%");
    }
}

static void format_message(char *text, const char *format, va_list *values)
{
    text[0] = '\0';
    for (const char *c = format; *c; c++) {
        const char one[2] = {*c, '\0'};
        if (*c == '%' && c[1])
            append_value(text, *++c, values);
        else
            append_text(text, one);
    }
}

/* Raise, unless something was raised already. */
static void raise_fault(Fault *fault, FaultKind kind, const char *format, ...)
{
    va_list values;
    if (fault->kind)
        return;
    fault->kind = kind;
    va_start(values, format);
    format_message(fault->message, format, &values);
    va_end(values);
}

static inline double divided(double a, double b, Fault *fault)
{
    if (b == 0.0) {
        raise_fault(fault, ZERO_DIVISION_ERROR, "float division by zero");
        return 0.0;
    }
    return a / b;
}

static inline int64_t floor_divided(int64_t a, int64_t b, Fault *fault)
{
    if (b == 0 || (a == INT64_MIN && b == -1)) {
        raise_fault(fault, ZERO_DIVISION_ERROR, "integer division or modulo by zero");
        return 0;
    }
    return a / b - (a % b != 0 && (a < 0) != (b < 0));
}

static inline int64_t remainder_of(int64_t a, int64_t b, Fault *fault)
{
    return b ? a - b * floor_divided(a, b, fault) : floor_divided(a, b, fault);
}

static inline double lesser(double a, double b) { return b < a ? b : a; }
static inline double greater(double a, double b) { return b > a ? b : a; }
static inline int64_t lesser_whole(int64_t a, int64_t b) { return b < a ? b : a; }
static inline int64_t greater_whole(int64_t a, int64_t b) { return b > a ? b : a; }
static inline int64_t whole_magnitude(int64_t a) { return a < 0 ? -a : a; }

/* int() of a float. */
static inline int64_t truncated(double x, Fault *fault)
{
    if (!(fabs(x) < 9.2e18)) {
        if (isnan(x))
            raise_fault(fault, VALUE_ERROR, "cannot convert float NaN to integer");
        else
            raise_fault(fault, OVERFLOW_ERROR, "cannot convert float infinity to integer");
        return 0;
    }
    return (int64_t)x;
}

static inline int64_t checked_ceil(double x, Fault *fault) { return truncated(ceil(x), fault); }
static inline int64_t checked_floor(double x, Fault *fault) { return truncated(floor(x), fault); }

/* Python raises where a function of a number is none (nan) or too large (inf). */
static inline double in_domain(double y, double x, Fault *fault)
{
    if (isnan(y) && !isnan(x))
        raise_fault(fault, VALUE_ERROR, "math domain error");
    return y;
}

static inline double in_range(double y, double x, Fault *fault)
{
    if (isinf(y) && !isinf(x))
        raise_fault(fault, OVERFLOW_ERROR, "math range error");
    return y;
}

static inline double checked_sqrt(double x, Fault *fault) { return in_domain(sqrt(x), x, fault); }
static inline double checked_sin(double x, Fault *fault) { return in_domain(sin(x), x, fault); }
static inline double checked_cos(double x, Fault *fault) { return in_domain(cos(x), x, fault); }
static inline double checked_tan(double x, Fault *fault) { return in_domain(tan(x), x, fault); }
static inline double checked_asin(double x, Fault *fault) { return in_domain(asin(x), x, fault); }
static inline double checked_acos(double x, Fault *fault) { return in_domain(acos(x), x, fault); }
static inline double checked_exp(double x, Fault *fault) { return in_range(exp(x), x, fault); }
static inline double checked_sinh(double x, Fault *fault) { return in_range(sinh(x), x, fault); }
static inline double checked_cosh(double x, Fault *fault) { return in_range(cosh(x), x, fault); }

static inline double checked_log(double x, Fault *fault)
{
    if (x <= 0.0) {
        raise_fault(fault, VALUE_ERROR, "math domain error");
        return 0.0;
    }
    return log(x);
}

static inline double checked_pow(double x, double y, Fault *fault)
{
    if (x == 0.0 && y < 0.0) {
        raise_fault(fault, ZERO_DIVISION_ERROR, "0.0 cannot be raised to a negative power");
        return 0.0;
    }
    const double z = pow(x, y);
    if (isinf(z) && !isinf(x) && !isinf(y))
        raise_fault(fault, OVERFLOW_ERROR, "(34, 'Numerical result out of range')");
    return z;
}

/* An index that lies inside whatever is asked for; negative ones count from the end. */
static inline int64_t item_at(int64_t index, int64_t length, Fault *fault)
{
    if (index < 0)
        index += length;
    if (index < 0 || index >= length) {
        raise_fault(fault, INDEX_ERROR, "list index out of range");
        return 0;
    }
    return index;
}

/* The place for one more item of a list. */
static inline int64_t next_item(int64_t *length, int64_t capacity, Fault *fault)
{
    if (*length >= capacity) {
        raise_fault(fault, INDEX_ERROR, "a list is full");
        return capacity - 1;
    }
    return (*length)++;
}

/* Drop the first items of a list; return how many are left. */
static inline int64_t drop_items(void *items, int64_t length, int64_t count, size_t size)
{
    if (count < 0)
        count = count + length > 0 ? count + length : 0;
    if (count > length)
        count = length;
    memmove(items, (char *)items + (size_t)count * size, (size_t)(length - count) * size);
    return length - count;
}

#endif
