/* Room that doubles when it is used up. */
#include "lib/base/list.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define LIST_FIRST 64           /* items of a list that had none */

/* The list's items with room for one more, moved where *room had to be doubled;
 * NULL when there is no memory. */
static char *list_grow(void *list, size_t *room, size_t count, size_t size)
{
    const size_t more = *room ? 2 * *room : LIST_FIRST;
    char *items;

    memcpy(&items, list, sizeof items);
    if (count < *room)
        return items;
    items = realloc(items, more * size);
    if (items) {
        memcpy(list, &items, sizeof items);
        *room = more;
    }
    return items;
}

void *list_add(void *list, size_t *count, size_t *room, size_t size,
               struct error *err)
{
    char *items = list_grow(list, room, *count, size);

    if (items)
        return memset(items + size * (*count)++, 0, size);
    return error_null(err, EX_OSERR, "out of memory");
}

int list_grow_columns(const struct list_column *column, size_t n, size_t *room,
                      size_t count)
{
    size_t more = *room;

    for (size_t i = 0; i < n; i++) {
        more = *room;
        if (!list_grow(column[i].list, &more, count, column[i].size))
            return -1;
    }
    *room = more;
    return 0;
}
