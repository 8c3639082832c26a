/* Lists that grow by one item at a time. */
#ifndef SPID_BASE_LIST_H
#define SPID_BASE_LIST_H

#include <stddef.h>

/* Room for one more in a list of count items of `size` bytes, of which *room
 * fit: the list, moved where *room had to be doubled; the caller frees it.
 * NULL when there is no memory, and list and *room as they were. */
void *list_grow(void *list, size_t *room, size_t count, size_t size);

/* One of several lists of one length. */
struct list_column {
    void *list;         /* where the pointer to its items is */
    size_t size;        /* bytes of an item */
};
/* Room for one more item in each of n columns; -1 when there is no memory. */
int list_grow_columns(const struct list_column *column, size_t n, size_t *room,
                      size_t count);

#endif
