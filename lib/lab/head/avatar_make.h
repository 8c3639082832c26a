/* The template avatar of a head (lib/head/head_avatar.h): its points computed
 * from the head model, its mouth that of another head. */
#ifndef SPID_LAB_HEAD_AVATAR_MAKE_H
#define SPID_LAB_HEAD_AVATAR_MAKE_H

#include "lib/base/densify.h"
#include "lib/base/error.h"
#include "lib/head/head.h"

/* h->avatar, in place of what it was, with the mouth of `from`.  EX_OSERR. */
int avatar_make(struct head *h, const struct head_avatar *from,
                struct error *err);
/* The head's file at path gets a template avatar, or a new one, with the mouth
 * of the head's file `mouth`; all else in it stays. */
int avatar_make_file(const char *path, const char *mouth, struct error *err);

/* Parts of avatar_make, of h, whose edges are d's. */

/* Numbers per point of the mesh into w, allocated.  EX_OSERR. */
int avatar_points_make(struct head_avatar *w, const struct head *h,
                       const struct densify *d, struct error *err);
/* Those of eyes and lids into a, whose lids (lid) are there. */
void avatar_eyes_make(struct head_avatar *a, const struct head *h,
                      const struct densify *d);

#endif
