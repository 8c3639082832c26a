/* Eyes: what the photograph does not show of lids and eyeballs.  Open eyes do
 * not show the skin of closed lids: it has the colour of the crease above it
 * and, further down, of the skin about the eye (the crease lies in the shadow of
 * the brow; a lid of its colour alone is a bruise), and its margin is a line of
 * lashes.  Shut eyes do not show their eyeballs: those are the template
 * avatar's, in the colours of the other eye where that one is open. */
#ifndef SPID_AVATAR_EYES_H
#define SPID_AVATAR_EYES_H

#include "lib/head/head.h"

enum eyes_side { EYE_LEFT, EYE_RIGHT };         /* the subject's */

/* What a photograph shows of the points of a head. */
struct eyes_photo {
    const float *pixel;         /* (D,4) colour and matte where they are */
    const float *trust;         /* (D) how far that is the point's own */
    const float *white;         /* (3) what white things look like */
};

/* shut (2): how far each eye is, 0 over more than half of the lid's way, then
 * up to 1; from posed vertices (V,3) and the same face at rest (V,3). */
void eyes_find_shut(float shut[2], const float *posed, const float *rest,
                    const struct head *h);
/* spacing (D) of the posed points, widened as far as lids that close stretch but
 * where they are closed already. */
void eyes_stretch(float *spacing, const float shut[2],
                  const struct head_avatar *a);
/* seen (D): nothing of an eyeball behind a shut lid is. */
void eyes_hide(float *seen, const float shut[2], const struct head_avatar *a);

/* The lids' rgb (D,3), which have got the colours of the crease above them,
 * become skin down to their margin; tmp holds V floats. */
void eyes_paint_lids(float *rgb, const struct eyes_photo *p,
                     const struct head_avatar *a, float *tmp);
/* rgb (D,3): the eyeballs of shut eyes; tmp holds D floats. */
void eyes_paint_balls(float *rgb, const float shut[2],
                      const struct eyes_photo *p, const struct head_avatar *a,
                      float *tmp);

#endif
