/* Room that doubles when it is used up. */
#include "lib/base/list.h"

#include <stdlib.h>
#include <string.h>

#define LIST_FIRST 64           /* items of a list that had none */

void *list_grow(void *list, size_t *room, size_t count, size_t size)
{
    size_t more = *room ? 2 * *room : LIST_FIRST;
    void *grown = list;

    if (count < *room)
        return list;
    grown = realloc(list, more * size);
    if (grown)
        *room = more;
    return grown;
}

int list_grow_columns(const struct list_column *column, size_t n, size_t *room,
                      size_t count)
{
    size_t more = *room;

    for (size_t i = 0; i < n; i++) {
        void *list;

        more = *room;
        memcpy(&list, column[i].list, sizeof list);
        list = list_grow(list, &more, count, column[i].size);
        if (!list)
            return -1;
        memcpy(column[i].list, &list, sizeof list);
    }
    *room = more;
    return 0;
}
