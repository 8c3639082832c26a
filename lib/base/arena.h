/* Memory with one owner: taken piece by piece, asked about once, and given back
 * all together. */
#ifndef SPID_BASE_ARENA_H
#define SPID_BASE_ARENA_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

struct arena {                  /* zeroed: nothing is taken */
    struct arena_block *last;
    bool failed;                /* some piece could not be had */
};

/* `count` items of `size` bytes, zeroed, until arena_release; a count of 0 is
 * allowed, and several threads are.  NULL when there is no memory, which
 * arena_check tells of: nothing taken is to be touched before it was asked. */
void *arena_take(struct arena *a, size_t count, size_t size);
/* A copy of the text, as arena_take gives memory. */
char *arena_text(struct arena *a, const char *text);
/* What malloc gave becomes the arena's.  NULL and *err without memory, and for
 * NULL, of which whoever made it has told. */
void *arena_keep(struct arena *a, void *memory, struct error *err);
/* 0 when all that was asked for is there, else -1 and *err, "out of memory for
 * WHAT". */
int arena_check(const struct arena *a, const char *what, struct error *err);
/* Give everything back; zeroed then. */
void arena_release(struct arena *a);

#endif
