/* 3x3 convolutions on small maps with many channels (StyleUNet's innermost):
 * sums of thousands of terms, made in pieces so that their rounding errors do
 * not pile up as one long chain's would. */
#ifndef SPID_NN_PATCH_H
#define SPID_NN_PATCH_H

#include "lib/nn/act.h"
#include "lib/nn/plan.h"

struct conv;

struct patch {
    const struct conv *c;
    size_t K, N;             /* 9 in; out rounded up to a panel */
    float *w;                /* packed, piece by piece */
    float *bias;
    float *rows;             /* (B*h*w, 9 in) */
    float *sum;              /* (B*h*w, out) */
};

/* 3x3, stride 1, at least 256 channels, and at most 1024 pixels (NN_F32) or
 * 256 (NN_FAST: Winograd's errors there would reach every other layer by the
 * style). */
bool patch_wanted(const struct conv *c);
void patch_plan(struct patch *t, const struct conv *c, struct nn_plan *p);
void patch_update(struct patch *t, const float *w, const float *bias);
void patch_forward(float *out, const float *in, struct patch *t);

#endif
