/* A network as a graph of ONNX operators (formats/onnx.h), for other people's
 * engines, from its declared tensors; it needs no plan.  A list of steps
 * (tape.h) says itself so; other networks have an X_graph beside X_forward.
 *
 * Values are ints.  The graph remembers the first thing that went wrong, like
 * a plan.  Inputs and outputs are rows of channels (B,h,w,C), as at every
 * border of ours; between graph_maps and graph_rows lie ONNX's (B,C,h,w). */
#ifndef SPID_NN_GRAPH_H
#define SPID_NN_GRAPH_H

#include "formats/onnx.h"
#include "lib/nn/conditional_conv.h"
#include "lib/nn/conv.h"
#include "lib/nn/dense.h"
#include "lib/nn/depthwise.h"
#include "lib/nn/squeeze_excite.h"

struct graph {
    struct onnx_graph file;
    struct error err;           /* code 0: all well so far */
};

/* An empty graph; both texts are borrowed. */
void graph_init(struct graph *g, const char *name, const char *about);
/* Free what it holds; zeroed then. */
void graph_release(struct graph *g);
/* Remember a failure; the first one stays. */
void graph_fail(struct graph *g, int code, const char *text);

/* An input of this name and shape. */
int graph_input(struct graph *g, const char *name, int ndim,
                const size_t *dim);
#define GRAPH_INPUT(g, name, ...)                                             \
    graph_input(g, name, sizeof((size_t[]){__VA_ARGS__}) / sizeof(size_t),      \
                (size_t[]){__VA_ARGS__})
/* Let v, which an operator gave, be an output of this name and shape. */
void graph_output(struct graph *g, int v, const char *name, int ndim,
                  const size_t *dim);
#define GRAPH_OUTPUT(g, v, name, ...)                                         \
    graph_output(g, v, name, sizeof((size_t[]){__VA_ARGS__}) / sizeof(size_t),  \
                 (size_t[]){__VA_ARGS__})

/* n numbers, copied; of n dimensions when n is 0: x[0] alone. */
int graph_floats(struct graph *g, const float *x, size_t n);
/* One number. */
int graph_real(struct graph *g, float x);
/* A list of n whole numbers: shapes, places. */
int graph_ints(struct graph *g, const int64_t *x, size_t n);
#define GRAPH_INTS(g, ...)                                                    \
    graph_ints(g, (int64_t[]){__VA_ARGS__},                                   \
               sizeof((int64_t[]){__VA_ARGS__}) / sizeof(int64_t))

/* An operator on n values; its attributes follow. */
int graph_node(struct graph *g, const char *op, const int *in, size_t n);
#define GRAPH_NODE(g, op, ...)                                                \
    graph_node(g, op, (int[]){__VA_ARGS__},                                   \
               sizeof((int[]){__VA_ARGS__}) / sizeof(int))
/* Attributes of the last operator. */
void graph_set_int(struct graph *g, const char *name, int64_t x);
void graph_set_ints(struct graph *g, const char *name, const int64_t *x,
                    size_t n);

/* (B,h,w,C) to (B,C,h,w), and back. */
int graph_maps(struct graph *g, int x);
int graph_rows(struct graph *g, int x);
/* Channels [from,to) of maps or of (N,C). */
int graph_slice(struct graph *g, int x, size_t from, size_t to);
/* a's and b's channels, side by side. */
int graph_concat(struct graph *g, int a, int b);

/* ---- layers ------------------------------------------------------------ */

int graph_act(struct graph *g, int x, enum nn_act act);
/* act(conv x), on maps; on rows (B,in) for a linear layer. */
int graph_conv(struct graph *g, int x, const struct conv *c);
int graph_linear(struct graph *g, int x, const struct conv *c);
/* W x + b, on rows (B,in). */
int graph_dense(struct graph *g, int x, const struct dense *d);
/* act(onto + conv x): what a layer with `add` gives. */
int graph_conv_add(struct graph *g, int onto, int x, const struct conv *c);
/* The layer whose weights depend on `by` (n). */
int graph_conditional_conv(struct graph *g, int x, int by,
                           const struct conditional_conv *v);
int graph_depthwise(struct graph *g, int x, const struct depthwise *d);
/* The running statistics', with its act. */
int graph_batch_norm(struct graph *g, int x, const struct batch_norm *n);
int graph_squeeze_excite(struct graph *g, int x,
                         const struct squeeze_excite *s);
/* Mean over the pixels of maps: (B,C). */
int graph_mean(struct graph *g, int x);
/* Maps of C channels to oh x ow pixels, bilinear (pixel centres at halves). */
int graph_resize(struct graph *g, int x, size_t C, size_t oh, size_t ow);
/* space_to_depth and depth_to_space of lib/nn/image.h, on maps. */
int graph_to_depth(struct graph *g, int x, size_t f);
int graph_to_space(struct graph *g, int x, size_t f);

#endif
