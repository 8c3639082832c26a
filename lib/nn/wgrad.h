/* The weights' gradient of convolutions that learn in bfloat16, any kernel,
 * stride and padding.  Activations and gradients are floats in memory and are
 * rounded while they are laid out in pairs of neighbouring pixels, which the
 * processor multiplies and adds in one step; sums are float. */
#ifndef SPID_NN_WGRAD_H
#define SPID_NN_WGRAD_H

#include <stdint.h>

#include "lib/nn/plan.h"

struct conv;
struct conv_shape;

struct wgrad {
    struct nn_plan *plan;
    size_t images, h, w, oh, ow;
    size_t in, out, kernel, stride, top, left;
    size_t in_row;               /* channels in memory, `in` and more */
    bool half_in, half_out;      /* the input or the gradient is bfloat16 */
    size_t in_pixels, out_pixels;   /* of an image; the last row may be short */
    size_t pairs;                /* of pixels in a row of the output */
    size_t rows;                 /* of the output, summed at a time */
    size_t few;                  /* of these, in one product */
    size_t ld;                   /* words of a pair of inputs: kernel*in, and
                                  * what blocks read beyond */
    size_t wide;                 /* out, whole panels */
    size_t words;                /* of pairs, for a part */
    float *dw;                   /* (NN_PARTS,kernel,kernel*in,wide) */
};

/* NN_BF16 plans with a backward, where the processor has the products, and
 * layers that are wide enough to gain by them. */
bool wgrad_wanted(const struct conv *c);
/* Buffers for the layer c of this shape. */
void wgrad_plan(struct wgrad *g, const struct conv *c,
                const struct conv_shape *s);
/* dw (out,in_row,kernel,kernel) += the gradient, from dout (B,oh,ow,out) and
 * in (B,h,w,in_row), floats or as planned; channels beyond `in` get none. */
void wgrad_add(float *dw, const void *dout, const void *in, struct wgrad *g);

/* Input rows that `rows` rows of the output see through the kernel's rows
 * first, first + stride, ... */
static inline size_t wgrad_seen(const struct wgrad *g, size_t first,
                                size_t rows)
{
    return rows + (g->kernel - 1 - first) / g->stride;
}

#endif
