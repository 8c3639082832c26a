/* One block of memory handed out to many arrays. */
#include "lib/avatar/slices.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

/* Hand out parts of one block; with block NULL only count. */
static size_t slices_deal(const struct slice *slices, size_t count,
                          bool training, float *block)
{
    size_t total = 0;

    for (size_t i = 0; i < count; i++) {
        if (slices[i].train && !training)
            continue;
        if (block)
            *slices[i].at = block + total;
        total += (slices[i].n + 15) / 16 * 16;
    }
    return total;
}

int slices_allocate(float **block, const struct slice *slices, size_t count,
                    bool training, struct error *err)
{
    size_t bytes = slices_deal(slices, count, training, NULL) *
                   sizeof(float);

    free(*block);
    *block = aligned_alloc(64, bytes ? bytes : 64);
    if (!*block)
        return error_set(err, EX_OSERR, "no memory for an avatar (%zu MB)",
                         bytes >> 20);
    memset(*block, 0, bytes);
    slices_deal(slices, count, training, *block);
    return 0;
}
