/* The template avatar's numbers of eyes and lids (lib/head/head_avatar.h). */
#ifndef SPID_LAB_HEAD_AVATAR_EYES_H
#define SPID_LAB_HEAD_AVATAR_EYES_H

#include "lib/base/densify.h"
#include "lib/head/head.h"

/* a's of h, whose lids (lid) are there; the edges are d's. */
void avatar_eyes_make(struct head_avatar *a, const struct head *h,
                      const struct densify *d);

#endif
