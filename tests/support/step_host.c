/* A host without Python for tests and benchmarks: steps one FMU and prints what came out.
 *
 * usage: step_host LIBRARY GUID STEPS STEP AMPLITUDE FREQUENCY OUTPUTS TIMED [REFERENCE=VALUE | i:REFERENCE=VALUE]...
 * Value reference 0 is the input u = AMPLITUDE sin(2 pi FREQUENCY t), held over each step; the Real outputs are the
 * references 2 to OUTPUTS + 1, the Integer output is the next one. It prints nanoseconds of processor time a step (input, step), those of the
 * longest step if TIMED, how often the Integer changed, a hash of all bits of all outputs and of the Integer alone, and
 * the last outputs in hexadecimal. The input is computed by a recursion, so that no libm is in it. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(name) ((void *)GetProcAddress((HMODULE)library, name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(name) dlsym(library, name)
#endif

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static void print(void *environment, const char *name, int status, const char *category, const char *message, ...)
{
    (void)environment;
    fprintf(stderr, "[%s %d %s] %s\n", name, status, category, message);
}

typedef void *(*Instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
typedef int (*Setup)(void *, int, double, double, int, double);
typedef int (*Plain)(void *);
typedef int (*SetReals)(void *, const unsigned *, size_t, const double *);
typedef int (*SetIntegers)(void *, const unsigned *, size_t, const int *);
typedef int (*GetReals)(void *, const unsigned *, size_t, double *);
typedef int (*GetIntegers)(void *, const unsigned *, size_t, int *);
typedef int (*Step)(void *, double, double, int);

/* Processor time where there is such a clock, so that other work on the machine does not count. */
static double now(void)
{
    struct timespec t;
#ifdef CLOCK_THREAD_CPUTIME_ID
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
#else
    timespec_get(&t, TIME_UTC);
#endif
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static uint64_t hashed(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *bytes = data;
    for (size_t n = 0; n < size; n++)
        hash = (hash ^ bytes[n]) * 1099511628211u;
    return hash;
}

int main(int count, char **words)
{
    static const Callbacks callbacks = {print, calloc, free, NULL, NULL};
    if (count < 9)
        return 64;
    void *library = OPEN(words[1]);
    if (!library)
        return 65;
    const long steps = atol(words[3]), outputs = atol(words[7]), timed = atol(words[8]);
    const double h = atof(words[4]), amplitude = atof(words[5]), turn = 6.283185307179586 * atof(words[6]) * h;
    void *c = ((Instantiate)FIND("fmi2Instantiate"))("host", 1, words[2], "", &callbacks, 0, 0);
    SetReals set_real = (SetReals)FIND("fmi2SetReal");
    GetReals get_real = (GetReals)FIND("fmi2GetReal");
    GetIntegers get_integer = (GetIntegers)FIND("fmi2GetInteger");
    Step do_step = (Step)FIND("fmi2DoStep");
    int worst = 0;
    if (!c)
        return 66;
    for (int n = 9; n < count; n++) {
        const int whole = strncmp(words[n], "i:", 2) == 0;
        const unsigned reference = (unsigned)atol(words[n] + 2 * whole);
        const double value = atof(strchr(words[n], '=') + 1);
        const int integer = (int)value;
        worst |= whole ? ((SetIntegers)FIND("fmi2SetInteger"))(c, &reference, 1, &integer)
                       : set_real(c, &reference, 1, &value);
    }
    worst |= ((Setup)FIND("fmi2SetupExperiment"))(c, 0, 0.0, 0.0, 0, 0.0);
    worst |= ((Plain)FIND("fmi2EnterInitializationMode"))(c) | ((Plain)FIND("fmi2ExitInitializationMode"))(c);
    unsigned references[64];
    double values[64], s = 0.0, k = 1.0, spent = 0.0, longest = 0.0;
    for (long n = 0; n < outputs; n++)
        references[n] = (unsigned)n + 2;
    const unsigned integer_reference = (unsigned)outputs + 2;
    int contact = 0, before = 0, changes = 0;
    uint64_t hash = 14695981039346656037u, modes = hash;
    const clock_t begin = clock(); /* processor time, so that other work on the machine counts little */
    for (long n = 0; n < steps; n++) {
        const unsigned input = 0;
        const double u = amplitude * s, start = timed ? now() : 0.0;
        worst |= set_real(c, &input, 1, &u) | do_step(c, (double)n * h, h, 1);
        if (timed) {
            const double took = now() - start;
            longest = took > longest ? took : longest;
        }
        s += turn * k; /* the symplectic oscillator: sine and cosine without libm */
        k -= turn * s;
        if (timed || n == steps - 1) {
            worst |= get_real(c, references, (size_t)outputs, values) | get_integer(c, &integer_reference, 1, &contact);
            changes += contact != before;
            before = contact;
            hash = hashed(hash, values, (size_t)outputs * sizeof *values);
            modes = hashed(modes, &contact, sizeof contact);
        }
    }
    spent = 1e9 * (double)(clock() - begin) / CLOCKS_PER_SEC;
    printf("%d %.2f %.0f %d %016llx %016llx", worst, spent / (double)steps, longest, changes, (unsigned long long)hash,
           (unsigned long long)modes);
    for (long n = 0; n < outputs; n++)
        printf(" %a", values[n]);
    printf("\n");
    return 0;
}
