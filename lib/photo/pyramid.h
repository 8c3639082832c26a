/* Sums over cells of a square, made complete from coarser and coarser cells
 * (pull and push, Gortler et al. 1996). */
#ifndef SPID_PHOTO_PYRAMID_H
#define SPID_PHOTO_PYRAMID_H

#include <stddef.h>

/* Floats that all levels of (side,side,n) take; side is a power of two. */
static inline size_t pyramid_floats(size_t side, size_t n)
{
    return (side * side * 4 / 3 + 1) * n;
}

/* cells (side,side,n), with room for all levels: each cell's sums, of which
 * the first is how much there is.  Every cell gains `weight` of the means of
 * the cells about it, which have gained from those about them, up to `any`,
 * (n), the means where nothing is known: a cell with much of its own keeps it,
 * an empty one is as its surroundings. */
void pyramid_pool(float *cells, size_t side, size_t n, float weight,
                  const float *any);

/* Where place i of n lies among w centres of the same span: the one before it,
 * and *t how far to the next.  The last two where it lies beyond. */
static inline size_t pyramid_between(float *t, size_t i, size_t n, size_t w)
{
    const float scale = (float)w / (float)n;
    float at = ((float)i + 0.5f) * scale - 0.5f;

    at = at < 0 ? 0 : at > (float)(w - 1) ? (float)(w - 1) : at;
    const size_t cell = (size_t)at < w - 1 || w < 2 ? (size_t)at : w - 2;
    *t = at - (float)cell;
    return cell;
}

#endif
