/* Neighbours and normals of a triangle mesh. */
#ifndef SPID_LAB_HEAD_SURFACE_H
#define SPID_LAB_HEAD_SURFACE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

/* Neighbours by edge: those of v are link[at[v]] .. link[at[v + 1] - 1]. */
struct surface {
    size_t nv;
    int32_t *at, *link;
};
/* From faces (nf,3) of nv vertices. */
int surface_init(struct surface *s, const int32_t *faces, size_t nf, size_t nv,
                 struct arena *memory, struct error *err);

/* out (3) = mean of x (V,3) over v's neighbours; x[v] where it has none. */
void surface_mean(double out[3], const struct surface *s, const double *x,
                  size_t v);

/* Unit normals n (nv,3) of places p (nv,3), each face by its area. */
void surface_normals(float *n, const float *p, size_t nv,
                     const int32_t *faces, size_t nf);

#endif
