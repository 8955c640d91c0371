/* A slave that runs Python, as slave_core.h wants one: its values lie here, its hidden state in a Python object.
 *
 * The file that includes this defines VARIABLES, STATES_COUNT, RESULTS and PACKAGE, the package of the slave's modules.
 * fmi3_bridge.py is the other side: it sees that memory and calls the slave's methods by their names. */

#include "python_host.h"

/* What stands before `object` is shared with Python. */
typedef struct {
    double real[VARIABLES];
    double states[STATES_COUNT + 1];
    double results[RESULTS + 1];
    int integer[VARIABLES];
    int event;
    int fault;
    char message[LONGEST_MESSAGE];
    void *object; /* the bridge; the saved text is its attribute */
    void *text;
} PythonSlave;

#define SLAVE PythonSlave
#define FIXED_BYTES offsetof(PythonSlave, fault)
#define HIDDEN_TEXT
#define HAS_EVENT(slave) ((slave)->event >= 0)
#define STATES(slave) ((slave)->states)

static const List lists[] = {{0, 0, 0, 0}};

static void *bridge; /* the module */
static struct {
    void *(*import)(const char *);
    void *(*system)(const char *);
    void *(*call)(void *, const char *, const char *, ...);
    void *(*attribute)(void *, const char *);
    void *(*memory)(char *, ptrdiff_t, int);
    void *(*bytes)(const char *, ptrdiff_t);
    int (*bytes_of)(void *, char **, ptrdiff_t *);
    double (*number)(void *);
    void (*release)(void *);
    void (*print)(void);
} python;

static void load_slave(void)
{
    static const struct {
        void **place;
        const char *name;
    } functions[] = {
        {(void **)&python.import, "PyImport_ImportModule"},  {(void **)&python.system, "PySys_GetObject"},
        {(void **)&python.call, "PyObject_CallMethod"},      {(void **)&python.attribute, "PyObject_GetAttrString"},
        {(void **)&python.memory, "PyMemoryView_FromMemory"}, {(void **)&python.bytes, "PyBytes_FromStringAndSize"},
        {(void **)&python.bytes_of, "PyBytes_AsStringAndSize"}, {(void **)&python.number, "PyFloat_AsDouble"},
        {(void **)&python.release, "Py_DecRef"},             {(void **)&python.print, "PyErr_Print"},
    };
    Dl_info here;
    if (!start_python())
        return;
    for (size_t n = 0; n < sizeof functions / sizeof *functions; n++)
        if (!(*functions[n].place = dlsym(RTLD_DEFAULT, functions[n].name))) {
            snprintf(problem, sizeof problem, "the Python in this process lacks %s", functions[n].name);
            return;
        }
    if (owns_python && dladdr((void *)load_slave, &here))
        dlopen(here.dli_fname, RTLD_NOW | RTLD_NOLOAD | RTLD_NODELETE); /* threads call leave_thread when they end */
}

/* Import the slave's package from the resources; return what is wrong, or NULL. */
static const char *open_slave(const char *resources)
{
    if (!resources)
        return "resourcePath must not be null";
    pthread_once(&once, load_slave);
    if (*problem)
        return problem;
    if (bridge)
        return NULL;
    enter_thread();
    const int lock = gil_ensure();
    void *path = python.system("path"), *done = python.call(path, "insert", "is", 0, resources);
    bridge = done ? python.import(PACKAGE ".adapters.fmi3_bridge") : NULL;
    if (!bridge)
        python.print();
    void *removed = python.call(path, "remove", "s", resources);
    if (done)
        python.release(done);
    if (removed)
        python.release(removed);
    gil_release(lock);
    return bridge ? NULL : "the slave's Python modules must be in resourcePath, but cannot be imported";
}

/* Forget all values; the object is made once for each instance. */
static void clear_slave(PythonSlave *s)
{
    void *object = s->object, *text = s->text;
    memset(s, 0, sizeof *s);
    s->object = object;
    s->text = text;
    if (object || !bridge)
        return;
    enter_thread();
    const int lock = gil_ensure();
    void *memory = python.memory((char *)s, offsetof(PythonSlave, object), 0x200); /* writable */
    s->object = memory ? python.call(bridge, "Bridge", "Oiii", memory, VARIABLES, STATES_COUNT, RESULTS) : NULL;
    if (!s->object)
        python.print();
    if (memory)
        python.release(memory);
    gil_release(lock);
}

static void release_slave(PythonSlave *s)
{
    if (!s->object)
        return;
    enter_thread();
    const int lock = gil_ensure();
    if (s->text)
        python.release(s->text);
    void *done = python.call(s->object, "close", "");
    if (done)
        python.release(done);
    python.release(s->object);
    gil_release(lock);
}

/* Call a method of the slave; what it raises is in the shared memory. */
static double call_slave(PythonSlave *s, const char *method, double a, double b, Fault *fault)
{
    double result = 0.0;
    if (!s->object) {
        raise_fault(fault, VALUE_ERROR, "the slave could not be made");
        return result;
    }
    enter_thread();
    const int lock = gil_ensure();
    void *found = python.call(s->object, "call", "sdd", method, a, b);
    if (found) {
        result = python.number(found);
        python.release(found);
    } else {
        python.print();
    }
    gil_release(lock);
    if (!found)
        raise_fault(fault, VALUE_ERROR, "%s", "Python failed");
    else if (s->fault)
        raise_fault(fault, (FaultKind)s->fault, "%s", s->message);
    return result;
}

/* The hidden state as a text, which belongs to the slave. */
static const char *slave_hidden(PythonSlave *s, size_t *length, Fault *fault)
{
    char *text = NULL;
    ptrdiff_t size = 0;
    call_slave(s, "save", 0.0, 0.0, fault);
    if (fault->kind)
        return NULL;
    const int lock = gil_ensure();
    if (s->text)
        python.release(s->text);
    s->text = python.attribute(s->object, "text");
    if (!s->text || python.bytes_of(s->text, &text, &size) != 0)
        raise_fault(fault, VALUE_ERROR, "the hidden state has no text");
    gil_release(lock);
    *length = (size_t)size;
    return text;
}

static void slave_take_hidden(PythonSlave *s, const char *text, size_t length, Fault *fault)
{
    enter_thread();
    const int lock = gil_ensure();
    void *bytes = python.bytes(text, (ptrdiff_t)length);
    void *found = bytes && s->object ? python.call(s->object, "restore", "O", bytes) : NULL;
    if (!found || python.number(found) != 0.0)
        raise_fault(fault, VALUE_ERROR, "the hidden state must be a text of this slave, but is not");
    if (found)
        python.release(found);
    if (bytes)
        python.release(bytes);
    gil_release(lock);
}

#define PLAIN_HOOK(name) \
    static void slave_##name(PythonSlave *s, Fault *fault) { call_slave(s, #name, 0.0, 0.0, fault); }
#define RESULTS_HOOK(name, count) \
    static void slave_##name(PythonSlave *s, double values[], Fault *fault) \
    { \
        call_slave(s, #name, 0.0, 0.0, fault); \
        memcpy(values, s->results, (count) * sizeof *values); \
    }

#ifdef SAMPLE_TIME
PLAIN_HOOK(take_parameters)
PLAIN_HOOK(begin)
PLAIN_HOOK(predict)
PLAIN_HOOK(correct)
#else
PLAIN_HOOK(initialise)
PLAIN_HOOK(refresh)
static void slave_advance(PythonSlave *s, double time, double step, Fault *fault) { call_slave(s, "advance", time, step, fault); }
#endif
#ifdef CONTINUOUS_STATES
RESULTS_HOOK(derivatives, CONTINUOUS_STATES)
RESULTS_HOOK(indicators, INDICATORS)
RESULTS_HOOK(output_rates, OUTPUT_RATES)
PLAIN_HOOK(observe)
#ifdef BEGIN_EXCHANGE
PLAIN_HOOK(begin_exchange)
#else
static void slave_begin_exchange(PythonSlave *s, Fault *fault) { (void)s, (void)fault; }
#endif
static void slave_update(PythonSlave *s, double time, Fault *fault) { call_slave(s, "update", time, 0.0, fault); }
static double slave_advance_to_event(PythonSlave *s, double time, double step, Fault *fault)
{
    return call_slave(s, "advance_to_event", time, step, fault);
}
#endif
#ifdef FOLLOWS_INPUTS
static void slave_take_node(PythonSlave *s, int64_t node, Fault *fault) { call_slave(s, "take_node", (double)node, 0.0, fault); }
static double slave_advance_along(PythonSlave *s, double time, double step, bool to_event, Fault *fault)
{
    return call_slave(s, to_event ? "advance_along_to_event" : "advance_along", time, step, fault);
}
#endif
