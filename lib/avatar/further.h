/* What further pictures of a person show of the head's points, beside the first
 * one's.  Each picture sees a point by a trust and at an angle; what the pictures
 * say is added up by the square of the area that the point has in each, so that
 * of two pictures nearly all is the one's that saw it best. */
#ifndef SPID_AVATAR_FURTHER_H
#define SPID_AVATAR_FURTHER_H

#include <stddef.h>

#define FURTHER_SUMS 5  /* red, green and blue, each times its weight; weights;
                         * the most trust that there is in one of them */

/* One picture of N points. */
struct further_picture {
    const float *pixel;     /* (N,4) sRGB at each, and matte */
    const float *trust;     /* (N) in that colour, 0..1 */
    const float *facing;    /* (N) cosine between normal and way to the camera */
};

/* gain (3) from a picture's colours to those of the first, known (N,4: colour
 * and trust).  What both show differs by how the pictures were taken and by how
 * the light falls on a head that has turned: the middle between all and none of
 * it is taken for the former. */
void further_gain(float gain[3], const struct further_picture *p,
                  const float *known, size_t N);
/* sums (N,FURTHER_SUMS) += a further picture, times gain (3). */
void further_add(float *sums, const struct further_picture *p,
                 const float gain[3], size_t N);
/* pixel (N,4) and trust (N) of the first picture, seen at facing (N), become those
 * of all pictures, and rgb (N,3) is the colours; what no further picture shows
 * stays. */
void further_take(float *pixel, float *trust, float *rgb, const float *facing,
                  const float *sums, size_t N);

#endif
