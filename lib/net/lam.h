/* LAM (He et al. 2025, "Large Avatar Model for One-shot Animatable Gaussian
 * Head"): Gaussians on the vertices of a subdivided head, at rest.  Each is a
 * query, the sines of its place, that attends with all others to features of
 * four blocks of DINOv2; linear heads read colour, size, place, opacity and
 * rotation off it.  Skinning with blendshapes moves them, so that an avatar is
 * the head with an offset of each vertex.  Tensors have the names of the public
 * checkpoint; sizes come from a configuration with "system": "lam".
 *
 *   lam_init, params_allocate, params_load, lam_plan
 *   per source:  lam_bake; l->set holds all Gaussians but their centres, which
 *                are those of the head moved by l->offset */
#ifndef SPID_NET_LAM_H
#define SPID_NET_LAM_H

#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/gaussians.h"
#include "lib/net/config.h"
#include "lib/net/dinov2.h"
#include "lib/nn/attention.h"
#include "lib/nn/conv.h"
#include "lib/nn/norm.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"
#include "lib/nn/rescale.h"
#include "lib/nn/transformer.h"

enum { LAM_LEVELS = 4, LAM_DECODER = 3 };
/* What the heads say, in the order of the public code. */
enum lam_head { LAM_COLOR, LAM_SCALE, LAM_PLACE, LAM_OPACITY, LAM_ROTATION,
                LAM_HEADS };

struct lam {
    struct avatar_config config;
    struct params *ps;
    size_t N, M, D;             /* points, patches; numbers of a token */
    struct dinov2 vit;
    struct conv project[LAM_LEVELS], fuse, embed, condition, mlp[LAM_DECODER],
        head[LAM_HEADS];
    struct layer_norm embed_norm, norm;
    /* Of points and of the picture's features, with joint attention (Stable
     * Diffusion 3's block without time). */
    struct transformer (*block)[2];

    /* Of the last bake. */
    struct nn_plan plan;
    struct attention attention;
    struct rescale resize;
    float *picture;             /* (image,image,3) */
    float *features;            /* (M,feature) */
    float *x;                   /* (N + M,D) */
    float *normed, *wide;
    float *raw;                 /* (N,4) of a head */
    struct gaussians set;       /* all Gaussians */
    float *offset;              /* (N,3) from the points */
    float *mean;                /* (N,3) set.mean, the caller's to fill */
    float *scale, *quat, *opacity, *color;
    uint8_t *branch;            /* (N) 0 */
};

/* Declare all tensors.  ps is borrowed.  EX_CONFIG naming what does not go
 * together. */
int lam_init(struct lam *l, struct params *ps,
             const struct avatar_config *config, struct error *err);
/* After params_allocate, for N points; inference only. */
int lam_plan(struct lam *l, size_t N, enum nn_type type, struct error *err);
/* Free what it holds; zeroed then. */
void lam_release(struct lam *l);

/* Fill l->set and l->offset from the source picture rgb (S,S,3) in [0,1], the
 * person over white, and the vertices at rest, points (N,3); all lengths in
 * units of which a metre has so many. */
void lam_bake(struct lam *l, const float *rgb, const float *points,
              float metre);

#endif
