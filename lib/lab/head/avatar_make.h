/* The template avatar of a head (lib/head/head_avatar.h): computed from the head
 * model, the way its first version was. */
#ifndef SPID_LAB_HEAD_AVATAR_MAKE_H
#define SPID_LAB_HEAD_AVATAR_MAKE_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

#define AVATAR_MAKE_MOUTH 64    /* side of the mouth's grid in files */

/* h->avatar, in place of what it was, with T x T mouth Gaussians.  EX_OSERR. */
int avatar_make(struct head *h, size_t T, struct error *err);
/* The head's file at path gets a template avatar, or a new one; all else in it
 * stays. */
int avatar_make_file(const char *path, struct error *err);

#endif
