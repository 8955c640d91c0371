/* A host without Python, for the tests: runs an FMU of ours from the folder it is extracted to and prints its outputs.
 *
 * usage: fmu_host LIBRARY GUID RESOURCES STEPS STEP U_AMPLITUDE ALPHA_REFERENCE ALPHA INSTANCES
 * Value references: 0 is u, 2 to 7 are the Real outputs. u = U_AMPLITUDE sin(2 pi t), held over each step. */

#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static void print(void *environment, const char *name, int status, const char *category, const char *message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "[%s %d %s] ", name, status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

#define CALL(type, name) ((type)dlsym(library, name))
typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
typedef int (*Setup)(void *, int, double, double, int, double);
typedef int (*Plain)(void *);
typedef int (*Reals)(void *, const unsigned *, size_t, double *);
typedef int (*Step)(void *, double, double, int);
typedef void (*Free)(void *);

int main(int count, char **words) {
    static const unsigned input[] = {0}, outputs[] = {2, 3, 4, 5, 6, 7};
    static const Callbacks callbacks = {print, calloc, free, NULL, NULL};
    if (count != 10)
        return 64;
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 65;
    }
    const long steps = atol(words[4]), instances = atol(words[9]);
    const double h = atof(words[5]), amplitude = atof(words[6]), alpha = atof(words[8]);
    const unsigned reference[] = {(unsigned)atol(words[7])};
    for (long n = 0; n < instances; n++) {
        double values[6], u = 0.0, parameter = alpha;
        void *c = CALL(Instantiate, "fmi2Instantiate")("host", 1, words[2], words[3], &callbacks, 0, 0);
        if (!c)
            return 66;
        int worst = CALL(Reals, "fmi2SetReal")(c, reference, 1, &parameter);
        worst |= CALL(Setup, "fmi2SetupExperiment")(c, 0, 0.0, 0.0, 0, 0.0);
        worst |= CALL(Plain, "fmi2EnterInitializationMode")(c) | CALL(Plain, "fmi2ExitInitializationMode")(c);
        for (long k = 0; k < steps; k++) {
            u = amplitude * sin(6.283185307179586 * (double)k * h);
            worst |= CALL(Reals, "fmi2SetReal")(c, input, 1, &u) | CALL(Step, "fmi2DoStep")(c, (double)k * h, h, 1);
        }
        worst |= CALL(Reals, "fmi2GetReal")(c, outputs, 6, values) | CALL(Plain, "fmi2Terminate")(c);
        CALL(Free, "fmi2FreeInstance")(c);
        if (worst)
            return 67;
        if (n + 1 == instances)
            printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", values[0], values[1], values[2], values[3], values[4], values[5]);
    }
    return 0;
}
