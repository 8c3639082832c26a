/* The face alignment network FAN (Bulat and Tzimiropoulos 2017), the frozen
 * network of L_lmk in Section 3.3: one heat map for each of 68 landmarks from
 * a stack of hourglasses, each of which sees what the one before it found.
 * The backward goes to the picture.  Tensors have the names of the authors'
 * PyTorch package. */
#ifndef SPID_LAB_TRAIN_FAN_H
#define SPID_LAB_TRAIN_FAN_H

#include "formats/safetensors.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"

#define FAN_LANDMARKS 68
#define FAN_SIDE 256          /* pixels of the pictures it was trained with */
#define FAN_STACKS 4          /* hourglasses at most */
#define FAN_LEVELS 4          /* an hourglass halves its maps so often */
#define FAN_MULTIPLE 64       /* sides are multiples of this */
#define FAN_WIDTH_MAX 1024    /* channels; theirs have 256 */

/* y = conv(a), a = relu(norm x) */
struct fan_step {
    struct batch_norm norm;
    struct conv conv;
    float *a, *y;
};

/* y = [s0(x), s1(s0), s2(s1)] + x, or where channels change + wide(x) */
struct fan_block {
    struct fan_step step[3], wide;
    bool widens;
    size_t rows, out;         /* pixels, channels of y */
    const float *x;
    float *y;
};

/* At each level, outermost first: y = outer(x) + twice as large
 * back(inner(down(x halved))), inner the next level, at the last a block. */
struct fan_hourglass {
    struct fan_block outer[FAN_LEVELS], down[FAN_LEVELS], back[FAN_LEVELS];
    struct fan_block inner;
    float *half[FAN_LEVELS], *y[FAN_LEVELS];
};

/* features = relu(norm(last(top(hourglass x)))), heat = maps(features); the
 * next stack's x = x + again(features) + found(heat). */
struct fan_stack {
    struct fan_hourglass hourglass;
    struct fan_block top;
    struct conv last, maps, again, found;
    struct batch_norm end;
    float *features, *heat, *next;
};

struct fan {
    struct params *ps;
    struct nn_plan plan;
    struct conv stem;         /* 7x7 stride 2, with its norm folded in */
    struct batch_norm stem_norm;
    struct fan_block block[3];     /* before the halving, and after it */
    struct fan_stack stack[FAN_STACKS];
    size_t stacks, width, side;
    float *first, *half;      /* of stem; of block[0] */
    const float *rgb;
    float *g[6];              /* gradients on their way, and scratch */
    float *low[FAN_LEVELS];   /* gradients inside an hourglass */
};

/* Hourglasses and channels of the network in a file; EX_DATAERR where it has
 * none. */
int fan_size(size_t *stacks, size_t *width, const struct safetensors *st,
             struct error *err);
/* Declare the tensors, all frozen.  The public networks: 1 to 4 stacks, 256
 * wide; others are multiples of 16 up to FAN_WIDTH_MAX. */
void fan_init(struct fan *f, struct params *ps, size_t stacks, size_t width);
/* One picture of side x side pixels, a multiple of FAN_MULTIPLE; the weights
 * are in ps. */
int fan_plan(struct fan *f, size_t side, struct nn_options opt,
             struct error *err);
/* Free what _init and _plan allocated; zeroed then. */
void fan_release(struct fan *f);

/* The heat maps (side/4,side/4,68) of rgb (side,side,3), 0..1 sRGB, which must
 * stay until the backward. */
const float *fan_forward(const float *rgb, struct fan *f);
/* drgb (side,side,3) is written, from the gradient dheat of what the forward
 * returned, which is used up. */
void fan_backward(float *drgb, float *dheat, struct fan *f);

#endif
