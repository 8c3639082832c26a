/* Relative motion: what the driver does, done from where the source is.  A
 * frame's pose and expression are taken relative to the driver's own neutral
 * frame and added to the source's: two people's faces at rest differ, and that
 * difference is no movement (as Siarohin et al. 2019 do with keypoints). */
#ifndef SPID_TRACK_RELATIVE_H
#define SPID_TRACK_RELATIVE_H

#include <stddef.h>

#include "lib/head/motion.h"

struct relative {
    struct motion source;       /* the source picture's pose, its face calm */
    struct motion neutral;      /* the driver's, likewise */
    size_t nexp;                /* components of expression */
};

/* Motions are to be what has changed since neutral, added to source; nexp
 * components of expression, the head's.  Where both faces are calm, a grin is
 * left by who is driven to be calm, and a driver who begins with a grin is not
 * taken to grin at rest.  Nothing is borrowed. */
void relative_init(struct relative *r, const struct motion *source,
                   const struct motion *neutral, size_t nexp);

/* m, a motion of the driver, in place:
 *   rotation     R R_n^T R_s
 *   place        the source's, moved by as many head widths as the driver's;
 *                nearer by the same factor
 *   expression, jaw, eyes   source + driver - neutral
 *   lids         from the source's opening to the same share of the way to
 *                closed or wide open, so that a closed lid is closed
 * The crop stays. */
void relative_apply(struct motion *m, const struct relative *r);

/* How far from rest a motion is: the square of its expression, jaw and lids
 * and of how far the head looks away; the least of a clip is its most neutral
 * frame. */
double relative_tension(const struct motion *m, size_t nexp);

#endif
