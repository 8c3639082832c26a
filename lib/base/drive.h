/* Phase B: where an avatar's Gaussians are in a frame (Section 3.2), and the
 * gradient of it.
 *   dynamic  the driven mesh's densified vertices, blended at the neck with
 *            shoulders that stand upright
 *   static   the source's centres, blended at the neck with the shoulders
 *            where the source had them
 *   mouth    mu = (g + q) + l_d - l_s: the source's centres, moved by the
 *            lips' centroid; or, where they say how (jaw), with the jaw: the
 *            upper teeth not at all, the lower ones as it turns
 * Training (lib/avatar/avatar.h), baked avatars (lib/avatar/baked.h) and the
 * renderer's scene (lib/splat/scene.h) all move by these functions.  Backward
 * functions add to their outputs. */
#ifndef SPID_BASE_DRIVE_H
#define SPID_BASE_DRIVE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/densify.h"

/* What moves, in the caller's memory.  Gaussians [0, dynamic) ride on the
 * mesh; [mouth, mouth + mouth_count) are the mouth's; the rest is static. */
struct drive {
    size_t dynamic, mouth, mouth_count;
    const int32_t *vertex;  /* (dynamic) densified vertex of each; NULL: as
                             * they come */
    const float *mean;      /* (N,3) centres at the source's pose */
    const float *weight;    /* (N) neck blend weights (neck_blend.h) */
    const float *jaw;       /* (mouth_count,3) how each moves with the chin
                             * (drive_jaw); NULL: the mouth goes as a whole */
    float pivot[3];         /* of the neck blend, head units */
    float source[9];        /* R_s: took the source's shoulders to the
                             * camera's axes */
    const float *view;      /* (3,4) the source's camera, before which they
                             * stay; NULL: they go where the neck goes, as a
                             * rendered person's do in training */
};

/* One frame's rigid motions, head frame. */
struct drive_frame {
    float mesh[12];         /* (3,4) of upright shoulders, for the mesh */
    float plane[12];        /* (3,4) of the source's, for static Gaussians */
    float stay[3];          /* what both have of neck_blend_stay */
    float to[3], from[3];   /* the mouth's shift: l_d and l_s */
    float chin[3];          /* c_d - c_s, of the head's chin; with jaw */
};

/* mesh and plane of a frame whose head is seen by cam (3,4); the caller sets
 * to and from. */
void drive_bodies(struct drive_frame *f, const struct drive *d,
                  const float cam[12]);

/* out (dynamic,3) from the driven verts (V,3).  densified (dynamic,3): before
 * the neck blend, for the backward; may be out. */
void drive_dynamic(float *out, float *densified, const struct drive *d,
                   const struct drive_frame *f, const struct densify *mesh,
                   const float *verts);
/* ddensified (dynamic,3) is overwritten. */
void drive_dynamic_backward(float *dverts, float dcam[12], float *ddensified,
                            const float *dout, const float *densified,
                            const struct drive *d,
                            const struct densify *mesh, const float cam[12]);

/* out (count,3): static Gaussians first .. first + count - 1. */
void drive_static(float *out, const struct drive *d,
                  const struct drive_frame *f, size_t first, size_t count);
/* dmean (count,3) is of their source centres. */
void drive_static_backward(float *dmean, float dcam[12], const float *dout,
                           const struct drive *d, size_t first, size_t count,
                           const float cam[12]);

/* How a point x of the lower jaw moves when the jaw turns about the hinge
 * (both head units, at rest) and that takes the chin there:
 *   dz + i dy = (a + i b) (chin's dz + i dy),   dx = s chin's dx,
 * for a turn in the yz plane is the product with a complex number, so (a + i b)
 * is the ratio of what the two are away from the hinge; exact for turns, and
 * linear.  jaw (3) = share (s, a, b), share 1 on the jaw, 0 on the skull. */
void drive_jaw(float jaw[3], const float x[3], float share,
               const float hinge[3], const float chin[3]);

/* out (mouth_count,3). */
void drive_mouth(float *out, const struct drive *d,
                 const struct drive_frame *f);
/* dmean (mouth_count,3) of the source centres, dto (3) of l_d, dchin (3) of
 * the chin's. */
void drive_mouth_backward(float *dmean, float dto[3], float dchin[3],
                          const float *dout, const struct drive *d);

#endif
