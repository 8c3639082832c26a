/* Batch and layer normalisation.  Sums run over a fixed split. */
#ifndef SPID_NN_NORM_H
#define SPID_NN_NORM_H

#include "lib/nn/act.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

#define NORM_EPS 1e-5f          /* PyTorch's own */

struct batch_norm {
    struct params *ps;
    size_t weight, bias, mean, var;  /* tensors in ps; mean and var frozen */
    size_t channels;
    float eps;
    enum nn_act act;                 /* applied after the normalisation */
    /* as planned */
    struct nn_plan *plan;
    size_t rows;                     /* B*h*w */
    float *batch_mean, *rstd;        /* (C) of the last forward */
    size_t period;                   /* channels repeated to a long row */
    float *scale, *shift;            /* (period): y = act(x scale + shift) */
    float *coef;                     /* (4,period) of the backward */
    float *part;                     /* (NN_SUMS,2,C) */
};

/* Declare "<name>.weight", ".bias", ".running_mean", ".running_var". */
void batch_norm_init(struct batch_norm *n, struct params *ps,
                     const char *name, size_t channels, float eps);
/* Maps of `rows` pixels in all, channels wide. */
void batch_norm_plan(struct batch_norm *n, struct nn_plan *p, size_t rows);

/* y (rows,C) = act((x - mean) / sqrt(var + eps) * weight + bias) (+ res, or
 * NULL), with the batch's statistics in NN_TRAIN plans, which also move the
 * running ones by 0.1, and the running ones in NN_FROZEN plans. */
void batch_norm_forward(float *y, const float *x, const float *res,
                        struct batch_norm *n);
/* dx (rows,C) from dy; dx may be dy.  x as in the forward.  Gradients of
 * weight and bias are added to ps->g, unless the weight is frozen. */
void batch_norm_backward(float *dx, const float *dy, const float *x,
                         struct batch_norm *n);

struct layer_norm {
    struct params *ps;
    size_t weight, bias;             /* tensors in ps, or NN_NONE */
    size_t channels;
    float eps;
};

/* Declare "<name>.weight" and ".bias"; of no name: neither. */
void layer_norm_init(struct layer_norm *n, struct params *ps,
                     const char *name, size_t channels, float eps);
/* y (rows,C) = (x - mean) rstd weight + bias over each row; stat (2,rows), mean
 * and rstd, is kept for the backward, NULL where nobody wants it. */
void layer_norm_forward(float *y, float *stat, const float *x,
                        const struct layer_norm *n, size_t rows);
/* dx is written; gradients of weight and bias, which there must be, are added
 * to ps->g; part is scratch of NN_SUMS * 2 * C floats. */
void layer_norm_backward(float *dx, float *part, const float *dy,
                         const float *x, const float *stat,
                         const struct layer_norm *n, size_t rows);

#endif
