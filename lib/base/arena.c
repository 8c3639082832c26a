/* A stack of what calloc gave. */
#include "lib/base/arena.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

struct arena_block {
    struct arena_block *before;
    void *memory;
};

void *arena_keep(struct arena *a, void *memory, struct error *err)
{
    struct arena_block *b = memory ? malloc(sizeof *b) : NULL;

    if (!b) {
        if (memory)
            error_set(err, EX_OSERR, "out of memory");
        free(memory);
        return NULL;
    }
    b->memory = memory;
    b->before = __atomic_load_n(&a->last, __ATOMIC_RELAXED);
    while (!__atomic_compare_exchange_n(&a->last, &b->before, b, true,
                                        __ATOMIC_RELEASE, __ATOMIC_RELAXED))
        ;
    return memory;
}

void *arena_take(struct arena *a, size_t count, size_t size)
{
    void *memory = arena_keep(a, calloc(count ? count : 1, size), NULL);

    if (!memory)
        __atomic_store_n(&a->failed, true, __ATOMIC_RELAXED);
    return memory;
}

char *arena_text(struct arena *a, const char *text)
{
    const size_t n = strlen(text) + 1;
    char *copy = arena_take(a, n, 1);

    return copy ? memcpy(copy, text, n) : NULL;
}

int arena_check(const struct arena *a, const char *what, struct error *err)
{
    return __atomic_load_n(&a->failed, __ATOMIC_RELAXED)
               ? error_set(err, EX_OSERR, "out of memory for %s", what) : 0;
}

void arena_release(struct arena *a)
{
    while (a->last) {
        struct arena_block *b = a->last;

        a->last = b->before;
        free(b->memory);
        free(b);
    }
    a->failed = false;
}
