/* The covered pixels of a picture, packed: those whose alpha is not 0, row
 * after row.  Features are premultiplied, so the others are 0, and of a
 * portrait they are most: a FEAT record is a third as long without them. */
#ifndef SPID_SPLAT_COVERED_H
#define SPID_SPLAT_COVERED_H

#include <stddef.h>

/* out <- the covered ones of n pixels of so many bytes each; their number.
 * out has room for all n. */
size_t covered_pack(void *out, const void *image, const float *alpha,
                    size_t n, size_t bytes);

/* The way back: image (n pixels) <- count packed ones, and zeros between.
 * -1 when alpha covers another number of pixels. */
int covered_unpack(void *image, const void *packed, size_t count,
                   const float *alpha, size_t n, size_t bytes);

#endif
