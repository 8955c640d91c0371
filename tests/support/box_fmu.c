/* Small FMI 2.0 co-simulation FMUs of several domains for tests of black boxes. MODEL chooses one; FAULT_x breaks it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "fmi2Functions.h"

#if MODEL == 1 /* two masses on a shaft: torque at the first, both angles */
enum { NP = 5, NU = 1, NX = 4, NY = 2 };
static const double P0[NP] = {0.02, 0.05, 60.0, 0.05, 0.04};
static void f(const double *x, const double *u, const double *p, double *d) {
    double t = p[2] * (x[0] - x[2]) + p[3] * (x[1] - x[3]);
    d[0] = x[1]; d[1] = (u[0] - t - p[4] * x[1]) / p[0]; d[2] = x[3]; d[3] = t / p[1];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = x[2]; }
static const double LONGEST = 5e-4;
#elif MODEL == 2 /* a coil, a resistor and a capacitor in series: voltage in, charge and current */
enum { NP = 3, NU = 1, NX = 2, NY = 2 };
static const double P0[NP] = {0.5, 2.0, 0.02};
static void f(const double *x, const double *u, const double *p, double *d) {
    d[0] = x[1]; d[1] = (u[0] - p[1] * x[1] - x[0] / p[2]) / p[0];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = x[1]; }
static const double LONGEST = 2e-3;
#elif MODEL == 3 /* two tanks: inflow, both levels */
enum { NP = 4, NU = 1, NX = 2, NY = 2 };
static const double P0[NP] = {1.5, 1.0, 0.02, 0.03};
static double root(double h) { return h > 0.01 ? sqrt(h) : h * 10.0; }
static void f(const double *x, const double *u, const double *p, double *d) {
    double a = p[2] * root(fabs(x[0] - x[1])) * (x[0] > x[1] ? 1.0 : -1.0), b = p[3] * root(x[1]);
    d[0] = (u[0] - a) / p[0]; d[1] = (a - b) / p[1];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = x[1]; }
static const double LONGEST = 0.25;
#elif MODEL == 4 /* a motor: torque and load torque in, angle and speed out */
enum { NP = 2, NU = 2, NX = 2, NY = 2 };
static const double P0[NP] = {0.02, 0.04};
static void f(const double *x, const double *u, const double *p, double *d) {
    d[0] = x[1]; d[1] = (u[0] - u[1] - p[1] * x[1]) / p[0];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = x[1]; }
static const double LONGEST = 5e-4;
#elif MODEL == 5 /* a load behind a shaft: angle in, its own angle and the shaft's torque out */
enum { NP = 3, NU = 1, NX = 2, NY = 2 };
static const double P0[NP] = {0.05, 60.0, 0.4};
static void f(const double *x, const double *u, const double *p, double *d) {
    d[0] = x[1]; d[1] = (p[1] * (u[0] - x[0]) - p[2] * x[1]) / p[0];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = 0.0; }
static const double LONGEST = 5e-4;
#else /* a mass on a spring: force, position and speed */
enum { NP = 3, NU = 1, NX = 2, NY = 2 };
static const double P0[NP] = {1.0, 20.0, 0.8};
static void f(const double *x, const double *u, const double *p, double *d) {
    d[0] = x[1]; d[1] = (u[0] - p[1] * x[0] - p[2] * x[1]) / p[0];
}
static void g(const double *x, double *y) { y[0] = x[0]; y[1] = x[1]; }
static const double LONGEST = 2e-3;
#endif

typedef struct { double p[NP], u[NU], x[NX], d[NX], time, stop; int steps, was_reset; } C;
static int life = 0;
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean b, size_t n, const fmi2String s[]) { return fmi2OK; }
static void fresh(C *m) { memset(m, 0, sizeof *m); memcpy(m->p, P0, sizeof P0); }
fmi2Status fmi2Reset(fmi2Component c) {
#if defined(FAULT_reset_ignored)
    return fmi2OK;
#elif defined(FAULT_reset_refused)
    return fmi2Error;
#elif defined(FAULT_reset_hangs)
    for (;;) sleep(1);
#elif defined(FAULT_reset_crashes)
    abort();
#elif defined(FAULT_reset_keeps_parameters)
    C *m = c;
    memset(m->x, 0, sizeof m->x);
    m->was_reset = 1;
    return fmi2OK;
#endif
    fresh(c);
    return fmi2OK;
}
fmi2Component fmi2Instantiate(fmi2String a, fmi2Type t, fmi2String b, fmi2String r, const fmi2CallbackFunctions *k, fmi2Boolean v, fmi2Boolean l) {
#ifdef FAULT_instantiate_null
    return NULL;
#elif defined(FAULT_instantiate_hangs)
    for (;;) sleep(1);
#elif defined(FAULT_instantiate_crashes)
    abort();
#elif defined(FAULT_exits)
    exit(0);
#endif
    C *m = malloc(sizeof *m);
    fresh(m);
    return m;
}
void fmi2FreeInstance(fmi2Component c) {
#ifdef FAULT_free_crashes
    abort();
#endif
    free(c);
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean d, fmi2Real t, fmi2Real s, fmi2Boolean e, fmi2Real z) {
#ifdef FAULT_setup_forgets
    fresh(c);
#endif
    ((C *)c)->time = s;
    ((C *)c)->stop = e ? z : 1.0;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
#ifdef FAULT_init_refused
    return fmi2Error;
#endif
    return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) {
#ifdef FAULT_terminate_refused
    return fmi2Error;
#endif
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
    C *m = c;
    double y[NY];
    g(m->x, y);
#if MODEL == 5
    y[1] = m->p[1] * (m->u[0] - m->x[0]);
#endif
    for (size_t i = 0; i < n; i++) {
        unsigned k = r[i];
        if (k < NP) v[i] = m->p[k];
        else if (k < NP + NU) v[i] = m->u[k - NP];
        else if (k < NP + NU + NY) v[i] = y[k - NP - NU];
        else return fmi2Error;
#ifdef FAULT_nan
        if (k >= NP + NU && m->steps > 50) v[i] = NAN;
#elif defined(FAULT_random)
        if (k >= NP + NU) v[i] += 0.05 * (rand() / (double)RAND_MAX - 0.5);
#elif defined(FAULT_output_stuck)
        if (k >= NP + NU) v[i] = 1.0;
#elif defined(FAULT_get_refused)
        if (k >= NP + NU && m->steps > 50) return fmi2Error;
#endif
    }
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) {
    C *m = c;
    for (size_t i = 0; i < n; i++) {
        unsigned k = r[i];
        if (k < NP) {
#ifdef FAULT_parameters_ignored
            continue;
#endif
#ifdef FAULT_read_once
            if (m->steps > 0) continue;
#endif
            if (m->was_reset) continue;
            m->p[k] = v[i];
        } else if (k < NP + NU) {
#ifdef FAULT_input_refused
            return fmi2Error;
#elif defined(FAULT_input_ignored)
            continue;
#elif defined(FAULT_input_reversed)
            m->u[k - NP] = -v[i];
            continue;
#endif
            m->u[k - NP] = v[i];
        } else return fmi2Error;
    }
    return fmi2OK;
}
/* One step of Runge and Kutta from rates a. */
static void stepped(C *m, double s, const double *a) {
    double b[NX], e[NX], q[NX], w[NX];
    int i;
    for (i = 0; i < NX; i++) w[i] = m->x[i] + s / 2 * a[i];
    f(w, m->u, m->p, b);
    for (i = 0; i < NX; i++) w[i] = m->x[i] + s / 2 * b[i];
    f(w, m->u, m->p, e);
    for (i = 0; i < NX; i++) w[i] = m->x[i] + s * e[i];
    f(w, m->u, m->p, q);
    for (i = 0; i < NX; i++) m->x[i] += s / 6 * (a[i] + 2 * b[i] + 2 * e[i] + q[i]);
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean ns) {
    C *m = c;
#ifdef FAULT_step_hangs
    if (m->steps > 100) for (;;) sleep(1);
#elif defined(FAULT_hangs_without_a_push)
    if (m->steps > 0 && m->u[0] == 0.0) for (;;) sleep(1);
#elif defined(FAULT_hangs_when_pushed_hard)
    if (!(fabs(m->u[0]) < 1e12)) for (;;) sleep(1);
#elif defined(FAULT_step_crashes)
    if (m->steps > 100) abort();
#elif defined(FAULT_step_refused)
    if (m->steps > 100) return fmi2Discard;
#elif defined(FAULT_fatal)
    if (m->steps > 100) return fmi2Fatal;
#elif defined(FAULT_stop_time)
    if (t + h > 1.0) return fmi2Error;
#elif defined(FAULT_stop_told)
    if (t + h > m->stop) return fmi2Error;
#elif defined(FAULT_own_grid)
    if (m->time > t + h - 1e-9) return fmi2OK;
    h = 0.01;
    m->time += h;
#elif defined(FAULT_own_clock) /* its first rates are those of the end of the step before, with the inputs of then */
    while (m->time < t + h) {
        stepped(m, LONGEST, m->d);
        f(m->x, m->u, m->p, m->d);
        m->time += LONGEST;
    }
    return fmi2OK;
#elif defined(FAULT_drifts)
    m->x[0] += 1e-3 * life++ / 1e4;
#elif defined(FAULT_slow)
    usleep(5000);
#elif defined(FAULT_eats)
    { char *p = malloc(1 << 26); if (p) memset(p, 1, 1 << 26); }
#endif
    int count = (int)ceil(h / LONGEST - 1e-9);
    double s = h / count;
    for (int k = 0; k < count; k++) {
        double a[NX];
        f(m->x, m->u, m->p, a);
        stepped(m, s, a);
    }
    m->steps++;
    return fmi2OK;
}
#define NO(name, ...) fmi2Status name(__VA_ARGS__) { return fmi2Error; }
typedef const fmi2ValueReference *VR;
NO(fmi2GetInteger, fmi2Component c, VR r, size_t n, fmi2Integer v[]) NO(fmi2GetBoolean, fmi2Component c, VR r, size_t n, fmi2Boolean v[])
NO(fmi2GetString, fmi2Component c, VR r, size_t n, fmi2String v[]) NO(fmi2SetInteger, fmi2Component c, VR r, size_t n, const fmi2Integer v[])
NO(fmi2SetBoolean, fmi2Component c, VR r, size_t n, const fmi2Boolean v[]) NO(fmi2SetString, fmi2Component c, VR r, size_t n, const fmi2String v[])
NO(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *s) NO(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate s) NO(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *s)
NO(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate s, size_t *n) NO(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n)
NO(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
NO(fmi2GetDirectionalDerivative, fmi2Component c, VR a, size_t n, VR b, size_t m, const fmi2Real x[], fmi2Real y[])
NO(fmi2SetRealInputDerivatives, fmi2Component c, VR r, size_t n, const fmi2Integer o[], const fmi2Real v[])
NO(fmi2GetRealOutputDerivatives, fmi2Component c, VR r, size_t n, const fmi2Integer o[], fmi2Real v[])
NO(fmi2CancelStep, fmi2Component c) NO(fmi2GetStatus, fmi2Component c, const fmi2StatusKind k, fmi2Status *v)
NO(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind k, fmi2Real *v) NO(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind k, fmi2Integer *v)
NO(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) NO(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind k, fmi2String *v)
