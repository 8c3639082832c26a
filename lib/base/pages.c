/* Whole huge pages from the system; less than half of one from the heap
 * (pages.h). */
#include "lib/base/pages.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#define HUGE ((size_t)2 << 20)  /* bytes of a huge page */

/* Bytes in whole huge pages, 0: it is left to the heap. */
static size_t pages_mapped(size_t bytes)
{
    return bytes < HUGE / 2 ? 0 : (bytes + HUGE - 1) & ~(HUGE - 1);
}

void *pages_alloc(size_t bytes)
{
    if (bytes > SIZE_MAX - 2 * HUGE)
        return NULL;
    const size_t mapped = pages_mapped(bytes), all = mapped + HUGE;

    if (!mapped) {
        const size_t size = (bytes + 64) & ~(size_t)63;
        void *p = aligned_alloc(64, size);

        return p ? memset(p, 0, size) : NULL;
    }
    char *base = mmap(NULL, all, PROT_READ | PROT_WRITE,
                      MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

    if (base == MAP_FAILED)
        return NULL;
    const size_t before = (HUGE - (uintptr_t)base % HUGE) % HUGE;
    if (before)
        munmap(base, before);
    if (before < HUGE)
        munmap(base + before + mapped, HUGE - before);
#ifdef MADV_HUGEPAGE
    madvise(base + before, mapped, MADV_HUGEPAGE);
#endif
    return base + before;
}

void pages_free(void *p, size_t bytes)
{
    if (p && pages_mapped(bytes))
        munmap(p, pages_mapped(bytes));
    else
        free(p);
}
