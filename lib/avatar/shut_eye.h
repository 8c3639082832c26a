/* Eyes that are shut in the source: the photograph shows lids where an avatar
 * that opens them needs eyeballs.  Those get the white, iris and pupil of a
 * common eye, as the mouth gets generic teeth. */
#ifndef SPID_AVATAR_SHUT_EYE_H
#define SPID_AVATAR_SHUT_EYE_H

#include "lib/base/densify.h"
#include "lib/head/head.h"

/* How far each eye is shut: 0 over more than half of the lid's way, then up to
 * 1. */
struct shut_eye {
    float left, right;          /* the subject's */
};

/* From posed vertices (V,3) and the same face at rest (V,3). */
struct shut_eye shut_eye_find(const float *posed, const float *rest,
                              const struct head *h);
/* spacing (V+E) of the posed points, widened as far as lids that close stretch
 * (head_avatar.h) but where they are closed already. */
void shut_eye_stretch(float *spacing, const struct shut_eye *s,
                      const float *stretch, const struct head *h,
                      const struct densify *d);
/* seen (V+E): nothing of an eyeball behind a shut lid is.  d is of h's
 * edges. */
void shut_eye_hide(float *seen, const struct shut_eye *s, const struct head *h,
                   const struct densify *d);
/* What the photograph says of eyes. */
struct shut_eye_light {
    const float *white;         /* (3) what white things look like */
    const float *pixel;         /* (V+E,4) colour and matte where points are */
    const float *trust;         /* (V+E) how far that is the point's own */
};

/* rgb (V+E,3): the colours of shut eyes' eyeballs; one open eye lends those of
 * its iris and white to the other. */
void shut_eye_paint(float *rgb, const struct shut_eye *s,
                    const struct shut_eye_light *by, const struct head *h,
                    const struct densify *d);

#endif
