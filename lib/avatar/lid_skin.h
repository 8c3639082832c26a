/* Closed lids: what open eyes do not show of them takes the colour of the skin
 * about the eye, and their margin is a line of lashes. */
#ifndef SPID_AVATAR_LID_SKIN_H
#define SPID_AVATAR_LID_SKIN_H

#include "lib/base/densify.h"
#include "lib/head/head.h"

/* What a photograph shows of h and the midpoints of its edges. */
struct lid_skin_source {
    const float *verts;     /* (V+E,3) where they are */
    const float *pixel;     /* (V+E,4) colour and matte there */
    const float *trust;     /* (V+E) how far that is the skin's */
};

/* The lids' rgb (V+E,3), which have got the colours of the crease above them,
 * become skin down to their margin.  d is of h's edges; tmp holds V floats. */
void lid_skin(float *rgb, const struct lid_skin_source *s,
              const struct head *h, const struct head_avatar *w,
              const struct densify *d, float *tmp);

#endif
