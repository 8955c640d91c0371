/* The Linux binary of our FMUs: gives a host without Python a Python, then hands every FMI call on to PythonFMU's library.
 *
 * PythonFMU's library leaves Python's symbols undefined, so that it loads in Python hosts only. To name libpython
 * as a needed library would tie the FMU to one version and load a second copy into Python hosts. So this library, which
 * needs nothing but libc, looks first: where the process has Python's symbols already, they are used, else a libpython
 * is opened with RTLD_GLOBAL (extension modules of the standard library resolve against it). Only then is
 * PythonFMU's library opened, from the folder in which this one lies.
 *
 * A Python that was started here is never finalised: other FMUs may still use it, and hosts that unload in their own
 * order crash otherwise. Signal handlers stay the host's. PythonFMU's library cannot be unloaded either (its C++ has
 * unique symbols), so all FMUs in a process that bring the same one (its name carries its hash) share it.
 *
 * On the way it mends what that library cannot do: it refuses a wrong GUID, never enters an instance again after
 * fmi2Fatal, and returns the worst status that a call has logged, so that what our slaves refuse is seen as refused. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <limits.h>
#include <link.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2_calls.h"
#include "log_categories.h"
#include "python_host.h"

#ifndef WRAPPER
#define WRAPPER "libpythonfmu-export.so"
#endif

#define TABLE_ENTRY(name, parameters, arguments, condition) Status(*name) parameters;
static struct {
    FORWARDED(TABLE_ENTRY)
    Component (*fmi2Instantiate)(const char *, int, const char *, const char *, const Callbacks *, Boolean, Boolean);
    void (*fmi2FreeInstance)(Component);
    Status (*fmi2FreeFMUstate)(Component, FmuState *);
} wrapper;

typedef struct {
    Component inner;
    Callbacks host;
    Callbacks ours;
    Status worst;
    int dead;
    Wanted wanted;
    char *name;
} Shell;

static int is_wrapper(struct dl_phdr_info *info, size_t size, void *found) {
    (void)size;
    const char *slash = info->dlpi_name ? strrchr(info->dlpi_name, '/') : NULL;
    if (!slash || strcmp(slash + 1, WRAPPER) != 0 || strlen(info->dlpi_name) >= PATH_MAX)
        return 0;
    strcpy(found, info->dlpi_name);
    return 1;
}

static void load(void) {
    Dl_info here;
    char path[PATH_MAX];
    if (!start_python())
        return;
    if (!dladdr((void *)load, &here) || strlen(here.dli_fname) + sizeof WRAPPER >= sizeof path) {
        snprintf(problem, sizeof problem, "the folder of the FMU's binary was not found");
        return;
    }
    if (owns_python)
        dlopen(here.dli_fname, RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE); /* threads call leave_thread when they end */
    if (!dl_iterate_phdr(is_wrapper, path)) {
        strcpy(path, here.dli_fname);
        char *slash = strrchr(path, '/');
        strcpy(slash ? slash + 1 : path, WRAPPER);
    }
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        snprintf(problem, sizeof problem, "%s", dlerror());
        return;
    }
#define TABLE_LOOKUP(name, parameters, arguments, condition) *(void **)&wrapper.name = dlsym(library, #name);
    FORWARDED(TABLE_LOOKUP)
    TABLE_LOOKUP(fmi2FreeInstance, , , )
    TABLE_LOOKUP(fmi2FreeFMUstate, , , )
    TABLE_LOOKUP(fmi2Instantiate, , , )
    if (!wrapper.fmi2Instantiate)
        snprintf(problem, sizeof problem, "%s is not PythonFMU's library", path);
}

/* --- Messages ---------------------------------------------------------------------------------------------------- */

/* Messages come ready: PythonFMU never passes further arguments. */
static void relay(void *environment, const char *instance, Status status, const char *category, const char *message, ...) {
    Shell *s = environment;
    (void)instance;
    if (status > s->worst && status <= FATAL)
        s->worst = status;
    if (s->host.logger && is_wanted(&s->wanted, status, category))
        s->host.logger(s->host.environment, s->name, status, category ? category : "", message);
}

static void report(const Callbacks *host, const char *name, const char *message) {
    if (host && host->logger)
        host->logger(host->environment, name, ERROR, "logStatusError", "%s", message);
    else
        fprintf(stderr, "%s: %s\n", name, message);
}

/* --- Instances --------------------------------------------------------------------------------------------------- */

static int hex(char c) {
    if (c >= '0' && c <= '9')
        return c - '0';
    c |= 0x20;
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* file:///a%20b, file:/a%20b and file://localhost/a%20b are all /a b. */
static void path_of(const char *uri, char path[PATH_MAX]) {
    size_t n = 0;
    const int encoded = strncmp(uri, "file:", 5) == 0;
    if (encoded) {
        uri += 5;
        if (strncmp(uri, "//", 2) == 0) {
            const char *root = strchr(uri + 2, '/');
            uri = root ? root : uri + 2;
        }
    }
    for (; *uri && n + 1 < PATH_MAX; uri++) {
        if (encoded && *uri == '%' && hex(uri[1]) >= 0 && hex(uri[2]) >= 0) {
            path[n++] = (char)(hex(uri[1]) * 16 + hex(uri[2]));
            uri += 2;
        } else {
            path[n++] = *uri;
        }
    }
    while (n > 1 && path[n - 1] == '/')
        n--;
    path[n] = '\0';
}

static const char *refusal(const char *name, int type, const char *guid, const char *uri, char path[PATH_MAX]) {
    static char message[256];
    char file[PATH_MAX + 16], expected[64] = "";
    if (!name || !*name)
        return "instanceName must not be empty";
    if (type != 1)
        return "fmuType must be fmi2CoSimulation: this FMU has no model exchange";
    if (!uri || !guid)
        return "fmuGUID and fmuResourceLocation must not be null";
    pthread_once(&once, load);
    if (*problem)
        return problem;
    path_of(uri, path);
    snprintf(file, sizeof file, "%s/guid.txt", path);
    FILE *stream = fopen(file, "r");
    if (!stream)
        return "fmuResourceLocation must be the URI of the FMU's resources folder, but that folder lacks guid.txt";
    const int found = fscanf(stream, "%63s", expected);
    fclose(stream);
    if (found != 1 || strcmp(expected, guid) != 0) {
        snprintf(message, sizeof message, "fmuGUID must be %s, but is %.64s", expected, guid);
        return message;
    }
    return NULL;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void fmi2FreeInstance(Component c);

EXPORT Component fmi2Instantiate(const char *name, int type, const char *guid, const char *uri, const Callbacks *host,
                                 Boolean visible, Boolean logging) {
    char path[PATH_MAX];
    const char *message = refusal(name, type, guid, uri, path);
    if (message) {
        report(host, name ? name : "", message);
        return NULL;
    }
    Shell *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    if (host)
        s->host = *host;
    s->ours = s->host;
    s->ours.logger = relay;
    s->ours.environment = s;
    s->wanted.on = logging;
    s->name = strdup(name);
    enter_thread();
    s->inner = wrapper.fmi2Instantiate(name, type, guid, path, &s->ours, visible, 1);
    if (s->inner)
        return s;
    s->dead = 1;
    fmi2FreeInstance(s);
    return NULL;
}

EXPORT void fmi2FreeInstance(Component c) {
    Shell *s = c;
    if (!s)
        return;
    if (!s->dead) {
        enter_thread();
        wrapper.fmi2FreeInstance(s->inner);
    }
    forget_categories(&s->wanted);
    free(s->name);
    free(s);
}

EXPORT Status fmi2SetDebugLogging(Component c, Boolean on, size_t n, const char *const categories[]) {
    Shell *s = c;
    if (!s)
        return ERROR;
    return set_logging(&s->wanted, on, n, categories);
}

/* Of the statuses returned and logged, the worse; fmi2Fatal is the last thing that an instance says. */
static Status concluded(Shell *s, Status status) {
    if (s->worst > status)
        status = s->worst;
    if (status == FATAL)
        s->dead = 1;
    return status;
}

static int all_there(const char *const texts[], size_t n) {
    for (size_t k = 0; k < n; k++)
        if (!texts[k])
            return 0;
    return 1;
}

#define FORWARD(function, parameters, arguments, condition) \
    EXPORT Status function parameters { \
        Shell *s = c; \
        if (!s) \
            return ERROR; \
        if (s->dead) \
            return FATAL; \
        s->worst = OK; \
        if (!(condition)) { \
            report(&s->host, s->name, #function " must not be given null pointers"); \
            return ERROR; \
        } \
        enter_thread(); \
        return concluded(s, wrapper.function arguments); \
    }
FORWARDED(FORWARD)

EXPORT Status fmi2FreeFMUstate(Component c, FmuState *x) {
    Shell *s = c;
    if (!s)
        return ERROR;
    if (!x || !*x)
        return OK;
    enter_thread();
    Status status = s->dead ? FATAL : wrapper.fmi2FreeFMUstate(s->inner, x);
    *x = NULL;
    return status;
}

/* A refused step is no wish to end the simulation, as which PythonFMU's library takes it. */
EXPORT Status fmi2GetBooleanStatus(Component c, int kind, Boolean *value) {
    enum { TERMINATED = 3 };
    Shell *s = c;
    if (!s || kind != TERMINATED || !value)
        return DISCARD;
    *value = 0;
    return OK;
}
