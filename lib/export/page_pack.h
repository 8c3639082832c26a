/* Arrays on their way into the archive of a page (formats/pagefile.h), small:
 * 16 bits between the ends of their range. */
#ifndef SPID_EXPORT_PAGE_PACK_H
#define SPID_EXPORT_PAGE_PACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/safetensors.h"
#include "lib/base/arena.h"
#include "lib/head/lbs.h"

#define PACK_MAX 96            /* arrays of an archive */

/* In memory whose `failed` says that it was short, which the owner gives back;
 * zeroed: none. */
struct pack {
    struct arena memory;
    struct st_tensor tensor[PACK_MAX];
    size_t count;
};

/* An array (d0, d1) of `bytes`, copied, or to be filled in where data is NULL;
 * d1 0: one dimension.  NULL where memory is short. */
void *page_pack_add(struct pack *k, const char *name, enum st_dtype dtype,
                    size_t d0, size_t d1, const void *data);
/* Columns of x (n rows of `stride` numbers, the first K of them) one after the
 * other: name (K,n) in 16 bits, from 0 for range[k][0] to 65534 for
 * range[k][1] of name.range (K,2). */
void page_pack_columns(struct pack *k, const char *name, const float *x,
                       size_t n, size_t stride, size_t K);
/* Pixels as what each differs by from the one on its left: half the size when
 * deflated. */
void page_pack_picture(struct pack *k, const char *name, const uint8_t *pixel,
                       size_t S, size_t channels);
/* What poses an identity's head (Eq. M with beta folded in): shaped, lids,
 * exp_dirs, pose_dirs, weights, joints, joint_exp, parents. */
void page_pack_head(struct pack *k, const struct identity *id);

#endif
