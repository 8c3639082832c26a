/* The light on a head, from one picture of it. */
#ifndef SPID_AVATAR_LIGHT_H
#define SPID_AVATAR_LIGHT_H

#include <stddef.h>

/* l (3), at most 1 long: skin of normal n has 1 + l.n times its mean
 * luminance.  By least squares over the vertices that are seen, those of
 * another colour or brightness than most counting little.
 *   rgba    (V,4) sRGB of each vertex
 *   normal  (V,3) head frame
 *   weight  (V) how far it is seen; all 0: l = 0
 *   tmp     (V,4) */
void light_fit(float l[3], const float *rgba, const float *normal,
               const float *weight, size_t V, float *tmp);

#endif
