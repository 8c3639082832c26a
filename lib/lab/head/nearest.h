/* The point of a triangle mesh nearest to a given one: a tree of boxes. */
#ifndef SPID_LAB_HEAD_NEAREST_H
#define SPID_LAB_HEAD_NEAREST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

struct nearest_node;

/* Borrows verts and faces; nearest_update after verts have moved. */
struct nearest {
    const float *verts;         /* (V,3) */
    const int32_t *faces;       /* (F,3) */
    size_t nf;
    int32_t *order;             /* (F) faces, those of a box together */
    struct nearest_node *node;
    size_t nodes;
};

/* A point of the mesh: face, barycentric coordinates, place and the square of
 * the distance to what was asked for. */
struct nearest_hit {
    int32_t face;               /* -1: none */
    double bary[3], at[3], square;
};

/* Over faces (nf,3) of verts (.,3), which are borrowed. */
int nearest_init(struct nearest *t, const float *verts, const int32_t *faces,
                 size_t nf, struct arena *memory, struct error *err);
/* verts have moved: the boxes are fitted to them again. */
void nearest_update(struct nearest *t);

/* The nearest point within `max` of p; hit->face is -1 when there is none. */
void nearest_find(struct nearest_hit *hit, const struct nearest *t,
                  const double p[3], double max);
/* The nearest point within `max` of p that looks the same way as a surface of
 * this normal: skin of the same side of lips, lids and ears.  False where there
 * is none: then the nearest of all. */
bool nearest_facing(struct nearest_hit *hit, const struct nearest *t,
                    const double p[3], const float normal[3], double max);

#endif
