/* Inside lib/avatar: the three branches' equations as functions of plain
 * arrays, each with its backward, and what a bake keeps for training.
 * Backward functions add to their outputs unless they say "written". */
#ifndef SPID_AVATAR_BRANCHES_H
#define SPID_AVATAR_BRANCHES_H

#include <stddef.h>

#include "lib/avatar/avatar.h"

/* ---- starting values of attributes (rgb_skip) -------------------------- */

#define BRANCH_SCALE_MAX 0.05f  /* the decoders' largest, head units */

/* y = sigmoid(logit(x) + s) for x in [0,1]: a sigmoid's output as if s had
 * been added before it. */
float attribute_shift(float x, float s);
/* dL/dx of it, given dL/dy. */
float attribute_shift_backward(float dy, float x, float s);
/* logit(x), x limited to [0.02, 0.98]; its derivative, 0 at the limits. */
float attribute_logit(float x);
float attribute_logit_backward(float dy, float x);

/* ---- Static Branch ----------------------------------------------------- */

/* U_0 (n,n,2): centres of the cells in [-1,1], x then y. */
void static_grid(float *U0, size_t n);

/* Centres mu (N,3): cell k's ray from the camera o_s meets the plane through
 * the head's origin facing the camera, mu = o_s + d_s r_k; then the signed
 * depth offset mu += (2 p - 1) n_s.
 *   U (N,2) in, p (N) in, normal (3) = n_s
 *   surface (N) in or NULL: height of the mesh over the plane.  The ray is
 *     then met at that height and the point lowered by it, so that an offset
 *     2 p - 1 equal to it lies on the ray again. */
void static_lift(float *mu, const float *U, const float *p,
                 const float *surface, const float cam[12],
                 const float normal[3], size_t N);
void static_lift_backward(float *dU, float *dp, const float *dmu,
                          const float *surface, const float cam[12],
                          const float normal[3], size_t N);

/* n_s: unit vector from the plane to the camera, head frame. */
void static_normal(float normal[3], const float cam[12]);

/* ---- Dynamic Branch ---------------------------------------------------- */

/* p_k (N,2) in [-1,1]: projection of x (N,3) onto the source picture. */
void dynamic_project(float *ndc, const float *x, size_t N,
                     const float cam[12]);

/* rgb (N,3) of hidden points from their neighbours on the mesh: a point keeps
 * its colour as far as weight (N) in [0,1] says, the rest spreads from the
 * shown ones, ring by ring, then is smoothed.  level holds V ints, tmp 7 V
 * floats. */
void dynamic_spread(float *rgb, const float *weight, const struct densify *d,
                    int *level, float *tmp);

/* ---- Mouth Interior Branch --------------------------------------------- */

/* uv (K,K,2) canonical coordinates, v up, row 0 on top; and
 * g (K,K,3) = l_s + r_lip [u, v, 0]. */
void mouth_sheet(float *g, float *uv, const float centre[3], float radius,
                 size_t K);
/* cap = d_bowl + d_lip / 2 + epsilon. */
float mouth_cap(const struct head_mouth *m);
/* Clamp the depth part of q (N,3) to [-cap, cap]; returns how many changed. */
size_t mouth_clamp(float *q, size_t N, float cap);
/* Zero the depth gradient where the clamp acted: raw (N,3) before it. */
void mouth_clamp_backward(float *dq, const float *raw, size_t N, float cap);
/* With rgb_skip, what the decoder gave for q (N,3) becomes an offset: within
 * half the sheet's radius to the sides, between 0 and cap behind the lips.
 * Adam's first steps would carry a plain offset centimetres away, where no
 * gradient reaches it. */
void mouth_hold(float *q, size_t N, float radius, float cap);
/* dq times the derivative at raw (N,3), what the decoder gave. */
void mouth_hold_backward(float *dq, const float *raw, size_t N, float radius,
                         float cap);

/* ---- a bake ------------------------------------------------------------ */

struct avatar_scratch {
    struct nn_options opt;
    int train;
    size_t S, n, K, Cf, V, D, M;    /* D = V + E, M = K*K */
    size_t n2;                      /* n*n */
    float cam[12], frame_cam[12];   /* the source's camera, the frame's */
    float *block;                   /* everything below */
    float *rgb;                     /* (S,S,3) over black, for the backbone */
    float *rgba;                    /* (S,S,4) as it is, and the matte */
    uint8_t *bled;                  /* (S,S) */
    float *features, *dfeatures;    /* (n,n,Cf) */
    float *coverage;                /* (n,n) */
    float *zbuffer;                 /* (n,n) camera depth of the mesh */
    float *cover, *held;            /* (n,n) what the plane leaves to the
                                     * mesh, and may not draw */
    float *bent;                    /* (V,3) source vertices, bent */
    float *bend;                    /* (N) weights of the bending */
    float *driven, *ddriven;        /* (D,3) a frame's, before bending */
    float *raster;                  /* coverage_scratch(n) */
    /* static */
    float *init_in, *dinit_in;      /* (n,n,Cf+1) */
    float *delta;                   /* (n,n,2) Delta U */
    float *U, *dU;                  /* (n,n,2) */
    float *sample, *dsample;        /* (n,n,4) picture at U */
    float *dmatte;                  /* (n,n) */
    float *static_in, *dstatic_in;  /* (n,n,static_width) */
    float *resampled;               /* (n,n,Cf), forward and gradient */
    float *static_logit, *dstatic_logit;    /* (n,n,3) */
    float *surface;                 /* (n,n) height of the mesh */
    float *p, *dp;                  /* (n,n) after the shift */
    /* dynamic */
    float *dense;                   /* (D,3) densified source vertices */
    float *ndc;                     /* (D,2) */
    float *normals;                 /* (V,3) */
    float *dense_normals;           /* (D,3) */
    float *seen, *spacing;          /* (D) */
    float *dsampled;                /* (D,Cf) d_k, and its gradient */
    float *dpicture;                /* (D,4) */
    float *h;                       /* (D,vertex) h_k, and its gradient */
    float *dynamic_in, *ddynamic_in;        /* (D,in) */
    float *dynamic_logit;           /* (D,3) */
    float *weight;                  /* (D) trust in the sampled colour */
    float *tmp;                     /* (V,7) */
    int *level;                     /* (V) */
    /* mouth */
    float *sheet;                   /* (M,3) g */
    float *uv;                      /* (M,2) */
    float *mouth_ndc;               /* (M,2) */
    float *mouth_sample;            /* (M,Cf), and its gradient */
    float *mouth_picture;           /* (M,4) */
    float *mouth_in, *dmouth_in;    /* (M,in) */
    float *mouth_logit;             /* (M,3) */
    float *q;                       /* (M,3) as the decoder gave it */
    float *dq;                      /* (M,3) */
    /* Gaussians: arrays of a->set, what the decoders gave before the shifts,
     * the shifts, and gradients */
    float *mean, *scale, *quat, *opacity, *color;
    float *opacity_raw, *scale_raw, *p_raw;
    float *opacity_shift, *scale_shift, *p_shift;
    float *matte;                   /* (N) opacity is multiplied by it */
    float *dmean, *dscale, *dquat, *dopacity, *dcolor;
    float *frame_dmean;             /* (N,3) of one frame */
    uint8_t *branch;                /* (N) */
};

/* Fill a->bend, neck, moving and lining from the head. */
int mesh_weights(struct avatar *a, struct error *err);

/* Shoulders that nothing is known of stand upright before the camera. */
extern const float avatar_upright[9];

/* Numbers per row the decoders take. */
size_t static_inputs(const struct avatar_config *c);
size_t dynamic_inputs(const struct avatar_config *c);
size_t mouth_inputs(const struct avatar_config *c);

/* Forward: from features and geometry to the branch's part of the set.
 * Backward: from the set's gradients to ps->g and dfeatures. */
void static_bake(struct avatar *a);
void static_bake_backward(struct avatar *a);
void dynamic_bake(struct avatar *a, const float *verts);
void dynamic_bake_backward(struct avatar *a);
void mouth_bake(struct avatar *a, const float *verts);
void mouth_bake_backward(struct avatar *a);

/* The branch's part of the set, or of its gradients, as a decoder's output;
 * opacity, scale and position before the shifts. */
struct gaussian_out branch_out(struct avatar *a, enum avatar_branch b);
struct gaussian_out branch_dout(struct avatar *a, enum avatar_branch b);
/* Apply shifts and matte to Gaussians i0..i1-1: raw -> set. */
void branch_shift(struct avatar *a, size_t i0, size_t i1);
/* Undo it: set gradients become raw gradients in place; dmatte (i1-i0) is
 * written unless NULL. */
void branch_shift_backward(struct avatar *a, float *dmatte, size_t i0,
                           size_t i1);

#endif
