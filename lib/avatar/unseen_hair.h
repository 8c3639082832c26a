/* Hair on the side that the photograph does not show.  Gaussians of the plane
 * beside the mesh are mirrored across the head, into rows that draw nothing, so
 * far as the photograph allows it: it would show them where they are not hidden
 * behind the head or behind what it shows of hair (space carving, Kutulakos and
 * Seitz 2000).  Without it turned.sh -n 6 loses 0.06 dB of 20.75, edges come
 * nearer to the truth's (1.31 for 1.33), as do landmarks (4.30 for 4.32 %), and
 * lbax4n and lbbc2a stay; but turned.sh sheet shows who has long hair (its third
 * person) with hair on one side only. */
#ifndef SPID_AVATAR_UNSEEN_HAIR_H
#define SPID_AVATAR_UNSEEN_HAIR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/source_mesh.h"

/* Into the rows of out (the plane's) that draw nothing; from (out->n) becomes
 * the row that each is the image of, and one more; 0 elsewhere.  front (n,n) is
 * scratch, n the mesh's. */
void unseen_hair_set(struct branch_set *out, uint32_t *from, float *front,
                     const struct source_mesh *mesh);
/* Their gradients go to the rows that they are images of, and become 0. */
void unseen_hair_backward(struct branch_set *dout, const uint32_t *from);

#endif
