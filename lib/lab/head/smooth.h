/* Displacements of a mesh that are near given ones and smooth in between: what
 * a registration and the carrying over of shapes solve. */
#ifndef SPID_LAB_HEAD_SMOOTH_H
#define SPID_LAB_HEAD_SMOOTH_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

/* Neighbours by edge: those of v are link[at[v]] .. link[at[v + 1] - 1]. */
struct smooth_mesh {
    size_t nv;
    int32_t *at, *link;
};
/* From faces (nf,3) of nv vertices. */
int smooth_mesh_init(struct smooth_mesh *m, const int32_t *faces, size_t nf,
                     size_t nv, struct arena *memory, struct error *err);

/* out (3) = mean of x (V,3) over v's neighbours; x[v] where it has none. */
void smooth_mean(double out[3], const struct smooth_mesh *m, const double *x,
                 size_t v);

/* d (V,3), which holds a first guess, = the displacements with least
 *   sum_v weight_v (e_n^2 + along_v |e_t|^2) + stiff sum_v |d_v - mean_v|^2,
 * e = d - target, e_n along normal (V,3), e_t across it, mean_v over v's
 * neighbours: minimal bending.  normal NULL: along_v is 1.  By conjugate
 * gradients to 1e-7 of the start, at most `rounds`.  -1: no memory. */
int smooth_fit(double *d, const struct smooth_mesh *m, const double *target,
               const double *weight, const double *normal,
               const double *along, double stiff, int rounds,
               struct error *err);

#endif
