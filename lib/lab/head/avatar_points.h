/* The template avatar's numbers per point of the mesh (lib/head/head_avatar.h),
 * computed from the head model. */
#ifndef SPID_LAB_HEAD_AVATAR_POINTS_H
#define SPID_LAB_HEAD_AVATAR_POINTS_H

#include "lib/base/densify.h"
#include "lib/base/error.h"
#include "lib/head/head.h"

/* w, allocated, gets those of h; the edges are d's.  EX_OSERR. */
int avatar_points_make(struct head_avatar *w, const struct head *h,
                       const struct densify *d, struct error *err);

#endif
