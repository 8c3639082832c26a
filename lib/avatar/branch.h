/* What the three branches of an avatar share: views of the Gaussians' arrays,
 * and the prior, which makes a decoder start from what the source picture
 * says (configuration rgb_skip). */
#ifndef SPID_AVATAR_BRANCH_H
#define SPID_AVATAR_BRANCH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/net/gaussian_head.h"
#include "lib/nn/params.h"

#define BRANCH_SCALE_MAX GAUSSIAN_SCALE_MAX
/* Standard deviation over the spacing, and opacity where no decoder says it: no
 * holes.  Others: tests/bench/README.md, "Skin is thin", "The constants of hidden
 * hair". */
#define BRANCH_OVERLAP 0.6f
#define BRANCH_SOLID 0.97f

/* The paper's ablations: what an avatar is baked without. */
enum avatar_without {
    WITHOUT_DYNAMIC = 1, WITHOUT_STATIC = 2, WITHOUT_MOUTH = 4,
    WITHOUT_INTERP = 8,     /* no midpoints: V dynamic Gaussians */
    WITHOUT_DEFORM = 16,    /* Delta U = 0: the uniform plane */
    WITHOUT_NECK = 32       /* no neck blend: shoulders turn with the head */
};

/* ---- the Gaussians ----------------------------------------------------- */

/* Gaussians of one branch or of all, or their gradients: n rows of arrays that
 * the avatar owns. */
struct branch_set {
    size_t n, channels;
    float *mean;            /* (n,3) centres at the source's pose */
    float *scale;           /* (n,3) standard deviations, head units */
    float *quat;            /* (n,4) w first */
    float *opacity;         /* (n) */
    float *color;           /* (n,channels) */
    float *neck;            /* (n) neck blend weights; NULL in gradients */
    float *seen;            /* (n) how far the source picture shows it, 0..1
                             * (lib/photo/place.h); NULL in gradients */
};

/* Gaussians first .. first + n - 1 of s. */
struct branch_set branch_slice(const struct branch_set *s, size_t first,
                               size_t n);
/* Every float of s to zero. */
void branch_clear(struct branch_set *s);

/* ---- sigmoids with a shift --------------------------------------------- */

/* y = sigmoid(logit(x) + s) for x in [0,1]: a sigmoid's output as if s had
 * been added before it. */
float attribute_shift(float x, float s);
/* dL/dx of it, given dL/dy. */
float attribute_shift_backward(float dy, float x, float s);
/* logit(x), x limited to [0.02, 0.98]; its derivative, 0 at the limits. */
float attribute_logit(float x);
/* dL/dx of it, given dL/dy; 0 where x was limited. */
float attribute_logit_backward(float dy, float x);

/* ---- the prior --------------------------------------------------------- */

/* Per Gaussian of a branch: what the decoder gave, and what is added to its
 * logits.  The final opacity is visible sigmoid(logit + opacity_shift). */
struct branch_prior {
    float *opacity;         /* (n) as the decoder gave it */
    float *scale;           /* (n,3) as the decoder gave it */
    float *opacity_shift;   /* (n) */
    float *scale_shift;     /* (n) */
    float *scale_max;       /* (n) */
    float *visible;         /* (n) factor of the opacity */
};

/* Where a decoder writes: colour and rotation into out, opacity and scale
 * into the prior, position (the branch's own) as given. */
struct gaussian_out branch_decoder_out(const struct branch_set *out,
                                       const struct branch_prior *p,
                                       float *position);
/* All of a set, where no prior counts, or its gradients. */
struct gaussian_out branch_attributes(const struct branch_set *s,
                                      float *position);

/* out's opacity and scale from the decoder's; used: the prior counts
 * (rgb_skip), otherwise they are copied. */
void branch_prior_forward(struct branch_set *out, const struct branch_prior *p,
                          bool used);
/* Undo it: dout's opacity and scale become gradients of the decoder's, in
 * place; dvisible (n) is written. */
void branch_prior_backward(struct branch_set *dout, float *dvisible,
                           const struct branch_prior *p, bool used);

/* ---- steps and colours ------------------------------------------------- */

/* Smooth step from 0 at lo to 1 at hi. */
float branch_ramp(float x, float lo, float hi);
/* rgb (3): mean of rgba (n,4), by weight (n), over what is as bright as `min`
 * and more; 0 where nothing is.  Returns the sum of those weights. */
float branch_mean_color(float rgb[3], const float *rgba, const float *weight,
                        size_t n, float min);
/* How much a colour (3) is like another in hue and not much darker, 0..1. */
float branch_likeness(const float rgb[3], const float like[3]);

/* ---- initial weights --------------------------------------------------- */

/* The named tensor times factor; nothing when there is no such tensor. */
void branch_scale_tensor(struct params *ps, const char *name, float factor);
/* Numbers first .. first + n - 1 of the named tensor to value. */
void branch_set_bias(struct params *ps, const char *name, size_t first,
                     size_t n, float value);
/* The bias by which scales start at what covers `spacing` (head units), or 0
 * when the prior sees to it. */
float branch_scale_bias(float spacing, bool prior);

#endif
