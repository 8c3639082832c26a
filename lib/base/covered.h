/* The covered pixels of a picture: those whose alpha is not 0, row after row.
 * Features are premultiplied, so the others are 0, and of a portrait they are
 * most: a FEAT record is a third as long without them. */
#ifndef SPID_BASE_COVERED_H
#define SPID_BASE_COVERED_H

#include <stddef.h>
#include <sys/uio.h>

/* Where the covered pixels of a picture lie in it; zeroed at first. */
struct covered {
    struct iovec *run;          /* (runs), in order: packed when joined */
    size_t runs, room;
    size_t pixels;              /* in all of them */
};

/* Those of n pixels of so many bytes each; the runs point into image.  0, or
 * -1 when there is no memory. */
int covered_find(struct covered *c, const void *image, const float *alpha,
                 size_t n, size_t bytes);
/* Free what it holds; zeroed then. */
void covered_release(struct covered *c);

/* The way back: image (n pixels) <- count packed ones, and zeros between.
 * -1 when alpha covers another number of pixels. */
int covered_unpack(void *image, const void *packed, size_t count,
                   const float *alpha, size_t n, size_t bytes);

/* start (height) <- how many pixels are covered before each row of alpha
 * (height,width); how many in all. */
size_t covered_rows(size_t *start, const float *alpha, size_t height,
                    size_t width);

/* Where the run of pixels that begins at `at`, all covered or all not, ends:
 * at most n. */
static inline size_t covered_run(const float *alpha, size_t at, size_t n)
{
    const _Bool covered = alpha[at] != 0;

    while (at < n && (alpha[at] != 0) == covered)
        at++;
    return at;
}

#endif
