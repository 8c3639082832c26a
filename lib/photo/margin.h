/* The margin of a portrait window: what of it lies beyond the photograph. */
#ifndef SPID_PHOTO_MARGIN_H
#define SPID_PHOTO_MARGIN_H

#include "lib/base/error.h"
#include "lib/photo/matting.h"

/* m is a guess beyond the picture: alpha, the person's colours in rgb, and
 * back.  Each of the three keeps its slopes there and takes the picture's
 * values at its edge (completion.h does the same on the head's mesh), so that
 * none of them has a seam; far from it the guess holds.  rgb is then both
 * layers together.  EX_OSERR without memory. */
int margin_fill(struct matting *m, struct error *err);

#endif
