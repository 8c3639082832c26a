/* Room that doubles when it is used up. */
#include "lib/base/list.h"

#include <stdlib.h>

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
