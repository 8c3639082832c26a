/* How sure E_m is that its crop shows an upright, whole face in place: a
 * logistic unit on its pooled features.  Tensors "<prefix>sure.weight"
 * [1,features] and "<prefix>sure.bias" [1], which a model may lack. */
#ifndef SPID_NET_CONFIDENCE_HEAD_H
#define SPID_NET_CONFIDENCE_HEAD_H

#include "lib/nn/dense.h"

/* Declare the two tensors; a zeroed layer is none. */
void confidence_head_init(struct dense *d, struct params *ps,
                          const char *prefix, size_t features);

/* 0 to 1 from pooled (features); 1 when there is no such head. */
float confidence_head_forward(const struct dense *d, const float *pooled);

/* Logistic loss against truth (0 or 1), times scale; its gradient is added to
 * the head's. */
double confidence_head_loss(const struct dense *d, const float *pooled,
                            double truth, double scale);

#endif
