/* A network of frozen weights on one picture, as a list of steps: each makes a
 * map of earlier ones, and how its gradient goes back to these stands beside
 * it.  A network says what it computes; its plan, forward and backward are
 * here.  Maps are numbers, 0 is the picture. */
#ifndef SPID_LAB_EVAL_TAPE_H
#define SPID_LAB_EVAL_TAPE_H

#include "lib/base/arena.h"
#include "lib/lab/eval/max_pool.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"

#define TAPE_MAPS 1024

enum tape_kind {
    TAPE_PICTURE, TAPE_CONV, TAPE_NORM, TAPE_POOL, TAPE_CONCAT, TAPE_ADD,
    TAPE_HALVE, TAPE_DOUBLE, TAPE_PRELU, TAPE_FLATTEN
};

/* What makes a map. */
struct tape_step {
    enum tape_kind kind;
    struct tape_step *of[2];    /* whose maps it reads; NULL: none */
    struct conv conv;
    struct batch_norm norm;     /* a step, or folded into conv */
    struct max_pool pool;
    size_t before;              /* of pool, */
    bool cut;                   /* too */
    enum nn_act act;            /* of add */
    size_t slope;               /* of a prelu: tensor (channels) */
    size_t h, w, channels;
    const float *x;             /* (h,w,channels): out, or the picture */
    float *out;
    float *d;                   /* x's gradient, in plans with a backward */
    bool begun;                 /* some of it is there */
    bool kept;                  /* beyond */
    int last;                   /* the last step that reads x; 0: none */
};

struct tape {
    struct params *ps;          /* borrowed */
    struct nn_plan plan;
    struct tape_step picture, *map[TAPE_MAPS];
    int count;
    float *part;                /* one more of a gradient that has begun */
    struct arena memory;
};

/* A map's gradient; NULL: 0. */
struct tape_seed {
    int map;
    const float *d;             /* (h,w,channels) */
};

/* No steps yet, on a picture of so many channels. */
void tape_init(struct tape *t, struct params *ps, size_t channels);
/* Free what it holds; zeroed then. */
void tape_release(struct tape *t);

/* ---- steps, which return the map they make ------------------------------- */

/* A convolution of stride 1, padded by half its kernel.  Its tensors, as all
 * that steps declare, are frozen. */
int tape_conv(struct tape *t, int of, const char *name, size_t out,
              size_t kernel, bool bias);
/* The convolution that made it, for what is set before the plan. */
struct conv *tape_layer(struct tape *t, int map);
/* A batch norm by its running statistics behind that convolution. */
void tape_fold_norm(struct tape *t, int map, const char *name, float eps);
/* The same as a step, then act. */
int tape_norm(struct tape *t, int of, const char *name, float eps,
              enum nn_act act);
/* lib/lab/eval/max_pool.h */
int tape_pool(struct tape *t, int of, size_t before, bool cut);
/* Channels of a, then b's. */
int tape_concat(struct tape *t, int a, int b);
/* Their sum, then act: none or ACT_RELU. */
int tape_add(struct tape *t, int a, int b, enum nn_act act);
/* Half as large: means of 2x2 pixels. */
int tape_halve(struct tape *t, int of);
/* Twice as large: each pixel four times. */
int tape_double(struct tape *t, int of);
/* x where that is positive, else x times its channel's slope, a tensor. */
int tape_prelu(struct tape *t, int of, const char *name);
/* A linear layer of a map of h x w pixels, channels slowest. */
int tape_linear(struct tape *t, int of, size_t h, size_t w, const char *name,
                size_t out);
/* The map will be asked for: otherwise plans for inference use its memory again
 * behind the last step that reads it. */
void tape_keep(struct tape *t, int map);

/* ---- use ------------------------------------------------------------------ */

/* For a picture of h x w pixels; the weights are in ps.  EX_OSERR. */
int tape_plan(struct tape *t, size_t h, size_t w, struct nn_options opt,
              struct error *err);
/* All maps of a picture (h,w,channels), which must stay until the backward. */
void tape_forward(const float *picture, struct tape *t);
/* A map of the last forward, which no step reads or which was kept,
 * (1,h,w,channels) as in shape; shape may be NULL. */
const float *tape_map(size_t shape[4], const struct tape *t, int map);
/* dpicture is written, from the gradients of n maps; NN_FROZEN plans. */
void tape_backward(float *dpicture, const struct tape_seed *seed, size_t n,
                   struct tape *t);

#endif
