/* Inside the rasteriser: one frame on all threads.  Not for other modules. */
#ifndef SPID_SPLAT_FRAME_H
#define SPID_SPLAT_FRAME_H

#include "lib/splat/state.h"

/* Project what changed, sort, make the tiles' lists, draw.  -1 when there is
 * no memory for the lists. */
int frame_draw(struct splat *s, const struct target *out, struct error *err);

#endif
