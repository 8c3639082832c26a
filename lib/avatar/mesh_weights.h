/* What of a head goes with the shoulders, what moves against the skull and
 * what lines the mouth: fixed numbers per vertex, from the head model's own
 * arrays. */
#ifndef SPID_AVATAR_MESH_WEIGHTS_H
#define SPID_AVATAR_MESH_WEIGHTS_H

#include "lib/base/error.h"
#include "lib/base/densify.h"
#include "lib/base/neck_blend.h"
#include "lib/head/head.h"

struct mesh_weights {
    struct neck_blend blend;    /* of the mean head */
    float *neck;            /* (V+E) neck blend weights */
    float *moving;          /* (V) 1 and more where expressions, jaw, lids or
                             * gaze move the skin, 0 on the skull */
    float *lining;          /* (V+E) 1 inside the mouth, behind the lips */
    float *lid;             /* (V+E) 1 on upper lids, which come down over the
                             * eyes when those close */
    float *fold;            /* (V+E) the same but for their margin: skin that
                             * comes out of the crease */
    float *reach;           /* (V+E) of gaussian_seen, head units: of lids
                             * negative, since the photograph shows their
                             * skin folded once they come down; 0 elsewhere */
    float *seam;            /* (V+E) 1 where the lips meet, 0 a few mm from
                             * there */
    float *crease;          /* (V+E) the same, and 1 at the mouth's corners,
                             * from which the lips' line goes on */
    float *lips;            /* (V+E) 1 on the lips, 0 beyond them */
    float *stretch;         /* (V+E) neighbours' distance there on closed lids,
                             * at a dropped jaw and under raised brows over
                             * that at rest, at least 1 */
    float *drop;            /* (V+E,3) where a dropped jaw takes it, head
                             * units */
    size_t *mirror;         /* (V+E) the point across the face */
};

/* From h's skinning weights, directions and regions; the edges are d's.
 * EX_OSERR; what was allocated then waits for mesh_weights_release. */
int mesh_weights_init(struct mesh_weights *w, const struct head *h,
                      const struct densify *d, struct error *err);
/* Free what it holds; zeroed then. */
void mesh_weights_release(struct mesh_weights *w);

#endif
