/* A head with a vertex in the middle of every edge, as LAM's Gaussians need it:
 * the same shapes, expressions and joints on a mesh four times as fine. */
#ifndef SPID_LAB_HEAD_SUBDIVIDE_H
#define SPID_LAB_HEAD_SUBDIVIDE_H

#include <stdbool.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* Write the head's file `from`, subdivided once, to `to`: a midpoint has the
 * mean of its ends in everything, and joints stay those of the old vertices.
 * Where skinning opens the jaw, pose correctives are 0, as LAM poses FLAME.
 * The template avatar is left out. */
int subdivide_head(const char *to, const char *from, struct error *err);

/* Whether `fine` is `coarse` with vertices added behind its own: the same
 * coefficients mean the same face on both. */
bool subdivide_extends(const struct head *fine, const struct head *coarse);

#endif
