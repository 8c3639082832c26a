/* What the mesh carries: solid disks that lie on it, for a head is a surface from
 * whichever side it is seen.  What the decoder learned to cover from the source's own
 * camera, half clear and tilted, let the back of the head through in rows once it had
 * turned away.  Skin's disks are thin, or every outline that a turn brings about would
 * be wider than the mesh by their reach, and mouths less open; hair's are as thick as
 * wide.  What of them stands out beside the person is the photograph's matter (seen of
 * struct branch_set).  The decoder colours what the source shows squarely; elsewhere it
 * would give every head the back of its training people, so there the prior's colours
 * stand, and features beyond the colour become 0: a refiner adds nothing. */
#ifndef SPID_AVATAR_DISKS_H
#define SPID_AVATAR_DISKS_H

#include "lib/avatar/dynamic_branch.h"

/* Scale, rotation and opacity of the branch's n are written, colours go over into the
 * prior's the less the source shows of each Gaussian. */
void disks_lay(struct branch_set *out, const struct source_mesh *mesh,
               const struct dynamic_branch *b);
/* The reverse, of the colours' gradients, in place. */
void disks_lay_backward(struct branch_set *dout, const struct dynamic_branch *b);

#endif
