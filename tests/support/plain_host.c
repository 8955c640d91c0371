/* A host without Python, for FMUs of FMI 2.0 of anyone: a life cycle, then the Real outputs that were asked for.
 *
 * usage: plain_host LIBRARY GUID RESOURCES STEPS STEP [REFERENCE]...
 * It prints a line for each reference, and ends with 0, 65 (the library does not load), 66 (no instance) or 67 (a call
 * fails). */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static void log_nothing(void *e, const char *n, int s, const char *c, const char *message, ...) {
    (void)e, (void)n, (void)c;
    if (s > 1)
        fprintf(stderr, "%s\n", message);
}

#define CALL(name, type, ...) ((type)dlsym(library, name))(__VA_ARGS__)
typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
typedef int (*Setup)(void *, int, double, double, int, double);
typedef int (*Plain)(void *);
typedef int (*Reals)(void *, const unsigned *, size_t, double *);
typedef int (*Step)(void *, double, double, int);

int main(int count, char **words) {
    static const Callbacks callbacks = {log_nothing, calloc, free, NULL, NULL};
    if (count < 6)
        return 64;
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 65;
    }
    void *c = CALL("fmi2Instantiate", Instantiate, "host", 1, words[2], words[3], &callbacks, 0, 0);
    if (!c)
        return 66;
    const long steps = atol(words[4]);
    const double h = atof(words[5]);
    if (CALL("fmi2SetupExperiment", Setup, c, 0, 0.0, 0.0, 0, 0.0) > 1 ||
        CALL("fmi2EnterInitializationMode", Plain, c) > 1 || CALL("fmi2ExitInitializationMode", Plain, c) > 1)
        return 67;
    for (long n = 0; n < steps; n++)
        if (CALL("fmi2DoStep", Step, c, (double)n * h, h, 1) > 1)
            return 67;
    for (int n = 6; n < count; n++) {
        const unsigned reference = (unsigned)atol(words[n]);
        double value = 0.0;
        if (CALL("fmi2GetReal", Reals, c, &reference, 1, &value) > 1)
            return 67;
        printf("%.17g\n", value);
    }
    const int ended = CALL("fmi2Terminate", Plain, c);
    ((void (*)(void *))dlsym(library, "fmi2FreeInstance"))(c);
    return ended > 1 ? 67 : 0;
}
