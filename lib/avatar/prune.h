/* Gaussians that no view shows: found by drawing the avatar from calibration
 * views and adding up what each Gaussian weighs in the picture. */
#ifndef SPID_AVATAR_PRUNE_H
#define SPID_AVATAR_PRUNE_H

#include <stddef.h>

#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/base/densify.h"
#include "lib/head/lbs.h"

struct prune_report {
    size_t views;           /* calibration views drawn */
    size_t before[3], after[3];     /* Gaussians per branch */
    double psnr;            /* worst view, kept against full, dB */
    double max_abs;         /* largest difference of a pixel's channel */
    double ms_full, ms_kept;        /* median time of a view */
};

/* Keep what weighs at least eps in some view: the sum over the view's pixels
 * of alpha times transmittance, which bounds its weight in any one pixel.
 * Views: head turned by -40 to 40 degrees and nodded by -20 to 20, at rest
 * and with the jaw open.  id is the person's folded head. */
int prune_views(struct baked *b, struct prune_report *r,
                const struct densify *d, const struct identity *id,
                size_t size, double eps, struct error *err);

#endif
