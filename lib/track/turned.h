/* Photographs that lie on their side or stand on their head. */
#ifndef SPID_TRACK_TURNED_H
#define SPID_TRACK_TURNED_H

#include "formats/image.h"
#include "lib/base/error.h"

/* out = im turned by `quarters` (0 to 3) quarter turns clockwise, in memory of
 * its own. */
int turned_copy(struct image *out, const struct image *im, int quarters,
                struct error *err);

#endif
