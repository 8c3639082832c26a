/* The one-euro filter (Casiez et al. 2012): causal smoothing of n signals
 * whose cut-off rises with their speed.  No frame is held back; at rest the
 * signal lags by 1 / (2 pi cutoff) seconds (106 ms at 1.5 Hz), less when it
 * moves. */
#ifndef SPID_TRACK_ONEEURO_H
#define SPID_TRACK_ONEEURO_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/head/motion.h"

#define ONEEURO_MAX 160

struct oneeuro {
    double cutoff;              /* Hz at rest; 0: off */
    bool started;
    double time;                /* of the last sample */
    float x[ONEEURO_MAX];       /* last output */
    float dx[ONEEURO_MAX];      /* smoothed derivative, per second */
};

/* cutoff: Hz at rest; 0: samples are left as they are. */
void oneeuro_init(struct oneeuro *f, double cutoff);
/* Forget the past: after a lost face. */
void oneeuro_reset(struct oneeuro *f);
/* Smooth x [n] in place, sampled at time seconds.  beta [n]: how much the
 * cut-off rises, in Hz per unit of speed. */
void oneeuro_step(struct oneeuro *f, float *x, const float *beta, size_t n,
                  double time);
/* What *m has, smoothed as one row in E_m's order, each number with a speed of
 * its own.  Rotations are filtered as two rows and made orthonormal again.  The
 * first motion stays as it is, and every one where the filter's cut-off is 0. */
void oneeuro_motion(struct oneeuro *filter, struct motion *m, double time);

#endif
