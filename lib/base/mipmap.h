/* A picture at a half, a quarter, .. of its size, for whoever looks for a face
 * in it or at one: each part of each level is made once, when it is asked for. */
#ifndef SPID_BASE_MIPMAP_H
#define SPID_BASE_MIPMAP_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/crop.h"
#include "lib/base/error.h"

#define MIPMAP_LEVELS 32        /* more than any picture has */

struct mipmap_level {
    const uint8_t *rgb;         /* (H,W,3) */
    size_t W, H;
    struct extent made;         /* of rgb; the rest is not written yet */
};

struct mipmap {
    struct mipmap_level level[MIPMAP_LEVELS];   /* 0: the picture */
    size_t levels;
    uint8_t *block;             /* of levels 1 and up */
    size_t room;
};

/* The picture rgb (H,W,3), borrowed until the next one is taken; room is kept
 * from one to the next.  EX_OSERR. */
int mipmap_take(struct mipmap *m, const uint8_t *rgb, size_t W, size_t H,
                struct error *err);
/* Free what it holds; zeroed then. */
void mipmap_release(struct mipmap *m);

/* Level k < m->levels, each pixel the mean of 2 x 2 of the one before. */
const struct mipmap_level *mipmap_whole(struct mipmap *m, size_t k);

/* out (n,n,3) f32 = the square q of the picture, as crop_sample_u8 cuts it from
 * the first level of which two pixels or fewer make one of out. */
void mipmap_sample(float *out, size_t n, struct mipmap *m, struct square q);

#endif
