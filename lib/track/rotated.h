/* Photographs that lie on their side or stand on their head. */
#ifndef SPID_TRACK_ROTATED_H
#define SPID_TRACK_ROTATED_H

#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/track/track.h"

/* As track_start, for a picture that may lie: 1, it shows a face as it is; 0,
 * and *quarters is how many quarter turns clockwise show one, or 0 where none
 * does; -1.  Where E_m cannot say how sure it is, or the
 * crop is given, nothing is turned. */
int rotated_start(struct track *t, struct track_result *r, int *quarters,
                  const struct frame *f, struct error *err);

/* out = im turned by `quarters` (0 to 3) quarter turns clockwise, in memory of
 * its own. */
int rotated_copy(struct image *out, const struct image *im, int quarters,
                 struct error *err);

#endif
