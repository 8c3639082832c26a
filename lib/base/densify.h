/* Edge-midpoint subdivision: v_mid(i,j) = (v_i + v_j) / 2 for every edge of
 * the triangle mesh.  Edges are found once per head. */
#ifndef SPID_BASE_DENSIFY_H
#define SPID_BASE_DENSIFY_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct densify {
    size_t V, E;            /* vertices, edges */
    int32_t *edge;          /* (E,2) ends, smaller first, sorted */
    int32_t *degree;        /* (V) edges at each vertex */
};

/* From faces (F,3) with indices under V. */
int densify_init(struct densify *d, const int32_t *faces, size_t F, size_t V,
                 struct error *err);
/* Free what it holds; zeroed then. */
void densify_release(struct densify *d);

/* The vertices that densified vertex k is the mean of: the ends of its edge,
 * or the vertex itself twice. */
static inline void densify_ends(size_t end[2], const struct densify *d,
                                size_t k)
{
    for (size_t i = 0; i < 2; i++)
        end[i] = k < d->V ? k : (size_t)d->edge[2 * (k - d->V) + i];
}

/* out (V+E,C) = x (V,C), then the mean of the ends of every edge. */
void densify_forward(float *out, const float *x, const struct densify *d,
                     size_t C);
/* Only the midpoints: out (E,C). */
void densify_midpoints(float *out, const float *x, const struct densify *d,
                       size_t C);
/* dx (V,C) += gradient of dout (V+E,C). */
void densify_backward(float *dx, const float *dout, const struct densify *d,
                      size_t C);

/* out (n,3): of the densified x (V,3) only vertex[i], an index under V + E, or
 * the first n in order when vertex is NULL. */
void densify_gather(float *out, const int32_t *vertex, size_t n,
                    const float *x, const struct densify *d);
/* dx (V,3) += gradient of dout (n,3). */
void densify_gather_backward(float *dx, const float *dout,
                             const int32_t *vertex, size_t n,
                             const struct densify *d);

/* spacing (V+E): mean distance of a densified vertex of x (V,3) to its
 * neighbours on the subdivided mesh (half the edges at a vertex, half its own
 * edge at a midpoint). */
void densify_spacing(float *spacing, const float *x, const struct densify *d);

#endif
