/* The light on a face, from its crop: 16 x 16 cells' log luminance, against the
 * crop's middle's, through one hidden layer.  Of a crop and its mirror image it
 * says mirrored things, by construction.  Learned on people of scans, whose light
 * is known; ours, not the paper's.  Tensors
 * "light.{hidden,slope}.{weight,bias}", which a model may lack. */
#ifndef SPID_NET_LIGHT_NET_H
#define SPID_NET_LIGHT_NET_H

#include "lib/nn/dense.h"

#define LIGHT_NET_SIDE 224      /* pixels of a crop, that of the encoders */
#define LIGHT_NET_CELLS 16      /* along a side */
#define LIGHT_NET_HIDDEN 32

struct light_net {
    struct dense hidden, slope; /* zeroed: the model has none */
};

/* Declare the tensors. */
void light_net_init(struct light_net *n, struct params *ps);

/* l (3), camera frame, at most 1 long: in the crop rgb (224,224,3), sRGB within
 * [0,1], skin of normal n has 1 + l.n times its mean luminance.  Without
 * tensors 0. */
void light_net_forward(float l[3], const float *rgb,
                       const struct light_net *n);
/* Squared error against truth (3), times scale; its gradient is added to the
 * tensors'.  What it says is not cut to a length of 1 here. */
double light_net_loss(const float truth[3], const float *rgb, double scale,
                      const struct light_net *n);

#endif
