/* What the mesh carries where the source does not show it squarely: the prior's
 * colours on disks that lie on the mesh.  The decoder would give every head the back
 * of its training people, and half clear parts that those seldom turned to the
 * camera.  Skin's disks are thin, or every outline that a turn brings about would be
 * wider than the mesh by their reach; hair's are as thick as wide.  What of them
 * stands out beside the person is the photograph's matter (seen of struct
 * branch_set), but for lips that part: their rims are as small as may be, or mouths
 * would be less open than the mesh.  Features beyond the colour become 0, so that a
 * refiner adds nothing there. */
#ifndef SPID_AVATAR_DISKS_H
#define SPID_AVATAR_DISKS_H

#include "lib/avatar/dynamic_branch.h"

/* What the decoder said becomes, the less the source shows of each Gaussian, a disk,
 * in place: scale, rotation, opacity and colours of the branch's n. */
void disks_lay(struct branch_set *out, const struct dynamic_branch *b);
/* The reverse, gradients in place. */
void disks_lay_backward(struct branch_set *dout, const struct dynamic_branch *b);

#endif
