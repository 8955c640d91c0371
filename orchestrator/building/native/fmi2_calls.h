/* What the launcher must know of FMI 2.0: one line for each function that it only hands on. */

#ifndef FMI2_CALLS_H
#define FMI2_CALLS_H

#include "fmi2_types.h"

#define VALUES (n == 0 || (r && v))
/* X(function, parameters, arguments, what must hold of the pointers) */
#define FORWARDED(X) \
    X(fmi2SetupExperiment, (Component c, Boolean a, double b, double d, Boolean e, double f), \
      (s->inner, a, b, d, e, f), 1) \
    X(fmi2EnterInitializationMode, (Component c), (s->inner), 1) \
    X(fmi2ExitInitializationMode, (Component c), (s->inner), 1) \
    X(fmi2Terminate, (Component c), (s->inner), 1) \
    X(fmi2Reset, (Component c), (s->inner), 1) \
    X(fmi2GetReal, (Component c, const Reference r[], size_t n, double v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2GetInteger, (Component c, const Reference r[], size_t n, int v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2GetBoolean, (Component c, const Reference r[], size_t n, Boolean v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2GetString, (Component c, const Reference r[], size_t n, const char *v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2SetReal, (Component c, const Reference r[], size_t n, const double v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2SetInteger, (Component c, const Reference r[], size_t n, const int v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2SetBoolean, (Component c, const Reference r[], size_t n, const Boolean v[]), (s->inner, r, n, v), VALUES) \
    X(fmi2SetString, (Component c, const Reference r[], size_t n, const char *const v[]), \
      (s->inner, r, n, v), VALUES && all_there(v, n)) \
    X(fmi2GetFMUstate, (Component c, FmuState *x), (s->inner, x), x) \
    X(fmi2SetFMUstate, (Component c, FmuState x), (s->inner, x), x) \
    X(fmi2SerializedFMUstateSize, (Component c, FmuState x, size_t *n), (s->inner, x, n), x && n) \
    X(fmi2SerializeFMUstate, (Component c, FmuState x, char b[], size_t n), (s->inner, x, b, n), x && b) \
    X(fmi2DeSerializeFMUstate, (Component c, const char b[], size_t n, FmuState *x), (s->inner, b, n, x), b && x) \
    X(fmi2GetDirectionalDerivative, \
      (Component c, const Reference u[], size_t n, const Reference k[], size_t m, const double dk[], double du[]), \
      (s->inner, u, n, k, m, dk, du), 1) \
    X(fmi2SetRealInputDerivatives, (Component c, const Reference r[], size_t n, const int o[], const double v[]), \
      (s->inner, r, n, o, v), 1) \
    X(fmi2GetRealOutputDerivatives, (Component c, const Reference r[], size_t n, const int o[], double v[]), \
      (s->inner, r, n, o, v), 1) \
    X(fmi2DoStep, (Component c, double t, double h, Boolean p), (s->inner, t, h, p), 1) \
    X(fmi2CancelStep, (Component c), (s->inner), 1) \
    X(fmi2GetStatus, (Component c, int k, Status *v), (s->inner, k, v), v) \
    X(fmi2GetRealStatus, (Component c, int k, double *v), (s->inner, k, v), v) \
    X(fmi2GetIntegerStatus, (Component c, int k, int *v), (s->inner, k, v), v) \
    X(fmi2GetStringStatus, (Component c, int k, const char **v), (s->inner, k, v), v)

#endif
