/* The head's outline laid over the person's.  E_beta hears of a face's width,
 * but finds little of it; the matte shows where cheeks, jaw, ears and neck
 * end.  A mesh that is wider than the person leaves skin beyond the photograph's
 * outline that no pixel colours, and an outline that slides with the skin
 * instead of staying where the head turns away.  So the shape's numbers are
 * sought with which the mesh's rim lies on the matte's edge, while the
 * landmarks of brows, eyes, nose and mouth stay where they are: Gauss-Newton
 * steps held near E_beta's shape, as in shape from silhouettes. */
#ifndef SPID_TRACK_OUTLINE_H
#define SPID_TRACK_OUTLINE_H

#include "lib/base/error.h"
#include "lib/head/head.h"
#include "lib/record/person.h"

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
