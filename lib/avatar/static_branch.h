/* The Static Branch (Section 3.2): a deformable plane of n x n Gaussians
 * through the head's origin, facing the source camera: hair, shoulders,
 * whatever the mesh has not.
 *   U = U_0 + Phi_init([F, C])         places of the cells in the picture
 *   [c, o, s, q, p] = Phi_S([F at U, U], gamma(n_s))
 *   mu = o_s + d_s r + (2 p - 1) n_s   where the ray meets the plane, lifted
 * With the prior (rgb_skip) the plane leaves to the mesh what the mesh covers,
 * starts at the mesh's surface elsewhere, and draws nothing where the mesh
 * moves against the skull, no rim so thin that the mesh's Gaussians reach
 * over it, and nothing from inside the person's outline to beyond it. */
#ifndef SPID_AVATAR_STATIC_BRANCH_H
#define SPID_AVATAR_STATIC_BRANCH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/material.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/net/config.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/plane_init.h"
#include "lib/nn/plan.h"

/* Numbers a cell the decoder gets beyond the paper's, with the prior:
 * coverage, matte, surface depth, whether there is a surface. */
#define STATIC_BRANCH_EXTRA 4

/* The mesh's height over the plane counts up to this, head units: offsets are
 * 2 p - 1 with p a sigmoid, so that 1 is never reached. */
#define STATIC_BRANCH_HEIGHT 0.9f

struct static_branch {
    struct plane_init init;             /* Phi_init; no width: Delta U = 0 */
    struct conv_decoder decoder;        /* Phi_S */
    size_t n, count, feature;           /* n, n*n, C_f */
    size_t inputs;                      /* numbers a cell the decoder gets */
    bool prior;                         /* rgb_skip */
    bool uniform;                       /* Delta U = 0 (an ablation); set
                                         * before the forward */
    struct branch_prior start;          /* (n*n) */
    /* Kept by the forward; with d, of the backward only: */
    float *init_in, *dinit_in;          /* (n,n,Cf+1) [F, C] */
    float *delta;                       /* (n,n,2) Delta U */
    float *U, *dU;                      /* (n,n,2) in [-1,1], x then y */
    float *pixel, *dpixel;              /* (n,n,4) source picture at U */
    float *dsampled;                    /* (n,n,Cf) of F at U */
    float *din;                         /* (n,n,inputs) */
    float *logit, *dlogit;              /* (n,n,3) RGB to start from */
    /* Of the cells, before they move: */
    float *height;                      /* (n,n) of the mesh over the plane,
                                         * head units */
    float *moving;                      /* (n,n) what may not be drawn */
    /* Where a Gaussian has moved to: */
    uint32_t *cell;                     /* (n,n) the cell there, */
    float *surface;                     /* (n,n) its height */
    float *p_raw, *p_shift;             /* (n,n) depth: decoder's, shift */
    float *p, *dp;                      /* (n,n) after the shift */
    float *dvisible;                    /* (n,n) */
    float *block;                       /* what the arrays are part of, but */
    struct nn_plan rows;                /* for init_in */
};

/* Declare "static." in ps, and "init." if it has a width. */
void static_branch_init(struct static_branch *b, struct params *ps,
                        const struct avatar_config *c);
/* After params_randomise: see avatar_init_weights. */
void static_branch_init_weights(struct params *ps,
                                const struct avatar_config *c);
/* Buffers for the configured n x n plane. */
int static_branch_plan(struct static_branch *b, struct nn_options opt,
                       struct error *err);
/* Free what it holds; zeroed then. */
void static_branch_release(struct static_branch *b);

/* out: all n*n Gaussians and their neck weights (nothing when out->n is 0),
 * from features F (n,n,Cf), the picture, the mesh on it and the person's colours
 * (MATERIALS; of nothing known: zeros). */
void static_branch_forward(struct branch_set *out, const float *features,
                           const struct source_picture *picture,
                           const struct source_mesh *mesh,
                           const struct material_colors *colors,
                           struct static_branch *b);
/* dfeatures (n,n,Cf) and the weights' gradients are added to; dout's arrays
 * are used up.  The other arguments as in the forward. */
void static_branch_backward(float *dfeatures, struct branch_set *dout,
                            const float *features,
                            const struct source_picture *picture,
                            const struct source_mesh *mesh,
                            struct static_branch *b);

/* ---- the equations ----------------------------------------------------- */

/* U_0 (n,n,2): centres of the cells in [-1,1], x then y. */
void static_branch_grid(float *U0, size_t n);

/* Centres mu (N,3): cell k's ray from the camera o_s meets the plane through
 * the head's origin facing the camera, mu = o_s + d_s r_k; then the signed
 * depth offset mu += (2 p - 1) n_s.
 *   U (N,2) in, p (N) in, normal (3) = n_s
 *   surface (N) in or NULL: height of the mesh over the plane.  The ray is
 *     then met at that height and the point lowered by it, so that an offset
 *     2 p - 1 equal to it lies on the ray again. */
void static_branch_lift(float *mu, const float *U, const float *p,
                        const float *surface, const float cam[12],
                        const float normal[3], size_t N);
/* dU and dp are added to. */
void static_branch_lift_backward(float *dU, float *dp, const float *dmu,
                                 const float *surface, const float cam[12],
                                 const float normal[3], size_t N);

#endif
