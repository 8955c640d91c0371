/* Which messages a host wants: all while it logs, or those of some categories. */

#ifndef LOG_CATEGORIES_H
#define LOG_CATEGORIES_H

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "slave_types.h"

typedef struct {
    bool on;
    size_t count;
    char **categories;
} Wanted;

static bool is_wanted(const Wanted *wanted, Status status, const char *category)
{
    if (status != OK)
        return true; /* refusals and warnings are for everyone */
    for (size_t n = 0; n < wanted->count; n++)
        if (wanted->on && category && strcmp(category, wanted->categories[n]) == 0)
            return true;
    return wanted->on && wanted->count == 0;
}

static char *copied(const char *text)
{
    char *copy = malloc(strlen(text) + 1);
    return copy ? strcpy(copy, text) : NULL;
}

static void forget_categories(Wanted *wanted)
{
    for (size_t n = 0; n < wanted->count; n++)
        free(wanted->categories[n]);
    free(wanted->categories);
    wanted->categories = NULL;
    wanted->count = 0;
}

static Status set_logging(Wanted *wanted, bool on, size_t n, const char *const categories[])
{
    forget_categories(wanted);
    wanted->on = on;
    wanted->categories = n && categories ? calloc(n, sizeof *wanted->categories) : NULL;
    for (size_t k = 0; wanted->categories && k < n; k++)
        if (categories[k] && (wanted->categories[wanted->count] = copied(categories[k])) != NULL)
            wanted->count++;
    return OK;
}

#endif
