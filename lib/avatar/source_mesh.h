/* The source's mesh as its camera sees it: the geometry that Phase A works
 * with. Everything here follows from vertices and camera alone and is constant
 * for the backward. */
#ifndef SPID_AVATAR_SOURCE_MESH_H
#define SPID_AVATAR_SOURCE_MESH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* Head units by which the picture may show a point beside where the mesh has
 * it: 6 mm, what a head of 10 cm moves by when its pose is off by 3.3 degrees,
 * as it is at 45 degrees (examples/model/README.md). */
#define SOURCE_MESH_OFF 0.03f

struct source_mesh {
    const struct head *head;
    const struct head_avatar *weights;  /* the head's */
    size_t n;               /* cells along one side of the maps */
    float cam[12];          /* (3,4) T_s */
    float normal[3];        /* n_s: unit, from the plane to the camera */
    bool blend;             /* shoulders stand upright (neck_blend.h) */
    float body[12];         /* (3,4) their motion; when blend */
    const float *posed;     /* (V,3) V_s as it came; the caller's */
    const float *rest;      /* (V,3) the same face at rest; the caller's */
    float *verts;           /* (V+1,3) after the neck blend; the last: the
                             * inner lips' centroid */
    float *normals;         /* (V,3) unit, of verts */
    int32_t *faces;         /* (F+L,3) the head's, and L that close the lips:
                             * no map looks through an open mouth at the back
                             * of the head */
    float *moving_verts;    /* (V+1) how much each moves */
    float *coverage;        /* (n,n) fraction that the mesh covers, C */
    float *depth;           /* (n,n) camera depth of the mesh; infinity
                             * beside it */
    float *near;            /* (n,n) the least depth within
                             * SOURCE_MESH_OFF of there */
    float *moving;          /* (n,n) how much of what shows there moves */
    float *raster;          /* scratch of coverage.h */
    float *block;           /* what the arrays are part of */
};

/* Memory for meshes of h on maps of n x n; h is borrowed. */
int source_mesh_init(struct source_mesh *m, const struct head *h,
                     size_t n, struct error *err);
/* Free what it holds; zeroed then. */
void source_mesh_release(struct source_mesh *m);

/* Take posed vertices (V,3) and those of the same face at rest (V,3, or NULL:
 * posed is), which must stay until the bake's end, and their camera; blend:
 * with the neck blend from upright shoulders. */
void source_mesh_set(struct source_mesh *m, const float *posed,
                     const float *rest, const float cam[12], bool blend);

/* n_s: unit vector from the plane to the camera, head frame. */
void source_mesh_normal(float normal[3], const float cam[12]);

/* Places (N,2) in [-1,1], x then y: projection of x (N,3) onto the source
 * picture. */
void source_mesh_project(float *place, const float *x, size_t N,
                         const float cam[12]);

/* The cell of n x n maps that a place in [-1,1] lies in, or the nearest. */
size_t source_mesh_cell(const float place[2], size_t n);

/* From one cell of n x n to the next at the depth of the head's origin, head
 * units. */
float source_mesh_spacing(const struct source_mesh *m, size_t n);

#endif
