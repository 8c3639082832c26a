/* Displacement fields over the head from which shapes and expressions are
 * made.  Not for other modules. */
#ifndef SPID_LAB_HEAD_SCULPT_FIELD_H
#define SPID_LAB_HEAD_SCULPT_FIELD_H

#include <stdint.h>

#include "lib/lab/head/sculpt_impl.h"

enum lip_side { LIP_BOTH, LIP_UPPER, LIP_LOWER };
enum half_side { SIDE_LEFT, SIDE_RIGHT, SIDE_BOTH };

/* A pull: skin around `at` (given for the left half) moves by `by` with a
 * Gaussian fall-off of `reach` mm.  At lips it takes hold of one or both. */
struct pull {
    struct vec at, by;
    double reach;
    enum lip_side lips;
};

/* d (nv) += the pull, mirrored for the right half; eyeballs stay. */
void field_pull(struct vec *d, const struct full *m, const struct pull *p,
                enum half_side side, double strength);

/* d (nv) += a smooth random vector field number k of wavelength `wave` mm,
 * mirror-symmetric unless odd is set. */
void field_wave(struct vec *d, const struct full *m, uint64_t k, double wave,
                int odd);

/* Make eyes move as they must under a shape: each eyeball rigidly with its
 * lids, the lids with the ball. */
void field_settle_eyes(struct vec *d, const struct full *m);

/* Column k of dirs (V,3,K), metres, from d: scaled so that nothing moves by
 * more than `most` mm, then made orthogonal to columns first .. k-1 without
 * being scaled up again. */
int field_store(float *dirs, size_t K, size_t first, size_t k,
                const struct vec *d, size_t nv, double most);

/* Order columns first .. first+n-1 by falling norm. */
int field_sort(float *dirs, size_t K, size_t first, size_t n, size_t nv);

#endif
