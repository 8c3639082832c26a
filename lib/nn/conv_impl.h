/* The inside of a planned convolution: who computes its forward, and oneDNN's
 * primitives.  Private to lib/nn/conv.c and lib/nn/conv_onednn.c. */
#ifndef SPID_NN_CONV_IMPL_H
#define SPID_NN_CONV_IMPL_H

#include "lib/nn/conv.h"
#include "lib/nn/engine.h"
#include "lib/nn/im2col.h"
#include "lib/nn/int8.h"
#include "lib/nn/small_linear.h"
#include "lib/nn/winograd.h"

#define CONV_BANDS 16

/* A convolution of n images h x w, padded, to oh x ow. */
struct conv_shape {
    size_t n, h, w, oh, ow;
    size_t top, left, bottom, right;
};

/* One way to compute the forward pass. */
struct conv_method {
    bool (*wanted)(const struct conv *c);
    void (*plan)(struct conv *c, const struct conv_shape *s);
    /* new weights w (out,in_data,k,k), the bias in impl->bias */
    void (*update)(struct conv *c, const float *w);
    void (*forward)(float *out, const float *in, struct conv *c);
};

/* One share of the weight gradient: some images, or a band of one. */
struct conv_part {
    struct nn_call call;
    size_t in_at, out_at;        /* offsets of its first values */
    float *dw;                   /* in oneDNN's layout */
};

/* A primitive's work cut into bands of rows, or of whole images. */
struct conv_bands {
    size_t count, scratch;       /* bytes of each band's scratch */
    struct conv_band {
        struct nn_call call;
        size_t in_at, out_at;    /* values before its first */
    } band[CONV_BANDS];
};

struct conv_impl {
    const struct conv_method *method;
    union {                      /* the method's own */
        struct winograd winograd;
        struct im2col im2col;
        struct small_linear small_linear;
        struct int8 int8;
    };
    /* oneDNN's */
    dnnl_data_type_t input, weights;     /* what it multiplies */
    struct conv_bands fwd, bwd_data;
    struct nn_call to_fwd, to_bwd, add_dw;
    void *w_fwd, *w_bwd;         /* weights as the primitives want them */
    size_t half_at;              /* of the input as bf16 or bytes, in the
                                  * scratch */
    size_t back_at;              /* of a backward's bf16 values, there too */
    size_t parts, dw_count;      /* dw_count: floats of a part's dw */
    size_t scratch;              /* bytes for one part */
    struct conv_part part[NN_PARTS];
    /* everybody's */
    float *bias;                 /* (out), with the norm folded in */
    float *stage;                /* (out,in_data,k,k), folded or padded, until
                                  * the layer has them; in inference a map's
                                  * memory */
    float *sums;                 /* (NN_SUMS+1,out): bias gradient's parts */
};

/* Rows [y0,y1) of one image of the output as a convolution of its own; first:
 * the first row of the input that it sees. */
struct conv_shape conv_band_of_output(const struct conv_shape *s,
                                      const struct conv *c, size_t y0,
                                      size_t y1, size_t *first);
/* Into how many bands a pass over so many rows of an image is cut. */
size_t conv_band_count(const struct conv *c, const struct conv_shape *s,
                       size_t rows);
/* Band i of n, of a backward along the input's rows; sets band's places. */
struct conv_shape conv_band_cut(struct conv_band *band, const struct conv *c,
                                const struct conv_shape *s, size_t i, size_t n,
                                bool back);

/* Plan the forward of a convolution of this shape; failures go to c->plan. */
void conv_onednn_plan_forward(struct conv *c, const struct conv_shape *s);
/* The same for the input's gradient. */
void conv_onednn_plan_backward_data(struct conv *c,
                                    const struct conv_shape *s);
/* The same for the weights' gradient, in parts of one thread each. */
void conv_onednn_plan_backward_weights(struct conv *c,
                                       const struct conv_shape *s);

/* Run a reorder of weights between the checkpoint's layout and oneDNN's. */
void conv_onednn_reorder(struct nn_call *call, void *to, const void *from,
                         struct conv *c);
/* out (B,oh,ow,out) from src, the input in the type planned; scale (out) is for
 * int8, else NULL. */
void conv_onednn_forward(void *out, const void *src, const float *bias,
                         const float *scale, struct conv *c);
/* din (B,h,w,in_data) from dout (B,oh,ow,out). */
void conv_onednn_backward_data(void *din, const void *dout, struct conv *c);
/* The parts' gradients, added up in order; returned in oneDNN's layout. */
const float *conv_onednn_backward_weights(const void *dout, const void *in,
                                          struct conv *c);

#endif
