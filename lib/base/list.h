/* Lists that grow by one item at a time. */
#ifndef SPID_BASE_LIST_H
#define SPID_BASE_LIST_H

#include <stddef.h>

#include "lib/base/error.h"

/* One more item of `size` bytes, zeroed, in a list of *count, of which *room
 * fit; `list` is where the pointer to its items is, which the caller frees.
 * NULL and *err when there is no memory, and all as it was. */
void *list_add(void *list, size_t *count, size_t *room, size_t size,
               struct error *err);

/* One of several lists of one length. */
struct list_column {
    void *list;         /* where the pointer to its items is */
    size_t size;        /* bytes of an item */
};
/* Room for one more item in each of n columns; -1 when there is no memory. */
int list_grow_columns(const struct list_column *column, size_t n, size_t *room,
                      size_t count);

#endif
