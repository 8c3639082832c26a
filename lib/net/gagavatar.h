/* GAGAvatar (Chu and Harada 2024), which SpiD builds on: one Gaussian per
 * vertex of the head and two planes of them lifted from the source picture's
 * features, refined by a StyleUNet.  Weights have the names of the public
 * checkpoint; sizes come from a configuration with "system": "gagavatar".
 *
 *   gagavatar_init, params_allocate, params_load, gagavatar_plan
 *   per source:  gagavatar_bake; g->set holds vertices, then the plane lifted
 *                away from the source camera, then the one towards it
 *   per frame:   only the vertices' centres move: they are the driven mesh
 *
 * The refiner ("upsampler.") is declared beside it by gagavatar_init_refiner,
 * since programs run it elsewhere (lib/animate). */
#ifndef SPID_NET_GAGAVATAR_H
#define SPID_NET_GAGAVATAR_H

#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/gaussians.h"
#include "lib/net/config.h"
#include "lib/net/backbone.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/mlp_decoder.h"
#include "lib/net/refiner.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"

struct gagavatar {
    struct avatar_config config;
    struct params *ps;
    size_t V;                       /* vertices */
    size_t base;                    /* tensor head_base (V,vertex_width) */
    struct backbone backbone;       /* base_model. */
    struct mlp_decoder vertex;      /* gs_generator_g. */
    struct conv_decoder plane[2];   /* gs_generator_l0., l1. */

    /* Of the last bake. */
    struct nn_plan plan;
    float *features;                /* (n,n,feature) */
    float *token;                   /* (embed) of the whole picture */
    float *rows;                    /* (V,vertex_width + embed) */
    float *points;                  /* (n*n,3) before lifting */
    float *position[2];             /* (n*n) how far they are lifted */
    float axis[3];                  /* optical axis of the source camera */
    struct gaussians set;           /* all Gaussians, in the arrays below */
    float *mean, *scale, *quat, *opacity, *color;
    uint8_t *branch;                /* (N) 0: vertices, 1: planes */
};

/* Declare all tensors but the refiner's, for a head of V vertices (FLAME:
 * 5023).  ps is borrowed. */
int gagavatar_init(struct gagavatar *g, struct params *ps,
                   const struct avatar_config *config, size_t V,
                   struct error *err);
/* Declare the refiner's, under the checkpoint's names. */
int gagavatar_init_refiner(struct refiner *r, struct params *ps,
                           const struct avatar_config *config,
                           struct error *err);
/* After params_allocate; inference only. */
int gagavatar_plan(struct gagavatar *g, enum nn_type type, struct error *err);
/* Free what it holds; zeroed then. */
void gagavatar_release(struct gagavatar *g);

/* Fill g->set from the source picture rgb (S,S,3) in [0,1] and its camera;
 * the vertices' centres are those of verts (V,3).  Rotations are the
 * checkpoint's: with public_quirks, those of vertices have no unit length
 * (SPLAT_DGR draws them as they are). */
void gagavatar_bake(struct gagavatar *g, const float *rgb,
                    const float cam[12], const float *verts);

/* Scales and unit quaternions that draw the same under every renderer's
 * rules, for a quaternion of any length taken as it is: axes of the covariance
 * R(q) diag(s)^2 R(q)^T.  In place, n Gaussians; unit quaternions stay. */
void gagavatar_unit_rotations(float *scale, float *quat, size_t n);

/* ---- the dual-lifting planes, for gagavatar_bake and the tests ------------ *
 * One plane of points through the head's origin, facing the source camera,
 * lifted once away from it and once towards it (Section 3.2). */

/* points (n*n,3), row by row, and the optical axis d (3), which points away
 * from the camera, of the source camera cam (3,4).  Samples span the picture
 * with both ends: the first lies on its border, not half a cell inside.  A
 * point is o + |o.d| R^T (x/f, y/f, 1): on the plane through the origin,
 * square to d. */
void gagavatar_plane(float *points, float d[3], const float cam[12],
                     size_t n);

/* xyz (N,3) = points + sign * position * d: along the axis, not the ray.
 * sign +1 lifts away from the camera, -1 towards it. */
void gagavatar_lift(float *xyz, const float *points, const float *position,
                    const float d[3], float sign, size_t N);

#endif
