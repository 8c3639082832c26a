/* What every network has in common: how it is planned and run.
 *
 * The life of a network X is the same for all of lib/net:
 *   X_init(&x, ps, prefix, ...)   declares its tensors in ps (before
 *                                 params_allocate); keeps the pointer ps
 *   X_plan(&x, sizes, opt, err)   after params_allocate: buffers, primitives
 *                                 with the weights in ps folded in; when these
 *                                 change: nn_plans_update (plan.h)
 *   X_forward(out, in, &x)        one pass; never allocates, cannot fail
 *   X_backward(din, dout, &x)     after a forward planned for training: adds
 *                                 to the gradients in ps->g, writes din (not
 *                                 added; NULL where nobody wants it)
 *   X_release(&x)                 an all-zero struct is fine, twice is fine
 * Activations are rows of channels (NHWC) at every border.  A network is not
 * for two threads at once; it runs on parallel_threads() of them, with the
 * same bits for any number. */
#ifndef SPID_NN_NN_H
#define SPID_NN_NN_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

/* The type of what convolutions and linear layers multiply; sums, other
 * layers and all borders are float always.  In inference each type allows what
 * those before it do, and each layer takes the form that costs the fewest
 * cycles on this processor (lib/nn/form.h): none is slower than the type before
 * it.  In training NN_BF16 is for layers of 16 channels and more and 1x1 layers
 * (pointwise.h), on processors that have them, and the rest is float. */
enum nn_type {
    NN_F32,
    NN_FAST,    /* float, and Winograd's method; within the tolerance that
                 * golden files set for float */
    NN_BF16,    /* products of bfloat16 values */
    NN_INT8     /* products of 8-bit values (lib/nn/int8.h); for the refiners,
                 * inference only */
};

enum nn_mode {
    NN_INFER,   /* batch norm folded into the weights, no backward */
    NN_TRAIN,   /* batch statistics, running statistics are updated */
    NN_FROZEN   /* as NN_INFER in what it computes, but with a backward */
};

struct nn_options {
    enum nn_mode mode;
    enum nn_type type;      /* NN_F32 or NN_BF16 unless NN_INFER */
};

/* "f32", "bf16", "fast", "int8"; -1 for any other word. */
int nn_type_parse(enum nn_type *type, const char *word);
/* The word for it. */
const char *nn_type_name(enum nn_type type);
/* Whether the processor computes this type natively. */
bool nn_type_native(enum nn_type type);

#endif
