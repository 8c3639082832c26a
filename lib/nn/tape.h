/* A network as a list of steps: each makes a map of earlier ones, and beside it
 * stands how its gradient goes back to these, and how it reads in ONNX.  A
 * network says once what it computes; plan, forward, backward and graph of it
 * are here.  Maps are numbers, 0 is the picture, whatever that is.
 *
 *   tape_init, the steps, params_allocate, tape_plan, tape_forward,
 *   [tape_backward,] tape_release */
#ifndef SPID_NN_TAPE_H
#define SPID_NN_TAPE_H

#include <stddef.h>

#include "lib/base/arena.h"
#include "lib/nn/conv.h"
#include "lib/nn/graph.h"
#include "lib/nn/norm.h"
#include "lib/nn/rescale.h"

#define TAPE_MAPS 1024
#define TAPE_READS 3

struct tape_step;

/* A kind of step. */
struct tape_op {
    size_t size;                /* bytes of its layer */
    int in_place;               /* its map may lie where that one lay of those
                                 * that it reads: 1, the first, ..; 0: none */
    bool learns;                /* its backward adds to gradients of tensors */
    /* Sets the map's size, which is the first read map's, and plans the layer;
     * may be NULL. */
    void (*plan)(struct tape_step *s, struct nn_plan *p);
    void (*forward)(struct tape_step *s);
    /* to = what of s->d is the gradient of the k-th map read; called for the
     * last one first.  NULL: nobody wants it, but tensors learn. */
    void (*backward)(float *to, struct tape_step *s, int k);
    /* Its value from those of the maps read (graph.h); NULL: it has none. */
    int (*graph)(struct graph *g, const int *in, const struct tape_step *s);
};

/* What makes a map. */
struct tape_step {
    const struct tape_op *op;   /* NULL: the picture */
    void *layer;                /* as op has it */
    int number;                 /* the map's */
    struct tape_step *of[TAPE_READS];   /* whose maps it reads, */
    int reads;                          /* so many */
    size_t batch, h, w, channels;
    const float *x;             /* (batch,h,w,channels): out, or the picture */
    float *out;
    float *d;                   /* x's gradient, in plans with a backward,
                                 * between its readers' backward and its own */
    bool begun;                 /* some of it is there */
    bool constant;              /* no gradient goes back to it */
    bool half;                  /* where it may be it is bfloat16 */
    int readers, left;          /* steps that read it; that are not planned */
};

struct tape {
    struct params *ps;          /* borrowed */
    bool frozen;                /* the tensors that steps declare */
    struct nn_plan plan;
    struct tape_step picture, *map[TAPE_MAPS];
    int count;
    float *part;                /* one more of a gradient that has begun */
    struct arena memory;
    max_align_t spare[32];      /* a layer that nobody reads */
};

/* A map's gradient; NULL: 0. */
struct tape_seed {
    int map;
    const float *d;             /* (batch,h,w,channels) */
};

/* No steps yet, on a picture of so many channels; t stays where it is from here
 * on.  frozen: what steps declare does not learn. */
void tape_init(struct tape *t, struct params *ps, size_t channels, bool frozen);
/* Free what it holds; zeroed then. */
void tape_release(struct tape *t);

/* ---- steps, which return the map they make ------------------------------- */

/* One more step on n maps.  Without memory, of which tape_plan tells, there is
 * a layer to write into all the same. */
int tape_step(struct tape *t, const struct tape_op *op, const int *of, int n);
#define TAPE_STEP(t, op, ...)                                                 \
    tape_step(t, op, (int[]){__VA_ARGS__},                                    \
              sizeof((int[]){__VA_ARGS__}) / sizeof(int))
size_t tape_channels(const struct tape *t, int map);
/* The map will be asked for: otherwise plans for inference use its memory again
 * behind the last step that reads it.  Returns it. */
int tape_keep(struct tape *t, int map);
/* Nothing up to it learns, and nobody asks for the picture's gradient. */
void tape_constant(struct tape *t, int map);

/* A convolution of stride 1, padded by half its kernel. */
int tape_conv(struct tape *t, int of, const char *name, size_t out,
              size_t kernel, bool bias);
/* onto + the convolution, then its act. */
int tape_conv_onto(struct tape *t, int onto, int of, const char *name,
                   size_t out, size_t kernel, bool bias);
/* A linear layer of each pixel. */
int tape_linear(struct tape *t, int of, const char *name, size_t out);
/* Any layer that adds to nothing, as conv.h declares it. */
int tape_declared(struct tape *t, int of, const struct conv *c);
/* Of a step of these four what may be set before the plan. */
struct conv *tape_layer(struct tape *t, int map);
/* That step's map lies in memory as bfloat16 where it may (conv.h, half_out);
 * one convolution reads it. */
void tape_halve_map(struct tape *t, int map);
/* A batch norm by its running statistics, folded into that convolution. */
void tape_fold_norm(struct tape *t, int map, const char *name, float eps);
/* Channels of a, then b's. */
int tape_concat(struct tape *t, int a, int b);
/* Their sum, then act: none or ACT_RELU. */
int tape_add(struct tape *t, int a, int b, enum nn_act act);
/* act of it; those of act_backward_out. */
int tape_act(struct tape *t, int of, enum nn_act act);
/* So many times it. */
int tape_scale(struct tape *t, int of, float times);
/* Of h x w pixels. */
int tape_rescale(struct tape *t, int of, enum rescale_mode mode, size_t h,
                 size_t w);
/* depth_to_space of lib/nn/image.h. */
int tape_to_space(struct tape *t, int of, size_t factor);
/* One pixel of all values, channels slowest. */
int tape_flatten(struct tape *t, int of, size_t pixels);

/* ---- use ------------------------------------------------------------------ */

/* Values of the map. */
size_t tape_count(const struct tape_step *s);

/* For `batch` pictures of h x w pixels; the weights are in ps.  EX_OSERR. */
int tape_plan(struct tape *t, size_t batch, size_t h, size_t w,
              struct nn_options opt, struct error *err);
/* All maps of the pictures (batch,h,w,channels).  last: where the last one
 * goes, or NULL.  Both must stay until the backward. */
void tape_forward(float *last, const float *picture, struct tape *t);
/* A map of the last forward, (batch,h,w,channels) as in shape, which may be
 * NULL; in plans for inference one that is kept, or that no step reads. */
const float *tape_map(size_t shape[4], const struct tape *t, int map);
/* dpicture is written, or NULL, from the gradients of n maps. */
void tape_backward(float *dpicture, const struct tape_seed *seed, size_t n,
                   struct tape *t);
/* Map last's value in a graph where that of map `from` is x, by the steps after
 * it, planned or not. */
int tape_graph(struct graph *g, int x, int from, int last,
               const struct tape *t);

#endif
