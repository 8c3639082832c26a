/* Left and right: what a picture's mirror image says of a shape. */
#ifndef SPID_HEAD_MIRROR_H
#define SPID_HEAD_MIRROR_H

#include "lib/base/error.h"
#include "lib/head/head.h"

/* sign (nshape): 1 or -1, such that beta_k sign_k is the shape of the mirrored
 * person.  1; 0 when a direction of h is neither even nor odd under mirroring
 * (sign is then of no use); -1 only when memory is short. */
int head_mirror(float *sign, const struct head *h, struct error *err);

#endif
