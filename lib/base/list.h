/* Lists that grow by one item at a time. */
#ifndef SPID_BASE_LIST_H
#define SPID_BASE_LIST_H

#include <stddef.h>

/* Room for one more in a list of count items of `size` bytes, of which *room
 * fit: the list, moved where *room had to be doubled; the caller frees it.
 * NULL when there is no memory, and list and *room as they were. */
void *list_grow(void *list, size_t *room, size_t count, size_t size);

#endif
