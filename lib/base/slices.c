/* One block of memory handed out to many arrays. */
#include "lib/base/slices.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#define ALIGN 64

/* Hand out parts of one block; with block NULL only count.  A pointer is
 * copied, not assigned through a float **, which uint8_t *p is not (C17
 * 6.5p7); POSIX has one representation for all of them. */
static size_t slices_lay_out(const struct slice *slices, size_t count,
                             bool training, float *block)
{
    size_t total = 0;

    for (size_t i = 0; i < count; i++) {
        if (slices[i].train && !training)
            continue;
        if (block)
            memcpy(slices[i].at, &(float *){block + total}, sizeof block);
        total += (slices[i].n + 15) / 16 * 16;
    }
    return total;
}

int slices_allocate(float **block, const struct slice *slices, size_t count,
                    bool training, struct error *err)
{
    size_t bytes = slices_lay_out(slices, count, training, NULL) *
                   sizeof(float);

    free(*block);
    *block = calloc(1, bytes + ALIGN);
    if (!*block)
        return error_set(err, EX_OSERR, "no memory for %zu MB of arrays",
                         bytes >> 20);
    const size_t past = (uintptr_t)*block % ALIGN;
    slices_lay_out(slices, count, training,
                   *block + (ALIGN - past) % ALIGN / sizeof **block);
    return 0;
}
