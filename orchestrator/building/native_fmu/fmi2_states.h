/* Saved states and the calls that these FMUs do not support; a part of fmi2_slave.h. */

/* --- Saved states ------------------------------------------------------------------------------------------------------
 * A handle leads to a size and so many bytes: those are what is serialised. */

static int64_t length_of(const Instance *s, const List *list)
{
    int64_t n;
    memcpy(&n, (const char *)&s->slave + list->place, sizeof n);
    return n;
}

static size_t saved_size(const Instance *s)
{
    size_t size = sizeof(Saved) + FIXED_BYTES;
    for (const List *list = lists; list->item_size; list++)
        size += sizeof(int64_t) + (size_t)length_of(s, list) * list->item_size;
    return size;
}

EXPORT Status FMI(fmi2GetFMUstate)(Component c, FmuState *x)
{
    Fault fault;
    ENTER(fmi2GetFMUstate, x != NULL)
    fault.kind = NO_FAULT;
    recompute(s, &fault);
    if (fault.kind) {
        say_fault(s, "fmi2GetFMUstate", &fault);
        return s->worst;
    }
    const size_t size = saved_size(s);
    Saved header = {GUID, size, s->course};
    char *bytes = malloc(sizeof size + size), *end = bytes;
    if (!bytes) {
        say(s, ERROR, "fmi2GetFMUstate failed: MemoryError: %i bytes", (int64_t)size);
        return s->worst;
    }
    memcpy(end, &size, sizeof size);
    memcpy(end += sizeof size, &header, sizeof header);
    memcpy(end += sizeof header, &s->slave, FIXED_BYTES);
    end += FIXED_BYTES;
    for (const List *list = lists; list->item_size; list++) {
        const int64_t n = length_of(s, list);
        memcpy(end, &n, sizeof n);
        memcpy(end += sizeof n, (const char *)&s->slave + list->items, (size_t)n * list->item_size);
        end += (size_t)n * list->item_size;
    }
    free(*x);
    *x = bytes;
    return s->worst;
}

/* Tell whether bytes are a state of this very FMU, whole and with every length within its bounds. */
static bool is_ours(const char *bytes)
{
    Saved header;
    size_t left;
    memcpy(&left, bytes, sizeof left);
    bytes += sizeof left;
    if (left < sizeof header + FIXED_BYTES)
        return false;
    memcpy(&header, bytes, sizeof header);
    if (memcmp(header.guid, GUID, sizeof GUID) != 0 || header.size != left)
        return false;
    if (header.course.phase < INSTANTIATED || header.course.phase > TERMINATED)
        return false;
    left -= sizeof header + FIXED_BYTES;
    bytes += sizeof header + FIXED_BYTES;
    for (const List *list = lists; list->item_size; list++) {
        int64_t n;
        if (left < sizeof n)
            return false;
        memcpy(&n, bytes, sizeof n);
        left -= sizeof n;
        if (n < 0 || n > list->capacity || left < (size_t)n * list->item_size)
            return false;
        bytes += sizeof n + (size_t)n * list->item_size;
        left -= (size_t)n * list->item_size;
    }
    return left == 0;
}

EXPORT Status FMI(fmi2SetFMUstate)(Component c, FmuState x)
{
    ENTER(fmi2SetFMUstate, x != NULL)
    const char *bytes = x;
    if (!is_ours(bytes)) {
        say(s, ERROR, "fmi2SetFMUstate must be given a state of this very FMU, but was not; ignored");
        return s->worst;
    }
    Saved header;
    bytes += sizeof(size_t);
    memcpy(&header, bytes, sizeof header);
    s->course = header.course;
    memcpy(&s->slave, bytes += sizeof header, FIXED_BYTES);
    bytes += FIXED_BYTES;
    for (const List *list = lists; list->item_size; list++) {
        int64_t n;
        memcpy(&n, bytes, sizeof n);
        memcpy((char *)&s->slave + list->place, &n, sizeof n);
        memcpy((char *)&s->slave + list->items, bytes += sizeof n, (size_t)n * list->item_size);
        bytes += (size_t)n * list->item_size;
    }
    s->fresh = 1;
    return s->worst;
}

EXPORT Status FMI(fmi2FreeFMUstate)(Component c, FmuState *x)
{
    ENTER(fmi2FreeFMUstate, 1)
    if (x) {
        free(*x);
        *x = NULL;
    }
    return OK;
}

EXPORT Status FMI(fmi2SerializedFMUstateSize)(Component c, FmuState x, size_t *n)
{
    ENTER(fmi2SerializedFMUstateSize, x != NULL && n != NULL)
    memcpy(n, x, sizeof *n);
    return OK;
}

EXPORT Status FMI(fmi2SerializeFMUstate)(Component c, FmuState x, char bytes[], size_t n)
{
    size_t size;
    ENTER(fmi2SerializeFMUstate, x != NULL && bytes != NULL)
    memcpy(&size, x, sizeof size);
    if (n < size) {
        say(s, ERROR, "fmi2SerializeFMUstate must be given room for %i bytes, but is for %i", (int64_t)size, (int64_t)n);
        return s->worst;
    }
    memcpy(bytes, (const char *)x + sizeof size, size);
    return OK;
}

EXPORT Status FMI(fmi2DeSerializeFMUstate)(Component c, const char bytes[], size_t n, FmuState *x)
{
    ENTER(fmi2DeSerializeFMUstate, bytes != NULL && x != NULL)
    /* What is no state of this FMU is refused when it is set. */
    char *copy = malloc(sizeof n + n);
    if (!copy) {
        say(s, ERROR, "fmi2DeSerializeFMUstate failed: MemoryError: %i bytes", (int64_t)n);
        return s->worst;
    }
    memcpy(copy, &n, sizeof n);
    memcpy(copy + sizeof n, bytes, n);
    free(*x);
    *x = copy;
    return OK;
}

/* --- Directional derivatives ------------------------------------------------------------------------------------------- */

#ifdef DIRECTIONAL
static bool is_known(Reference r)
{
    const bool state = r >= FIRST_STATE && r < FIRST_STATE + CONTINUOUS_STATES;
    return state || (HAS(r, REAL_VALUE) && variables[r].causality == INPUT);
}

static bool is_unknown(Reference r)
{
    for (size_t n = 0; n < DIRECTIONAL; n++)
        if (directional_unknowns[n] == r)
            return true;
    return false;
}

/* Of derivatives and outputs by states and inputs, in the mode of the moment. */
EXPORT Status FMI(fmi2GetDirectionalDerivative)(Component c, const Reference unknown[], size_t n, const Reference known[],
                                                size_t m, const double seed[], double sensitivity[])
{
    double seeds[VARIABLES] = {0.0}, found[VARIABLES];
    char text[64];
    Fault fault;
    ENTER(fmi2GetDirectionalDerivative, (n == 0 || (unknown && sensitivity)) && (m == 0 || (known && seed)))
    fault.kind = NO_FAULT;
    if (s->course.phase != INITIALIZING && s->course.phase != STEPPING) {
        say(s, ERROR, "fmi2GetDirectionalDerivative must not be called %s", phase_names[s->course.phase]);
        return s->worst;
    }
    for (size_t k = 0; k < m; k++) {
        if (!is_known(known[k])) {
            say(s, ERROR, "%s must be a state or a Real input, but is not", name_of(known[k], text));
            return s->worst;
        }
        seeds[known[k]] = seed[k];
    }
    for (size_t k = 0; k < n; k++)
        if (!is_unknown(unknown[k])) {
            say(s, ERROR, "%s must be a derivative or a Real output, but is not", name_of(unknown[k], text));
            return s->worst;
        }
    recompute(s, &fault);
    if (!fault.kind)
        slave_directional(&s->slave, seeds, found, &fault);
    if (fault.kind) {
        say_fault(s, "fmi2GetDirectionalDerivative", &fault);
        return s->worst;
    }
    for (size_t k = 0; k < n; k++)
        sensitivity[k] = found[unknown[k]];
    return s->worst;
}
#endif

/* --- Not supported ----------------------------------------------------------------------------------------------------- */

#define UNSUPPORTED(status, function, parameters) \
    EXPORT Status FMI(function) parameters \
    { \
        ENTER(function, 1) \
        say(s, status, "FMI function not supported: %s", #function); \
        return s->worst; \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#ifndef DIRECTIONAL
UNSUPPORTED(ERROR, fmi2GetDirectionalDerivative, (Component c, const Reference u[], size_t n, const Reference k[], size_t m,
                                                  const double dk[], double du[]))
#endif
UNSUPPORTED(ERROR, fmi2SetRealInputDerivatives,
            (Component c, const Reference r[], size_t n, const int o[], const double v[]))
UNSUPPORTED(ERROR, fmi2GetRealOutputDerivatives, (Component c, const Reference r[], size_t n, const int o[], double v[]))
UNSUPPORTED(ERROR, fmi2CancelStep, (Component c))
UNSUPPORTED(ERROR, fmi2GetStatus, (Component c, int kind, Status *v))
UNSUPPORTED(DISCARD, fmi2GetIntegerStatus, (Component c, int kind, int *v))
UNSUPPORTED(DISCARD, fmi2GetStringStatus, (Component c, int kind, const char **v))
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

EXPORT Status FMI(fmi2GetRealStatus)(Component c, int kind, double *v)
{
    enum { LAST_SUCCESSFUL_TIME = 2 };
    ENTER(fmi2GetRealStatus, v != NULL)
    if (kind != LAST_SUCCESSFUL_TIME) {
        say(s, DISCARD, "Invalid status inquiry for fmi2GetRealStatus");
        return s->worst;
    }
    *v = s->course.time;
    return OK;
}

/* A refused step is no wish to end the simulation. */
EXPORT Status FMI(fmi2GetBooleanStatus)(Component c, int kind, Boolean *v)
{
    enum { TERMINATED_STATUS = 3 };
    ENTER(fmi2GetBooleanStatus, v != NULL)
    if (kind != TERMINATED_STATUS)
        return DISCARD;
    *v = 0;
    return OK;
}
