/* Inside the rasteriser: Gaussians as they are given to Gaussians as the
 * kernels read them.  Not for other modules. */
#ifndef SPID_SPLAT_PACK_H
#define SPID_SPLAT_PACK_H

#include "lib/splat/types.h"

/* Fill the arrays of s->state, which have room for g; numbers are checked. */
void pack_gaussians(struct splat *s, const struct gaussians *g);

#endif
