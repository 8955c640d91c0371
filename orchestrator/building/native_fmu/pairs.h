/* Pairs of a value and its derivative in one direction: arithmetic for directional derivatives (forward mode).
 *
 * Values are those of the plain arithmetic, operation by operation. What does not change has the derivative zero, so
 * that an infinite slope beside it (the square root at zero) does no harm. */

#ifndef PAIRS_H
#define PAIRS_H

#include "translated.h"

/* Called now and then: small code rather than quick. Windows hands structures on through memory, Linux in registers. */
#if defined(__clang__) && defined(_WIN32) && defined(__x86_64__)
#define RARELY __attribute__((cold, minsize, sysv_abi))
#elif defined(__clang__)
#define RARELY __attribute__((cold, minsize))
#elif defined(__GNUC__)
#define RARELY __attribute__((cold))
#else
#define RARELY
#endif

typedef struct {
    double v;
    double d;
} Pair;

RARELY static inline Pair pair_of(double v) { return (Pair){v, 0.0}; }
RARELY static inline Pair pair_negated(Pair a) { return (Pair){-a.v, -a.d}; }
RARELY static inline Pair pair_sum(Pair a, Pair b) { return (Pair){a.v + b.v, a.d + b.d}; }
RARELY static inline Pair pair_difference(Pair a, Pair b) { return (Pair){a.v - b.v, a.d - b.d}; }
RARELY static inline Pair pair_product(Pair a, Pair b) { return (Pair){a.v * b.v, a.d * b.v + a.v * b.d}; }
RARELY static inline Pair pair_scaled(double a, Pair b) { return (Pair){a * b.v, a * b.d}; }
RARELY static inline Pair pair_lesser(Pair a, Pair b) { return b.v < a.v ? b : a; }
RARELY static inline Pair pair_greater(Pair a, Pair b) { return b.v > a.v ? b : a; }
RARELY static inline Pair pair_fabs(Pair a) { return signbit(a.v) ? pair_negated(a) : a; }
RARELY static inline Pair pair_copysign(Pair a, Pair b) { return !signbit(a.v) == !signbit(b.v) ? a : pair_negated(a); }

/* A function of one argument with its slope there. */
RARELY static inline Pair pair_along(double v, double slope, Pair a) { return (Pair){v, a.d == 0.0 ? 0.0 : slope * a.d}; }

RARELY static inline Pair pair_divided(Pair a, Pair b, Fault *fault)
{
    const double v = divided(a.v, b.v, fault);
    return (Pair){v, a.d == 0.0 && b.d == 0.0 ? 0.0 : (a.d - v * b.d) / b.v};
}

RARELY static inline Pair pair_parted(Pair a, double b, Fault *fault)
{
    return (Pair){divided(a.v, b, fault), a.d == 0.0 ? 0.0 : a.d / b};
}

RARELY static inline Pair pair_atan(Pair a) { return pair_along(atan(a.v), 1.0 / (1.0 + a.v * a.v), a); }
RARELY static inline Pair pair_tanh(Pair a) { return pair_along(tanh(a.v), 1.0 - tanh(a.v) * tanh(a.v), a); }
RARELY static inline Pair pair_sqrt(Pair a, Fault *fault) { return pair_along(checked_sqrt(a.v, fault), 0.5 / sqrt(a.v), a); }
RARELY static inline Pair pair_exp(Pair a, Fault *fault) { return pair_along(checked_exp(a.v, fault), exp(a.v), a); }
RARELY static inline Pair pair_log(Pair a, Fault *fault) { return pair_along(checked_log(a.v, fault), 1.0 / a.v, a); }
RARELY static inline Pair pair_sin(Pair a, Fault *fault) { return pair_along(checked_sin(a.v, fault), cos(a.v), a); }
RARELY static inline Pair pair_cos(Pair a, Fault *fault) { return pair_along(checked_cos(a.v, fault), -sin(a.v), a); }

RARELY static inline Pair pair_pow(Pair a, Pair b, Fault *fault)
{
    const double v = checked_pow(a.v, b.v, fault);
    const double base = a.d == 0.0 ? 0.0 : b.v * pow(a.v, b.v - 1.0) * a.d;
    return (Pair){v, base + (b.d == 0.0 ? 0.0 : v * log(a.v) * b.d)};
}

#endif
