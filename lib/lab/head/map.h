/* One head's coefficients on another: which point of the first head's mesh
 * each vertex of the second is, and by least squares over these points which
 * of the second's shapes, expressions and jaw turns do what the first's do.
 * Encoders and per-vertex weights trained for one head move to another by
 * it. */
#ifndef SPID_LAB_HEAD_MAP_H
#define SPID_LAB_HEAD_MAP_H

#include "lib/base/arena.h"
#include "lib/head/head.h"

/* Expressions first, then the three axes of the jaw. */
#define HEAD_MAP_JAW 3

struct head_map {
    struct arena memory;
    const struct head *from, *to;   /* borrowed */
    size_t nexp, nshape;            /* of to, that count: at most what was
                                     * asked for */
    int32_t *vertex;                /* (to->V,3) vertices of from, and */
    float *weight;                  /* (to->V,3) their weights: the point that
                                     * a vertex of to is */
    float *trust;                   /* (to->V) in that, 0 to 1 */
    float shift[3];                 /* where from's origin lies in to's frame:
                                     * x in from's is x + shift in to's */
    float *motion;                  /* (nexp + 3, from->nexp + 3) */
    float *shape;                   /* (nshape, from->nshape) */
    float *mean;                    /* (nshape) what from's mean head is */
    double error;                   /* root mean square of what expressions
                                     * leave over, as a share of them */
};

/* The template of from is bent onto to's by their 68 landmarks, and the
 * nearest points are taken; then both maps are fitted.  nexp and nshape limit
 * what of to is used.  EX_DATAERR when a head has no landmarks. */
int head_map_init(struct head_map *m, const struct head *from,
                  const struct head *to, size_t nexp, size_t nshape,
                  struct error *err);
/* Free what it holds; zeroed then. */
void head_map_release(struct head_map *m);

/* Numbers per vertex, carried over: out (to->V,width) from in
 * (from->V,width). */
void head_map_vertices(float *out, const float *in, size_t width,
                       const struct head_map *m);

#endif
