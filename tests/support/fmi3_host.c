/* A host without Python: steps an FMU of FMI 3.0 and prints one output after each step.
 * Arguments: library, token, resources, value reference of an input, its value, of an output, steps, step. */

#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

static void note(void *environment, int status, const char *category, const char *message)
{
    (void)environment;
    (void)category;
    fprintf(stderr, "%i %s\n", status, message);
}

int main(int count, char **words)
{
    if (count != 9)
        return 2;
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 2;
    }
    void *(*make)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned *, size_t, void *,
                  void (*)(void *, int, const char *, const char *), void *) = dlsym(library, "fmi3InstantiateCoSimulation");
    int (*enter)(void *, bool, double, double, bool, double) = dlsym(library, "fmi3EnterInitializationMode");
    int (*leave)(void *) = dlsym(library, "fmi3ExitInitializationMode");
    int (*set)(void *, const unsigned *, size_t, const double *, size_t) = dlsym(library, "fmi3SetFloat64");
    int (*get)(void *, const unsigned *, size_t, double *, size_t) = dlsym(library, "fmi3GetFloat64");
    int (*step)(void *, double, double, bool, bool *, bool *, bool *, double *) = dlsym(library, "fmi3DoStep");
    void (*release)(void *) = dlsym(library, "fmi3FreeInstance");
    void *c = make("instance", words[2], words[3], false, false, false, false, NULL, 0, NULL, note, NULL);
    const unsigned in = (unsigned)atoi(words[4]), out = (unsigned)atoi(words[6]);
    double value = atof(words[5]), reached = 0.0;
    const double h = atof(words[8]);
    bool a, b, d;
    if (!c || enter(c, false, 0.0, 0.0, false, 0.0) || leave(c) || set(c, &in, 1, &value, 1))
        return 1;
    for (int n = 0; n < atoi(words[7]); n++) {
        if (step(c, n * h, h, true, &a, &b, &d, &reached) || get(c, &out, 1, &value, 1))
            return 1;
        printf("%.17g\n", value);
    }
    release(c);
    return 0;
}
