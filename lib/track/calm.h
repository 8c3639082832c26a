/* A face at rest, as far as one picture tells: what a face does beyond what
 * calm faces do is expression, not the person's own. */
#ifndef SPID_TRACK_CALM_H
#define SPID_TRACK_CALM_H

#include <stddef.h>

#include "lib/head/motion.h"
#include "lib/net/motion_encoder.h"
#include "lib/track/landmarks.h"

struct calm {
    const float *rest;          /* (2,MOTION_OUT), motion_encoder_rest's; NULL:
                                 * every face is left as it is */
    size_t nexp;                /* components of expression */
    float parts[MOTION_OUT];    /* what parts the lips, a unit vector; each
                                 * number counted in half its range */
};

/* Of what E_m says of calm faces (borrowed; may be NULL) and of a person's
 * lips. */
void calm_init(struct calm *c, const float *rest, struct landmarks *lips);

/* m's face at rest.  No number is further from the mean than in calm faces.
 * Nor are the lips further apart, which is a matter of all numbers together: a
 * mouth open beyond is one that speaks or laughs, and says nothing of how it
 * rests. */
void calm_face(struct motion *m, const struct calm *c);

#endif
