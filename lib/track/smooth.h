/* A motion through the one-euro filter. */
#ifndef SPID_TRACK_SMOOTH_H
#define SPID_TRACK_SMOOTH_H

#include "lib/head/motion.h"
#include "lib/track/oneeuro.h"

/* What *m has, smoothed as one row in E_m's order.  Rotations are filtered as
 * two rows and made orthonormal again.  The first motion stays as it is, and
 * every one where the filter's cut-off is 0. */
void smooth_motion(struct oneeuro *filter, struct motion *m, double time);

#endif
