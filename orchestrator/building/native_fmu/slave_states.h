/* Saved states and directional derivatives; a part of slave_core.h.
 *
 * A handle leads to a size and so many bytes: those are what is serialised. They are a header, the slave's fixed part,
 * then each list as its length and its items. */

typedef struct {
    char guid[40];
    uint64_t size;
    Course course;
} Saved;

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

static Status save_state(Instance *s, void **x)
{
    NEW_FAULT(fault);
    recompute(s, &fault);
    if (fault.kind)
        return concluded(s, &fault);
    const size_t size = saved_size(s);
    Saved header = {GUID, size, s->course};
    char *bytes = malloc(sizeof size + size), *end = bytes;
    if (!bytes) {
        say(s, ERROR, "%s failed: MemoryError: %i bytes", s->function, (int64_t)size);
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

static Status restore_state(Instance *s, const void *x)
{
    const char *bytes = x;
    if (!is_ours(bytes)) {
        say(s, ERROR, "%s must be given a state of this very FMU, but was not; ignored", s->function);
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
    s->fresh = true;
    return s->worst;
}

static Status free_state(void **x)
{
    if (x) {
        free(*x);
        *x = NULL;
    }
    return OK;
}

static Status serialised_size(const void *x, size_t *n)
{
    memcpy(n, x, sizeof *n);
    return OK;
}

static Status serialise_state(Instance *s, const void *x, char bytes[], size_t n)
{
    size_t size;
    memcpy(&size, x, sizeof size);
    if (n < size) {
        say(s, ERROR, "%s must be given room for %i bytes, but is for %i", s->function, (int64_t)size, (int64_t)n);
        return s->worst;
    }
    memcpy(bytes, (const char *)x + sizeof size, size);
    return OK;
}

/* What is no state of this FMU is refused when it is set. */
static Status deserialise_state(Instance *s, const char bytes[], size_t n, void **x)
{
    char *copy = malloc(sizeof n + n);
    if (!copy) {
        say(s, ERROR, "%s failed: MemoryError: %i bytes", s->function, (int64_t)n);
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
static Status directional_derivative(Instance *s, const Reference unknown[], size_t n, const Reference known[], size_t m,
                                     const double seed[], double sensitivity[])
{
    double seeds[VARIABLES] = {0.0}, found[VARIABLES];
    char text[64];
    NEW_FAULT(fault);
    if (s->course.phase != INITIALIZING && s->course.phase != STEPPING) {
        say(s, ERROR, "%s must not be called %s", s->function, mode_name(s));
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
    if (fault.kind)
        return concluded(s, &fault);
    for (size_t k = 0; k < n; k++)
        sensitivity[k] = found[unknown[k]];
    return s->worst;
}
#endif

/* The calls of a version of FMI for saved states, by their names there, whose bytes are of its type. */
#define SAVED_STATE_CALLS(get, set, release, size, serialise, restore, Bytes) \
    CALL(get, (Component c, FmuState *x), x != NULL, save_state(s, x)) \
    CALL(set, (Component c, FmuState x), x != NULL, restore_state(s, x)) \
    CALL(release, (Component c, FmuState *x), 1, free_state(x)) \
    CALL(size, (Component c, FmuState x, size_t *n), x != NULL && n != NULL, serialised_size(x, n)) \
    CALL(serialise, (Component c, FmuState x, Bytes bytes[], size_t n), x != NULL && bytes != NULL, serialise_state(s, x, (char *)bytes, n)) \
    CALL(restore, (Component c, const Bytes bytes[], size_t n, FmuState *x), bytes != NULL && x != NULL, deserialise_state(s, (const char *)bytes, n, x))
