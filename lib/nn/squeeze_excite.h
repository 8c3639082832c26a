/* Squeeze and excite, and the spatial mean. */
#ifndef SPID_NN_SQUEEZE_EXCITE_H
#define SPID_NN_SQUEEZE_EXCITE_H

#include "lib/nn/conv.h"

struct squeeze_excite {
    struct conv reduce, expand;       /* linear layers of the mean */
    bool additive;                    /* gate = 1 + W2 act(..) + b2 */
    /* as planned */
    size_t batch, pixels;
    float *mean, *inner, *gate;       /* (B,C), (B,hidden), (B,C) */
    float *part;                      /* (B,NN_PARTS,C) */
    float *dgate, *dinner, *dmean;    /* plans with a backward */
};

/* Declare "<name>.conv_reduce.*", a relu after it, and "<name>.conv_expand.*";
 * others declare `reduce` and `expand` themselves. */
void squeeze_excite_init(struct squeeze_excite *s, struct params *ps,
                         const char *name, size_t channels, size_t hidden);
/* Maps of `pixels` pixels. */
void squeeze_excite_plan(struct squeeze_excite *s, struct nn_plan *p,
                         size_t batch, size_t pixels);
/* y (B,pixels,C) = x gate, gate = hsig(W2 act(W1 mean(x) + b1) + b2), or as
 * `additive` has it; y may be x when nobody asks for a backward. */
void squeeze_excite_forward(float *y, const float *x, struct squeeze_excite *s);
/* dx may be dy. */
void squeeze_excite_backward(float *dx, const float *dy, const float *x,
                             struct squeeze_excite *s);

/* mean (B,C) over pixels of x (B,pixels,C); part (B,NN_PARTS,C) scratch. */
void spatial_mean_forward(float *mean, float *part, const float *x, size_t B,
                          size_t pixels, size_t C);
/* dx (B,pixels,C) is written from dmean (B,C). */
void spatial_mean_backward(float *dx, const float *dmean, size_t B,
                           size_t pixels, size_t C);

#endif
