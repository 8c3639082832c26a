/* Places in the source picture: where each Gaussian was seen by the source's
 * camera, whether it was, and what of it the renderer blends.
 *
 * Positions are normalised picture coordinates (x right, y down, -1..1).  A
 * frame's place is split in two: a plane through the head that faces the
 * source's camera goes from the driven picture to the source picture by one
 * affine map (the view), and each Gaussian carries what differs from it, its
 * offset and how its surface foreshortens the steps (struct splat_place_view).  So
 * a place is exact to first order across a Gaussian's whole footprint, in the
 * direction in which the camera has moved, while the renderer blends four numbers
 * that are constant in each Gaussian.  Below the neck the view goes over into the
 * affine map of the shoulders, which stay where they were. */
#ifndef SPID_PHOTO_PLACE_H
#define SPID_PHOTO_PLACE_H

#include <stddef.h>

#include "lib/splat/types.h"

#define PLACE_REACH 3.0f        /* standard deviations that are drawn of any */

/* Where a frame has the shoulders: body (3,4) moves them in the head's frame
 * about pivot (3), as neck_blend_body has it. */
struct place_shoulders {
    const float *body, *pivot;
};

/* The view from the source's camera (3,4) to a frame's (3,4), with shoulders or,
 * NULL, without.  The maps are kept from growing without bound where the head
 * turns its side to the camera. */
void place_view_make(struct splat_place_view *v, const float source[12],
                     const float cam[12], const struct place_shoulders *s);
/* The same of pictures with another focal length, half pictures. */
void place_view_focal(struct splat_place_view *v, float focal);

/* uv (N,2) of centres mean (N,3) as the source's camera sees them; what it
 * does not see, all of it outside of the picture by standard deviations scale
 * (N,3), has its seen (N) set to 0. */
void place_of_source(float *uv, float *seen, const float *mean,
                     const float *scale, const float cam[12], size_t N);

#endif
