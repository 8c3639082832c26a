/* Many arrays in one block of memory: a table says which pointer gets how
 * many floats. */
#ifndef SPID_BASE_SLICES_H
#define SPID_BASE_SLICES_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

struct slice {
    void *at;       /* address of the pointer to set, to whatever type */
    size_t n;       /* floats, or as much memory */
    bool train;     /* only needed for a backward */
};

/* Allocate one zeroed block, whose pages become memory when they are touched,
 * and point the slices into it, each at 64 bytes; those with `train` only when
 * training, the others keep their pointer.  *block is freed first; the caller
 * frees it with free(). */
int slices_allocate(float **block, const struct slice *slices, size_t count,
                    bool training, struct error *err);

#endif
