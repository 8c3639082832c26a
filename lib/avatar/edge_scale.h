/* How large Gaussians of the plane may be near the person's edge.  In the pose
 * of the source the photograph's matte cuts off what they draw beyond it; once
 * the head has turned nothing does, and large ones would be a smear of skin
 * beside an ear and torn cloth on shoulders.  They may therefore reach the edge
 * but not past it.  Without it turned.sh -n 6 loses 0.01 dB of later frames,
 * and gaze follows by 0.60 and 0.30 for 0.65 and 0.36; lbax4n and lbbc2a
 * stay. */
#ifndef SPID_AVATAR_EDGE_SCALE_H
#define SPID_AVATAR_EDGE_SCALE_H

#include <stddef.h>

/* max (n,n) = the largest standard deviation of a cell's Gaussian, cells: half
 * the way to the nearest cell without a person, at least `min`.  rgba
 * (n,n,4): the photograph's colours and matte at the cells. */
void edge_scale_find(float *max, const float *rgba, float min, size_t n);

/* scale (count,3), in the unit of `cell`, becomes max * cell at most.
 * clamped (count,3), or NULL: 1 where it was larger, else 0. */
void edge_scale_clamp(float *scale, float *clamped, const float *max,
                      float cell, size_t count);
/* Reverse of it: dscale (count,3) becomes 0 where it was larger. */
void edge_scale_clamp_backward(float *dscale, const float *clamped,
                               size_t count);

#endif
