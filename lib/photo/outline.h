/* The head's outline fitted to the person's.  E_beta estimates the width of a
 * face poorly, while the matte shows where cheeks, jaw, ears and neck end.  A
 * mesh wider than the person has skin beyond the photograph's outline, for
 * which no pixel gives a colour, and its outline slides with the skin when the
 * head turns.  So the shape coefficients are sought with which the mesh's rim
 * lies on the matte's edge where that is skin's, and nowhere beyond it where it
 * is hair's, while the landmarks of brows, eyes, nose and mouth stay where they
 * are: Gauss-Newton steps with E_beta's shape as prior, as in shape from
 * silhouettes. */
#ifndef SPID_PHOTO_OUTLINE_H
#define SPID_PHOTO_OUTLINE_H

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/head/person.h"

/* What was found. */
struct outline_report {
    size_t points;              /* of the rim, that met an edge of the matte; */
    double before, after;       /* their mean distance from it, pixels */
};

/* Change p->shape; p has picture, matte, shape and source motion.  Without
 * regions or landmarks, and where too little of the rim is seen, it stays. */
int outline_fit(struct outline_report *r, struct person *p,
                const struct head *head, struct error *err);

#endif
