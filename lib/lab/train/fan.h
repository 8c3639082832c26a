/* The face alignment network FAN (Bulat and Tzimiropoulos 2017), the frozen
 * network of L_lmk in Section 3.3: one heat map for each of 68 landmarks from
 * a stack of hourglasses, each of which sees what the one before it found.
 * Tensors have the names of the authors' PyTorch package. */
#ifndef SPID_LAB_TRAIN_FAN_H
#define SPID_LAB_TRAIN_FAN_H

#include "formats/safetensors.h"
#include "lib/nn/tape.h"

#define FAN_LANDMARKS 68
#define FAN_SIDE 256          /* pixels of the pictures it was trained with */
#define FAN_STACKS 4          /* hourglasses at most */
#define FAN_MULTIPLE 64       /* sides are multiples of this */
#define FAN_WIDTH_MAX 1024    /* channels; theirs have 256 */

/* Hourglasses and channels of the network in a file; EX_DATAERR where it has
 * none. */
int fan_size(size_t *stacks, size_t *width, const struct safetensors *st,
             struct error *err);
/* The network's steps on a new tape; returns the map of the heat maps
 * (side/4,side/4,68) of a picture (side,side,3), 0..1 sRGB, whose side is a
 * multiple of FAN_MULTIPLE.  The public networks: 1 to 4 stacks, 256 wide; others
 * are multiples of 16 up to FAN_WIDTH_MAX. */
int fan_declare(struct tape *t, size_t stacks, size_t width);

#endif
