/* StyleGAN2's modulated layers (Karras et al. 2020) as steps of a tape, without
 * ever rebuilding a weight: the input is scaled by the style, the output by the
 * demodulation. */
#ifndef SPID_NN_STYLE_H
#define SPID_NN_STYLE_H

#include "lib/nn/tape.h"

/* lrelu(d conv(st x) + gain noise + bias), st of the latent code; where side is
 * twice x's, x is enlarged first.  Tensors "<name>.modulated_conv.weight"
 * (1,out,in,3,3), "<name>.weight" (1), "<name>.bias" (1,out,1,1),
 * "<name>.modulated_conv.modulation.*"; noise is the buffer of that name,
 * (1,1,side,side). */
int style_conv(struct tape *t, int x, int latent, const char *name,
               const char *noise, size_t side, size_t out, bool up);
/* The picture W (st x) + b + the one before, enlarged to side, -1: none.
 * Tensors "<name>.modulated_conv.weight" (1,3,in,1,1), ".modulation.*" and
 * "<name>.bias" (1,3,1,1). */
int style_to_rgb(struct tape *t, int x, int latent, int before,
                 const char *name, size_t side);

#endif
