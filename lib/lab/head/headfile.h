/* A head's file written anew with some of its tensors changed. */
#ifndef SPID_LAB_HEAD_HEADFILE_H
#define SPID_LAB_HEAD_HEADFILE_H

#include <stddef.h>

#include "formats/safetensors.h"
#include "lib/base/arena.h"

enum { HEADFILE_TENSORS = 64, HEADFILE_META = 32 };

struct headfile {
    struct safetensors *st;     /* as it is */
    struct st_tensor tensor[HEADFILE_TENSORS];  /* as it will be */
    size_t count;
    const char *meta[2 * HEADFILE_META + 1];
    struct arena memory;        /* of what is added */
};

/* All tensors but the template avatar's, and the metadata.  -1 and *err; it is
 * closed then. */
int headfile_open(struct headfile *f, const char *path, struct error *err);
/* Free what it holds; a zeroed one is allowed. */
void headfile_close(struct headfile *f);

/* Leave out the tensors whose names begin so. */
void headfile_drop(struct headfile *f, const char *prefix);
/* The tensor of that name is data, borrowed, of dimensions a, b and c; those
 * that are 0 are left out. */
void headfile_put(struct headfile *f, const char *name, enum st_dtype type,
                  const void *data, size_t a, size_t b, size_t c);
/* The same with room for the numbers, zeroed, in f's memory.  NULL and *err. */
void *headfile_add(struct headfile *f, const char *name, enum st_dtype type,
                   size_t a, size_t b, size_t c, struct error *err);

/* Directions `name` (V,3,K), packed (lib/head/runs.h) or plain, in f's memory.
 * NULL and *err. */
float *headfile_directions(struct headfile *f, const char *name, size_t V,
                           size_t K, struct error *err);

/* Write it, which may be over itself. */
int headfile_save(const struct headfile *f, const char *path,
                  struct error *err);

#endif
