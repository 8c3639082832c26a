/* Colours of what the photograph does not show of the head: those with the
 * photograph's colours where it is trusted, and with the slopes that the
 * photograph and its mirror image have there, each as far as it is trusted,
 * or with none where neither is (Perez et al. 2003, "Poisson image editing",
 * on the mesh).  So a cheek that was never seen has the other one's freckles,
 * brow and hair in its own light, and nothing has a seam.  Hair behind a
 * hairline that was never seen goes on from hair, not from the ear, and a
 * collar's other side from the collar. */
#ifndef SPID_AVATAR_COMPLETION_H
#define SPID_AVATAR_COMPLETION_H

#include <stddef.h>

#include "lib/avatar/material.h"
#include "lib/base/densify.h"

/* Floats of scratch for N points. */
#define COMPLETION_SCRATCH(N) (17 * MATERIALS * (N))

/* rgb (N,3), N = V + E of d: in the photograph's colours or their logarithms, out
 * complete.
 *   trust (MATERIALS,N)   in them as each material's, 0..1
 *   chance (MATERIALS,N)  of each material
 *   mirror (N)  the point across the head of each; itself where there is none
 *   scratch     COMPLETION_SCRATCH(N)
 * Materials are layers, each of which goes on by itself; out is what is expected
 * of them.  A layer minimises sum trust (rgb - photograph)^2 + ANCHOR
 * (mirror's trust) (rgb - mirror's)^2 + sum over the mesh's halved edges (how far
 * both ends belong to it) (rgb's step - wanted step)^2 by conjugate gradients. */
void completion_solve(float *rgb, const float *trust, const float *chance,
                      const size_t *mirror, const struct densify *d,
                      float *scratch);

/* mirror (V+E) from that of the vertices (V): a midpoint's is the midpoint
 * across, itself where the mesh has none there. */
void completion_mirror(size_t *mirror, const size_t *vertices,
                       const struct densify *d);

#endif
