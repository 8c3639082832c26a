/* The driven portrait back in the photograph that it was cut from.  Only what
 * has changed is added: photograph + (driven - portrait at rest), so that
 * where nothing moves every pixel stays as it was.  Shoulders go on outside of
 * the window, where they rest: towards its edges the driven picture is drawn
 * back to where the source's neck was, and within the last pixels faded into
 * the photograph. */
#ifndef SPID_ANIMATE_INSET_H
#define SPID_ANIMATE_INSET_H

#include <stddef.h>
#include <stdint.h>

#include "formats/image.h"
#include "lib/base/error.h"
#include "lib/head/person.h"
#include "lib/nn/rescale.h"

struct inset {
    const struct image *photo;  /* borrowed */
    size_t side;                /* N, of driven portraits */
    uint8_t *rest, *back;       /* (N,N,3) portrait and its background */
    long left, top;             /* the window in the photograph, */
    size_t width;               /* (W,W) pixels */
    float *hold, *fade;         /* (N) along an axis: how far from an edge,
                                 * 0 at it to 1; all 1 towards edges that the
                                 * photograph ends before */
    float *hold_y, *fade_y;
    float *block;
};

/* How shoulders have moved in the picture: p to scale p + move, positions
 * from -1 to 1. */
struct inset_motion {
    float scale, move[2];
};

/* What a thread draws with. */
struct inset_scratch {
    float *change, *sized;      /* of N and W pixels a side; NULL: the same */
    struct nn_plan plan;
    struct rescale resize;      /* N to W */
};

/* photo is borrowed; p's window must be of it (p->crop).  EX_DATAERR when the
 * window lies outside. */
int inset_init(struct inset *s, const struct image *photo,
               const struct person *p, size_t side, struct error *err);
/* Free what it holds; zeroed then. */
void inset_release(struct inset *s);
/* Memory for one thread's drawing into s. */
int inset_scratch_init(struct inset_scratch *w, const struct inset *s,
                       struct error *err);
/* Free what it holds; zeroed then. */
void inset_scratch_release(struct inset_scratch *w);

/* Where shoulders at pivot (3), head units, go between the source's camera
 * and a frame's, (3,4) each, where they stay (3) behind (neck_blend_stay). */
struct inset_motion inset_motion(const float pivot[3], const float stay[3],
                                 const float source[12], const float cam[12]);

/* out (height,width,3 of the photograph) with the driven portrait color
 * (N,N,3, premultiplied) and alpha (N,N). */
void inset_draw(uint8_t *out, const struct inset *s, struct inset_scratch *w,
                const float *color, const float *alpha,
                const struct inset_motion *m);

#endif
