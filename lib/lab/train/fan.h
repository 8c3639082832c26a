/* The face alignment network FAN (Bulat and Tzimiropoulos 2017), the frozen
 * network of L_lmk in Section 3.3: one heat map for each of 68 landmarks from
 * a stack of hourglasses, each of which sees what the one before it found.
 * The backward goes to the picture.  Tensors have the names of the authors'
 * PyTorch package. */
#ifndef SPID_LAB_TRAIN_FAN_H
#define SPID_LAB_TRAIN_FAN_H

#include "formats/safetensors.h"
#include "lib/lab/eval/tape.h"

#define FAN_LANDMARKS 68
#define FAN_SIDE 256          /* pixels of the pictures it was trained with */
#define FAN_STACKS 4          /* hourglasses at most */
#define FAN_MULTIPLE 64       /* sides are multiples of this */
#define FAN_WIDTH_MAX 1024    /* channels; theirs have 256 */

struct fan {
    struct tape tape;
    int heat;                 /* the last stack's maps */
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
 * returned. */
void fan_backward(float *drgb, const float *dheat, struct fan *f);

#endif
