/* Leaves an exception of Python in the calling thread, as wrappers of Python slaves do that forget to clear one. */
#include <dlfcn.h>

static void leave_exception(void) {
    void *python = dlopen(NULL, RTLD_LAZY);
    int (*ensure)(void) = (int (*)(void))dlsym(python, "PyGILState_Ensure");
    void (*release)(int) = (void (*)(int))dlsym(python, "PyGILState_Release");
    void (*set)(void *, const char *) = (void (*)(void *, const char *))dlsym(python, "PyErr_SetString");
    void **kind = (void **)dlsym(python, "PyExc_TypeError");
    int held = ensure();
    set(*kind, "nobody cleared me");
    release(held);
}
