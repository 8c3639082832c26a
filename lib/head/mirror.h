/* Left and right: what a picture's mirror image says of a head. */
#ifndef SPID_HEAD_MIRROR_H
#define SPID_HEAD_MIRROR_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

/* other (n): which of the places x (n,3) is nearest to each one's mirror
 * image. */
int mirror_vertices(size_t *other, const float *x, size_t n, struct error *err);

/* Coefficients c of the mirrored person are sign_k c_{from_k}: a direction is
 * even or odd under mirroring, or has its partner on the other side. */
struct head_mirror {
    size_t n;
    int from[HEAD_MAX_EXP];
    float sign[HEAD_MAX_EXP];
};

/* Of h's shape, or expression, directions.  1; 0 when one of them has no
 * mirror image among them (or they are too many): m is then of no use; -1 only
 * when memory is short. */
int head_mirror_shape(struct head_mirror *m, const struct head *h,
                      struct error *err);
/* The same of expression directions. */
int head_mirror_exp(struct head_mirror *m, const struct head *h,
                    struct error *err);

/* out = coefficients c (n) of the mirrored person; out is not c. */
void head_mirror_apply(float *out, const float *c,
                       const struct head_mirror *m);

#endif
