/* The Dynamic Branch (Section 3.2): a Gaussian on every vertex of the head
 * mesh and on the middle of every edge, which the driven mesh carries along.
 *   d_k = F at p_k, p_k the projection of the densified source vertex
 *   [c, o, s, q] = Phi_D([h_k, d_k], gamma(n_s)),  mu_k the vertex itself
 * With the prior (rgb_skip) a Gaussian starts with the pixel at p_k, as far as
 * the source shows it; hidden ones get theirs from the side that is shown
 * (completion.h), and keep it.
 * What the mesh has behind the lips is left to the mouth's branch. */
#ifndef SPID_AVATAR_DYNAMIC_BRANCH_H
#define SPID_AVATAR_DYNAMIC_BRANCH_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/material.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/base/densify.h"
#include "lib/net/config.h"
#include "lib/net/mlp_decoder.h"

/* Numbers a Gaussian the decoder gets beyond the paper's, with the prior: n.v,
 * seen, coverage, matte. */
#define DYNAMIC_BRANCH_EXTRA 4

struct dynamic_branch {
    struct mlp_decoder decoder;         /* Phi_D */
    struct params *ps;
    size_t head_base;                   /* h_k: index in ps, (V,width) */
    const struct densify *dense;
    size_t count;                       /* D = V + E */
    size_t n, feature, width;           /* maps n x n, C_f, of h_k */
    size_t inputs;                      /* numbers a row the decoder gets */
    bool prior;                         /* rgb_skip */
    /* Kept by the forward; with d, of the backward only: */
    float *verts;                       /* (D,3) densified source vertices */
    float *place;                       /* (D,2) p_k in [-1,1] */
    float *normals;                     /* (D,3) */
    float *seen;                        /* (D) in [0,1]: not behind others */
    float *facing;                      /* (D) cosine between normal and way
                                         * to the camera */
    float *spacing;                     /* (D) to the neighbours */
    float *sampled, *dsampled;          /* (D,Cf) d_k; one memory */
    float *pixel;                       /* (D,4) source picture at p_k */
    float *h, *dh;                      /* (D,width) h_k; one memory */
    float *in, *din;                    /* (D,inputs) */
    float *logit;                       /* (D,3) RGB to start from */
    float *hull;                        /* (D) 1 where all of a Gaussian lies
                                         * on the person in the picture */
    const float *lid, *fold;            /* (D) upper lids, those but their
                                         * margin: the mesh's weights */
    float *seam;                        /* (D) where lips meet, and */
    float *on_teeth;                    /* (D) where they lie on what are teeth
                                         * in the picture */
    float light[3];                     /* l on the picture, head frame: set
                                         * before _forward */
    float *held;                        /* (D) trust in the picture there, */
    float *trust;                       /* (D) in its colour elsewhere, too, */
    float *as;                          /* (MATERIALS,D) and as each material's */
    float *chance;                      /* (MATERIALS,D) of each material */
    struct material_colors colors[MATERIALS];   /* the person's */
    float likelihood[HEAD_STYLES];      /* relief_likelihood; set by _relief */
    float *first;                       /* (D,4) colour and trust of the first
                                         * picture */
    float *more;                        /* (D,FURTHER_SUMS) of further ones
                                         * (further.h) */
    bool has_more;
    float shut[2];                      /* how far the source has its eyes
                                         * shut (eyes.h) */
    float white[3];                     /* what is white in the picture; with
                                         * the prior */
    float *tmp;                         /* COMPLETION_SCRATCH(D) */
    struct nn_plan rows;                /* for tmp, in, sampled, h */
    float *block;                       /* what the other arrays are part of */
};

/* Declare "dynamic." in ps.  h and d (of its faces) are borrowed. */
void dynamic_branch_init(struct dynamic_branch *b, struct params *ps,
                         const struct avatar_config *c, const struct head *h,
                         const struct densify *d);
/* After params_randomise: see avatar_init_weights. */
void dynamic_branch_init_weights(struct params *ps);
/* points: how many the decoder computes, V + E or V. */
int dynamic_branch_plan(struct dynamic_branch *b, size_t points,
                        struct nn_options opt, struct error *err);
/* Free what it holds; zeroed then. */
void dynamic_branch_release(struct dynamic_branch *b);

/* relief (V), head units along the normals: how far hidden hair stands off the head
 * by what the picture shows of the rest, and could hide; more: a further picture,
 * which leaves no more of it than it could hide (relief.h).  Before a forward. */
void dynamic_branch_relief(float *relief, bool more,
                           const struct source_picture *picture,
                           const struct source_mesh *mesh,
                           struct dynamic_branch *b);

/* Then, of the first picture: as far as it shows hair on the outline. */
void dynamic_branch_meet(float *relief, const struct source_picture *picture,
                         const struct source_mesh *mesh,
                         struct dynamic_branch *b);

/* Further pictures of the person, before a forward: begin with the first
 * picture and its mesh, then add each other with its own.  What they show of a
 * point adds up, each by how far it shows it, in the first picture's light:
 * without their own (l of each, head frame), times a gain of each channel by what
 * both show.  The next forward takes it
 * where its own picture shows less. */
void dynamic_branch_begin(const struct source_picture *picture,
                          const struct source_mesh *mesh,
                          struct dynamic_branch *b);
void dynamic_branch_add(const struct source_picture *picture,
                        const struct source_mesh *mesh, const float light[3],
                        struct dynamic_branch *b);

/* out: the first out->n Gaussians (0: none) and their neck weights, from
 * features F (n,n,Cf), the picture and the mesh on it.  The rows of out's
 * colour and rotation up to the planned points are written. */
void dynamic_branch_forward(struct branch_set *out, const float *features,
                            const struct source_picture *picture,
                            const struct source_mesh *mesh,
                            struct dynamic_branch *b);
/* dfeatures (n,n,Cf) and the weights' gradients are added to; dout's arrays
 * are used up.  The other arguments as in the forward. */
void dynamic_branch_backward(float *dfeatures, struct branch_set *dout,
                             const float *features,
                             const struct source_mesh *mesh,
                             struct dynamic_branch *b);

/* tilt (n,2) of the first n Gaussians, the slopes of the depth at their places:
 * less where the forward's photograph is trusted, so that it stays while the
 * surface turns (gaussian_visible); the mesh's own on the side of the head that
 * the photograph does not show.  neck (n) as tilt_sample has it. */
void dynamic_branch_tilt(float *tilt, const float *neck, size_t n,
                         const struct source_mesh *mesh,
                         const struct dynamic_branch *b);

/* reach (n) of gaussian_seen, head units, of the first n Gaussians.  It is not
 * 0 where the photograph shows what a movement changes: on lids (negative);
 * where the lips meet, in each other's shadow or beside teeth; and at the
 * corners of closed lips, which are creased and wet. */
void dynamic_branch_reach(float *reach, size_t n,
                          const struct source_mesh *mesh,
                          const struct dynamic_branch *b);

#endif
