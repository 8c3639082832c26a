/* How what the source's camera saw falls away from it: the slope of the depth
 * that it saw, at each Gaussian.  From it and from where a frame's camera
 * stands follows how much more or less of the surface the frame shows
 * (gaussian_visible), whether that is a cheek, the edge of the nose before one, or
 * the person's outline.  Depth is smoothed over about a pixel; at the person's
 * edge it falls by that of an outline's rounding. */
#ifndef SPID_AVATAR_TILT_H
#define SPID_AVATAR_TILT_H

#include <stddef.h>

#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/base/error.h"

#define TILT_STEEPEST 4.0f  /* seen at 14 degrees */

struct tilt {
    size_t n;               /* cells along one side of the maps */
    float *depth, *person, *smooth, *tmp;   /* (n,n) */
    float *slope;           /* (n,n,2) */
    float *block;           /* what the arrays are part of */
};

/* Memory for maps of n x n. */
int tilt_init(struct tilt *t, size_t n, struct error *err);
/* Free what it holds; zeroed then. */
void tilt_release(struct tilt *t);

/* t->slope of the mesh's depth and, where there is none, the plane's.  Right
 * and down, head units a head unit. */
void tilt_find(struct tilt *t, const struct source_picture *picture,
               const struct source_mesh *mesh);

/* tilt (N,2) of Gaussians at places uv (N,2) in the picture.  neck (N): how far
 * each goes with the shoulders, which the camera sees as it did. */
void tilt_sample(float *tilt, const struct tilt *t, const float *uv,
                 const float *neck, size_t N);

#endif
