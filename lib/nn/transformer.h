/* A stream of tokens through a block of a transformer that normalises first:
 *
 *   x += scale1 out(attention(in(norm1 x)))
 *   x += scale2 shrink(act(grow(norm2 x)))
 *
 * Streams of several kinds may attend to each other: what attention reads and
 * writes is the caller's. */
#ifndef SPID_NN_TRANSFORMER_H
#define SPID_NN_TRANSFORMER_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

/* What a public model calls the tensors of a block, and its numbers. */
struct transformer_kind {
    const char *norm1, *in[3];  /* queries, keys, values; or all, NULL, NULL */
    const char *unit[2];        /* weights (dim) of queries and keys, a head's
                                 * over their root mean square; or NULL */
    const char *out;            /* NULL: nothing comes back to this stream */
    const char *scale1;         /* NULL: 1; likewise scale2 */
    const char *norm2;          /* NULL: without weight and bias */
    const char *grow, *shrink, *scale2;
    size_t widen;               /* numbers of a hidden token over a token's */
    enum nn_act act;
    float eps1, eps2;           /* of the norms */
};

struct transformer {
    struct transformer_kind kind;
    struct params *ps;
    struct conv in[3], out, grow, shrink;
    struct layer_norm norm1, norm2;
    size_t unit[2], scale1, scale2;
    size_t width, dim;          /* of a token, of a head */
    /* as planned */
    size_t rows;
    bool learns;
    float *x, *mid;             /* (rows,width) input; after attention */
    float *n1, *n2, *stat1, *stat2;
    float *qkv, *att, *p;       /* into and out of attention; through `out` */
    float *f1, *g, *f2;
};

/* What a backward pass writes. */
struct transformer_gradient {
    float *dx;                  /* (rows,width) after a block, then before it */
    float *ds, *dn;             /* (rows,width) scratch */
    float *wide, *sums;         /* (2,rows,widen * width), (NN_SUMS,2,width) */
};

/* Declare "<at><name>" of all that kind names, for tokens of so many numbers.
 * Bad sizes are the caller's to refuse: heads divide width. */
void transformer_init(struct transformer *t, struct params *ps, const char *at,
                      const struct transformer_kind *kind, size_t width,
                      size_t heads);
/* For so many tokens; where the plan has a backward with all maps but t->x. */
void transformer_plan(struct transformer *t, struct nn_plan *p, size_t rows);
/* Inference works in maps of the caller, which streams and blocks that take
 * turns share: x and normed (rows,width), wide (rows,widen * width), and qkv as
 * attention reads it, which may be wide.  May be called before every pass. */
void transformer_use(struct transformer *t, float *x, float *normed, float *qkv,
                     float *wide);

/* t->qkv from t->x; queries, keys and values of their own are `part` apart. */
void transformer_attend(struct transformer *t, size_t part);
/* next (rows,width), or t->x in inference, from t->att. */
void transformer_feed(float *next, struct transformer *t);
/* Both, around attention within the stream. */
void transformer_forward(float *next, struct transformer *t,
                         struct attention *a);

/* Buffers for blocks of `rows` tokens. */
void transformer_plan_gradient(struct transformer_gradient *g,
                               struct nn_plan *p, const struct transformer *t);
/* d->dx += the gradient through norm, from dy after it and x before it. */
void transformer_norm_backward(struct transformer_gradient *d, const float *dy,
                               const float *x, const float *stat,
                               const struct layer_norm *norm, size_t rows);
/* d->dx from after the block to before it; of kinds as DINOv2's: one layer in,
 * no unit, both scales. */
void transformer_backward(struct transformer_gradient *d,
                          struct transformer *t, struct attention *a);

#endif
