/* Crops that a tracker should not believe, drawn from people with known
 * faces: what E_m learns to be unsure of. */
#ifndef SPID_DATA_ASTRAY_H
#define SPID_DATA_ASTRAY_H

#include "lib/base/error.h"
#include "lib/data/data.h"

enum astray {
    ASTRAY_NOT,                 /* upright, whole and in place: believed */
    ASTRAY_MISSED,              /* beside the face: hair, clothes, wall */
    ASTRAY_HALF,                /* half of the face is cut off */
    ASTRAY_TURNED,              /* by 60 degrees and more, often by 90 or 180 */
    ASTRAY_SIZE,                /* far too near or too far */
    ASTRAY_PIECES,              /* parts of a face in wrong places */
    ASTRAY_COUNT
};

/* rgb (224,224,3) in [0,1]: a crop of f (its whole picture) that is astray in
 * the way `how`, changed by augment as data_sample does. */
int astray_sample(float *rgb, const struct data_frame *f, enum astray how,
                  const struct data_augment *augment, struct random *r,
                  struct error *err);

#endif
