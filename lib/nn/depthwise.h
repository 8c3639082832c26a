/* Depthwise convolutions, 3x3 and 5x5, stride 1 and 2, NHWC: kernels of our
 * own, for oneDNN's weight gradients are slow, and a browser has no oneDNN. */
#ifndef SPID_NN_DEPTHWISE_H
#define SPID_NN_DEPTHWISE_H

#include "lib/nn/conv.h"

/* Channels the kernels handle at once, whatever the vector length. */
#define DEPTHWISE_LANES 16
/* Output columns computed together. */
#define DEPTHWISE_COLUMNS 7
/* Rows of the output to a piece of work. */
#define DEPTHWISE_ROWS 14

struct depthwise {
    struct params *ps;
    size_t weight;                /* (C,1,k,k) in ps */
    size_t channels, kernel, stride;
    enum conv_pad pad;
    enum nn_act act;              /* of NN_INFER plans, with the folded norm */
    const struct batch_norm *norm;      /* folded in; or NULL */
    /* as planned */
    size_t batch, h, w, oh, ow;
    size_t top, left;
    struct nn_plan *plan;
    float *taps, *flipped;        /* (C/16 up,k*k,16), zeros beyond C */
    float *bias;                  /* (C up) */
    size_t pad_size;              /* floats of a thread's 16 channels, padded */
    float *dw;                    /* (batch,k*k,C) */
};

/* Declare "<name>.weight"; kernel 3 or 5, stride 1 or 2. */
void depthwise_init(struct depthwise *d, struct params *ps, const char *name,
                    size_t channels, size_t kernel, size_t stride);
/* Inputs (batch,h,w,channels). */
void depthwise_plan(struct depthwise *d, struct nn_plan *p, size_t batch,
                    size_t h, size_t w);

/* out (B,oh,ow,C) from in (B,h,w,C). */
void depthwise_forward(float *out, const float *in, struct depthwise *d);
/* din is written; the weights' gradient is added to ps->g. */
void depthwise_backward(float *din, const float *dout, const float *in,
                        struct depthwise *d);

#endif
