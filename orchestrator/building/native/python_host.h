/* A Python for a host that may have none: the process's own, else a libpython that is opened here; see launcher.c. */

#ifndef PYTHON_HOST_H
#define PYTHON_HOST_H

#include <dlfcn.h>
#include <limits.h>
#include <pthread.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <wchar.h>

#ifndef PYTHON_LIBRARY
#define PYTHON_LIBRARY ""
#endif
#ifndef PYTHON_PROGRAM
#define PYTHON_PROGRAM L""
#endif
#define OVERRIDE "FMU_LIBPYTHON"

static pthread_once_t once = PTHREAD_ONCE_INIT;
static char problem[PATH_MAX + 512];
static int owns_python;
static pthread_key_t thread_key;
static int (*gil_ensure)(void);
static void (*gil_release)(int);
static void *(*save_thread)(void);
static void (*restore_thread)(void *);
static void *(*this_thread)(void);

static void *open_python(void) {
    static const char *const names[] = {
        "libpython3.13.so.1.0", "libpython3.12.so.1.0", "libpython3.11.so.1.0",
        "libpython3.10.so.1.0", "libpython3.9.so.1.0",  "libpython3.14.so.1.0",
    };
    const char *override = getenv(OVERRIDE);
    if (override && *override)
        return dlopen(override, RTLD_NOW | RTLD_GLOBAL);
    void *library = *PYTHON_LIBRARY ? dlopen(PYTHON_LIBRARY, RTLD_NOW | RTLD_GLOBAL) : NULL;
    if (library) {
        /* By the program's place this Python finds its own standard library, whatever PATH says. */
        void (*set_program)(const wchar_t *) = (void (*)(const wchar_t *))dlsym(library, "Py_SetProgramName");
        if (set_program && *PYTHON_PROGRAM)
            set_program(PYTHON_PROGRAM);
    }
    for (size_t n = 0; !library && n < sizeof names / sizeof *names; n++)
        library = dlopen(names[n], RTLD_NOW | RTLD_GLOBAL);
    return library;
}

/* A thread of the host keeps its Python thread state for good: making one anew at every call is what costs most. */
static void leave_thread(void *state) {
    if (state) {
        restore_thread(state);
        gil_release(1);
    }
}

static void enter_thread(void) {
    if (owns_python && !this_thread()) {
        gil_ensure();
        pthread_setspecific(thread_key, save_thread());
    }
}

static int start_python(void) {
    if (!dlsym(RTLD_DEFAULT, "_Py_NoneStruct") && !open_python()) {
        const char *reason = dlerror();
        snprintf(problem, sizeof problem,
                 "no Python 3 was found in this process or on this machine (%s): set the environment variable " OVERRIDE
                 " to the path of a libpython3.so, or preload one", reason ? reason : "no libpython");
        return 0;
    }
    int (*is_initialized)(void) = (int (*)(void))dlsym(RTLD_DEFAULT, "Py_IsInitialized");
    void (*initialize)(int) = (void (*)(int))dlsym(RTLD_DEFAULT, "Py_InitializeEx");
    gil_ensure = (int (*)(void))dlsym(RTLD_DEFAULT, "PyGILState_Ensure");
    gil_release = (void (*)(int))dlsym(RTLD_DEFAULT, "PyGILState_Release");
    save_thread = (void *(*)(void))dlsym(RTLD_DEFAULT, "PyEval_SaveThread");
    restore_thread = (void (*)(void *))dlsym(RTLD_DEFAULT, "PyEval_RestoreThread");
    this_thread = (void *(*)(void))dlsym(RTLD_DEFAULT, "PyGILState_GetThisThreadState");
    if (!is_initialized || !initialize || !gil_ensure || !gil_release || !save_thread || !restore_thread || !this_thread) {
        snprintf(problem, sizeof problem, "the Python in this process lacks the functions of Python 3");
        return 0;
    }
    if (!is_initialized()) {
        pthread_key_create(&thread_key, leave_thread);
        initialize(0);
        owns_python = 1;
        save_thread();
    }
    return 1;
}

#endif
