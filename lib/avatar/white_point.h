/* What is white in a picture of a face: the light that teeth, eyes and lips
 * which it does not show are given. */
#ifndef SPID_AVATAR_WHITE_POINT_H
#define SPID_AVATAR_WHITE_POINT_H

#include "lib/head/head.h"

/* Colours that the picture has at the V vertices of a head; borrowed. */
struct white_point_colors {
    const float *pixel;         /* (V,4) */
    const float *trust;         /* (V) in them, 0..1 */
    float *tmp;                 /* (V) */
};

/* white (3): the mean of the brighter eyeball vertices that are visible (above
 * the mean, twice over), or of all skin where too few are; and at least so
 * bright that the palest skin would be as bright as the face. */
void white_point(float white[3], const struct white_point_colors *seen,
                 const struct head *h);

#endif
