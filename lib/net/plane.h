/* GAGAvatar's dual-lifting planes: one plane of points through the head's
 * origin, facing the source camera, lifted once away from it and once towards
 * it. */
#ifndef SPID_NET_PLANE_H
#define SPID_NET_PLANE_H

#include <stddef.h>

/* points (n*n,3), row by row, and the optical axis d (3), which points away
 * from the camera, of the source camera cam (3,4).  Samples span the picture
 * with both ends: the first lies on its border, not half a cell inside.  A
 * point is o + |o.d| R^T (x/f, y/f, 1): on the plane through the origin,
 * square to d. */
void gagavatar_plane(float *points, float d[3], const float cam[12],
                     size_t n);

/* xyz (N,3) = points + sign * position * d: along the axis, not the ray.
 * sign +1 lifts away from the camera, -1 towards it. */
void gagavatar_lift(float *xyz, const float *points, const float *position,
                    const float d[3], float sign, size_t N);

#endif
