/* Where in a picture a face may be, by E_m's own doubt: squares of all sizes
 * are shown to it, and those it is surest of are candidates.  It knows faces
 * from the side, from above and below, and tilted ones, as far as it was
 * trained on them; no detector is needed. */
#ifndef SPID_TRACK_SEARCH_H
#define SPID_TRACK_SEARCH_H

#include <stddef.h>

#include "lib/base/crop.h"
#include "lib/base/error.h"
#include "lib/base/mipmap.h"
#include "lib/net/motion_encoder.h"

#define SEARCH_APART 0.5        /* of a square's side: nearer, faces are one.  More
                                 * than SEARCH_STEP, or neighbours fill the
                                 * places: tests/bench/README.md, as there */
#define SEARCH_BEST 4           /* candidates of a level */
#define SEARCH_LEVELS 5         /* of sizes, the largest first: faces down to a
                                 * seventh of the picture */

struct search {
    struct motion_encoder *net; /* borrowed, planned for a batch */
    float *rgb, *out;           /* (B,224,224,3), (B,120) */
};

/* For an encoder with a sure head.  EX_OSERR. */
int search_init(struct search *s, struct motion_encoder *net,
                struct error *err);
/* Free what it holds; zeroed then. */
void search_release(struct search *s);

/* The picture as small as it is searched. */
const struct mipmap_level *search_take(struct mipmap *picture);

/* The squares of a level that E_m is surest of, the surest first, in picture
 * pixels; returns how many, 0 when the picture is too small for them.  A level's
 * squares are 2/3 as wide as those of the one before. */
size_t search_level(struct square best[SEARCH_BEST], struct search *s,
                    struct mipmap *picture, size_t level);

#endif
