/* The Mouth Interior Branch (Section 3.2): a grid of K x K Gaussians behind
 * the lips that follows their centroid.
 *   g = l_s + r_lip [u, v, 0]
 *   [c, o, s, q_rot, q] = Phi_M([F at g, u, v], gamma(n_s))
 *   mu = g + q, q's depth within cap = d_bowl + d_lip / 2 + epsilon
 * With the prior (rgb_skip) the grid is rolled up into teeth and what is behind
 * them (teeth.h), the upper ones on the skull, the lower on the jaw; colours
 * start at the pixel between open lips and are the teeth's elsewhere. */
#ifndef SPID_AVATAR_MOUTH_BRANCH_H
#define SPID_AVATAR_MOUTH_BRANCH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/avatar/teeth.h"
#include "lib/net/config.h"
#include "lib/net/conv_decoder.h"

/* Numbers a cell the decoder gets beyond the paper's, with the prior: inside
 * the ring, opening. */
#define MOUTH_BRANCH_EXTRA 2
#define MOUTH_BRANCH_EPS 0.01f  /* epsilon of cap, head units: 2 mm */

struct mouth_branch {
    struct conv_decoder decoder;        /* Phi_M */
    size_t K, count;                    /* K, K*K */
    size_t n, feature, inputs;          /* maps n x n, C_f, of a cell */
    bool prior;                         /* rgb_skip */
    /* Set by the forward: */
    struct head_mouth lips;             /* l_s, r_lip, d_bowl, d_lip */
    float cap;                          /* head units */
    size_t clamped;                     /* Gaussians the cap changed */
    /* Kept by the forward; with d, of the backward only: */
    float *grid;                        /* (K,K,3) g */
    float *uv;                          /* (K,K,2) */
    float *place;                       /* (K,K,2) g in the picture, [-1,1] */
    float *sampled, *dsampled;          /* (K,K,Cf) F there; one memory */
    struct teeth_cell *teeth;           /* (K,K) with the prior, and */
    float *jaw;                         /* (K,K,3) how they go with the chin */
    float *visible;                     /* (K,K) how far the source shows them:
                                         * so far the photograph is drawn */
    float *reach;                       /* (K,K) within this (gaussian_seen) */
    float *likeness, *around;           /* (K,K) how far the picture's colour is
                                         * the teeth's; how far that around is
                                         */
    float *own;                         /* (K,K) share of the picture's colour,
                                         * not the template's */
    float *pixel;                       /* (K,K,4) the picture there */
    float *more;                        /* (K,K,4) what further pictures show
                                         * of the cells: the colour under white
                                         * light, and how far */
    float lift;                         /* how much shorter the upper crowns
                                         * are there (teeth.h), or 0 */
    float *in, *din;                    /* (K,K,inputs) */
    float *logit;                       /* (K,K,3) RGB to start from */
    float *q, *dq;                      /* (K,K,3) as the decoder gave it */
    float *block;                       /* what the arrays are part of */
};

/* Declare "mouth." in ps. */
void mouth_branch_init(struct mouth_branch *b, struct params *ps,
                       const struct avatar_config *c);
/* After params_randomise: see avatar_init_weights. */
void mouth_branch_init_weights(struct params *ps,
                               const struct avatar_config *c);
/* Buffers for the configured K x K sheet. */
int mouth_branch_plan(struct mouth_branch *b, struct nn_options opt,
                      struct error *err);
/* Free what it holds; zeroed then. */
void mouth_branch_release(struct mouth_branch *b);

/* Nothing is known of further pictures. */
void mouth_branch_begin(struct mouth_branch *b);
/* What a further picture shows between its open lips, teeth above all: cells that
 * the source does not show get their colours from the one that shows them best.
 * Arguments as of the forward. */
void mouth_branch_add(const struct source_picture *picture,
                      const struct source_mesh *mesh, const float white[3],
                      struct mouth_branch *b);

/* out: all K*K Gaussians (nothing but lips and cap when out->n is 0), from
 * features F (n,n,Cf), the picture and the mesh on it; white (3): what is white
 * in the picture.  They do not blend at the neck. */
void mouth_branch_forward(struct branch_set *out, const float *features,
                          const struct source_picture *picture,
                          const struct source_mesh *mesh,
                          const float white[3], struct mouth_branch *b);
/* dfeatures (n,n,Cf) and the weights' gradients are added to; dout's arrays
 * are used up.  The other arguments as in the forward. */
void mouth_branch_backward(float *dfeatures, struct branch_set *dout,
                           const float *features,
                           const struct source_mesh *mesh,
                           struct mouth_branch *b);

/* ---- the equations ----------------------------------------------------- */

/* uv (K,K,2) canonical coordinates, v up, row 0 on top; and
 * g (K,K,3) = l_s + r_lip [u, v, 0]. */
void mouth_branch_grid(float *g, float *uv, const float centre[3],
                       float radius, size_t K);
/* cap = d_bowl + d_lip / 2 + epsilon. */
float mouth_branch_cap(const struct head_mouth *m);
/* Clamp the depth part of q (N,3) to [-cap, cap]; returns how many changed. */
size_t mouth_branch_clamp(float *q, size_t N, float cap);
/* Zero the depth gradient where the clamp acted: raw (N,3) before it. */
void mouth_branch_clamp_backward(float *dq, const float *raw, size_t N,
                                 float cap);

#endif
