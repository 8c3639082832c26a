/* Meshes from text: Wavefront OBJ, and MakeHuman's .mhclo, which places the
 * vertices of one mesh on another. */
#ifndef SPID_LAB_PEOPLE_WAVEFRONT_H
#define SPID_LAB_PEOPLE_WAVEFRONT_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

/* Quads are split; texture coordinates may be missing (nt = 0, ft NULL). */
struct wavefront {
    size_t nv, nt, nf;
    float *v;               /* (nv,3) */
    float *vt;              /* (nt,2) origin at the lower left */
    int32_t *f, *ft;        /* (nf,3) corners in v and in vt, from 0 */
};

/* Read a mesh into memory; group: only faces of that `g` (NULL: all of them).
 * Refused by name and line: indices out of range, numbers that are not finite,
 * faces of fewer than three corners, no faces. */
int wavefront_read(struct wavefront *m, const char *path, const char *group,
                   struct arena *memory, struct error *err);

/* Vertex i lies at sum_k weight[k] base[index[k]] + scale * offset. */
struct mhclo {
    size_t n;
    int32_t *index;         /* (n,3) vertices of the base mesh */
    float *weight, *offset; /* (n,3) */
    int32_t ruler[3][2];    /* base vertices whose distance along axis k ... */
    float length[3];        /* ... over this is the scale of axis k */
    uint8_t *hidden;        /* (nbase) 1: the asset covers that vertex */
};

/* Read a binding into memory; nbase vertices of the base mesh, n of the asset.
 * Refused by name: other counts, indices out of range, numbers that are not
 * finite. */
int mhclo_read(struct mhclo *m, const char *path, size_t nbase, size_t n,
               struct arena *memory, struct error *err);

/* out (n,3): the asset on base (nbase,3). */
void mhclo_place(float *out, const struct mhclo *m, const float *base);

#endif
