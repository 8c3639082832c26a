/* Negative samples: crops that a tracker should refuse, drawn from people
 * with known faces, or from scenery.  E_m learns from them to be unsure. */
#ifndef SPID_LAB_DATA_NEGATIVE_H
#define SPID_LAB_DATA_NEGATIVE_H

#include "lib/base/error.h"
#include "lib/lab/data/data.h"

enum negative {
    NEGATIVE_NONE,        /* upright, whole and in place: accepted */
    NEGATIVE_MISSED,      /* beside the face: hair, clothes, wall */
    NEGATIVE_HALF,        /* half of the face is cut off */
    NEGATIVE_ROTATED,      /* by 60 degrees and more, often by 90 or 180 */
    NEGATIVE_SIZE,        /* far too near or too far */
    NEGATIVE_PIECES,      /* parts of a face in wrong places */
    NEGATIVE_COUNT,       /* of those that people give */
    NEGATIVE_SCENERY = NEGATIVE_COUNT   /* any square of a scenery, any side
                                         * up */
};

/* rgb (224,224,3) in [0,1]: a crop of f (its whole picture, of
 * NEGATIVE_SCENERY a scenery's) that is wrong in the way `how`, changed by
 * augment as data_sample does. */
int negative_sample(float *rgb, const struct data_frame *f, enum negative how,
                    const struct data_augment *augment, struct random *r,
                    struct error *err);

#endif
