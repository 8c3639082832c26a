/* MESH records: the driven head's vertices, its camera and its lips. */
#ifndef SPID_HEAD_MESH_H
#define SPID_HEAD_MESH_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/stream/stream.h"

/* The arrays of a MESH record; they lie in the record and live as long. */
struct mesh {
    size_t V, F;
    const float *verts;         /* (V,3) head units */
    const float *cam;           /* (3,4) [R|t] */
    const float *lip;           /* (3) centroid of the inner lips */
    const float *gap;           /* (1) their opening; NULL: not said */
    const float *chin;          /* (3) centroid of the chin; NULL: not said */
    const int32_t *faces;       /* (F,3) triangles, each index under V, of the
                                 * first mesh of a stream; NULL: not said */
};

/* Names of the arrays that mesh_write writes, NULL at the end: what else a
 * record has is its other arrays (record_others). */
extern const char *const mesh_arrays[];

/* -1 and *err naming the array when one is missing, of another shape or not
 * finite, or a face has no vertex. */
int mesh_read(struct mesh *m, const struct record *rec, struct error *err);
/* Write a MESH record: verts (V,3), cam, the inner lips' centroid and
 * opening, the chin's centroid; faces when with_faces is set (the first one of
 * a stream); others appended. */
int mesh_write(struct stream_writer *w, uint64_t frame, double time,
               const struct head *h, const float *verts, const float cam[12],
               bool with_faces, const struct array *others, int nothers,
               struct error *err);

#endif
