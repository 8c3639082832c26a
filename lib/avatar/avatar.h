/* The avatar: three branches of Gaussians, baked once from a source picture
 * (Phase A) and moved per frame by the driven mesh (Phase B); forward, and
 * backward for training (Section 3.2).
 *
 *   avatar_init, params_allocate, params_randomise or params_load,
 *   [avatar_init_weights,] avatar_plan
 *   per source:   avatar_bake; a->set is what a renderer draws
 *   per frame:    avatar_drive gives the centres that moved
 *   training:     after a frame's splat_backward into avatar_gradients,
 *                 avatar_drive_backward; after the source's last frame,
 *                 avatar_bake_backward adds to the weights' gradients
 *
 * One struct avatar holds one baked person.  Order of the Gaussians: dynamic
 * (V + E), static (n x n, row by row), mouth (K x K).  Each branch is a module
 * of its own (dynamic_branch.h, static_branch.h, mouth_branch.h) that reads
 * the backbone's features, the source picture and the source mesh and writes
 * its part of the set; what moves in Phase B is lib/base/drive.h.
 *
 * Configuration rgb_skip: a Gaussian starts from what the source picture says
 * (the prior of branch.h), and its decoder learns the difference.
 *
 * Neck blend: the paper's camera turns shoulders with the head.  Here they
 * stay upright before the camera: driven vertices and static Gaussians below
 * the chin blend into the shoulders' motion (lib/base/neck_blend.h), the mesh
 * from upright shoulders, the plane from where it was in the source. */
#ifndef SPID_AVATAR_AVATAR_H
#define SPID_AVATAR_AVATAR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/dynamic_branch.h"
#include "lib/avatar/grain.h"
#include "lib/avatar/mouth_branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/avatar/static_branch.h"
#include "lib/avatar/tilt.h"
#include "lib/base/error.h"
#include "lib/base/densify.h"
#include "lib/base/drive.h"
#include "lib/base/relative_pose.h"
#include "lib/head/head.h"
#include "lib/net/config.h"
#include "lib/net/backbone.h"
#include "lib/nn/params.h"
#include "lib/nn/plan.h"
#include "lib/splat/types.h"

enum avatar_branch {
    BRANCH_DYNAMIC, BRANCH_STATIC, BRANCH_MOUTH, BRANCH_COUNT
};

/* A source: picture, matte, driven mesh and camera. */
struct avatar_source {
    const uint8_t *rgb;     /* (S,S,3), S = config.size */
    const uint8_t *matte;   /* (S,S) */
    const uint8_t *certain; /* (S,S) how certain it is, 0 beyond the photograph,
                             * or NULL: all is in it */
    const float *verts;     /* (V,3) V_s */
    const float *cam;       /* (3,4) T_s */
    const float *light;     /* (3) l on it, camera frame, or NULL: unknown */
    const float *rest;      /* (V,3) the same face at rest (identity_rest), or
                             * NULL: verts */
    const struct avatar_source *more;   /* (nmore) further pictures of the
                                         * person; with the prior */
    size_t nmore;
};

struct avatar {
    struct avatar_config config;
    const struct head *head;
    struct params *ps;
    struct densify dense;           /* of the head's faces */
    struct backbone backbone;
    struct dynamic_branch dynamic;
    struct static_branch plane;
    struct mouth_branch mouth;
    unsigned without;       /* enum avatar_without; the configuration's at
                             * first, set before avatar_plan, may change before
                             * any avatar_bake */
    size_t colors;          /* kept of each Gaussian, 0: all; set before
                             * avatar_plan, for inference only */
    bool train;             /* planned for a backward */

    /* Set by avatar_bake. */
    struct source_picture picture;
    const uint8_t *observed;            /* whose it is, from avatar_relief to
                                         * avatar_bake; else NULL */
    struct source_mesh source;
    struct tilt tilted;                 /* slopes of what the source shows */
    size_t first[BRANCH_COUNT + 1];     /* branch b: first[b]..first[b+1] */
    struct gaussians set;               /* all of them, at the source pose */
    struct drive drive;                 /* how they move */
    float light[3];                     /* l of the source, head frame; 0
                                         * without rgb_skip */
    float lamp[LAMP_SIZE];              /* the same as a lamp */
    float *features, *dfeatures;        /* (n,n,Cf) F */
    struct branch_set all, dall;        /* the set's arrays; gradients */
    uint8_t *branch;                    /* (N) */
    float *uv;                          /* (N,2) places in the source picture
                                         * (lib/photo/place.h) */
    float *reach;                       /* (N) gaussian_seen */
    float *tilt;                        /* (N,2) gaussian_visible */
    struct grain grain;                 /* none in training */
    float *normal;                      /* (N,3) of the surface, head frame; as
                                         * far as it turns with the head */

    /* Set by avatar_drive. */
    float *densified, *ddensified;      /* (D,3) before the neck blend */
    float *frame_dmean;                 /* (N,3) of one frame */
    float frame_cam[12];                /* (3,4) */
    float *block;                       /* what the arrays are part of */
    struct nn_pool pool;                /* maps of its networks */
};

/* Declare all tensors of the branches ("backbone.", "init.", "static.",
 * "dynamic.", "mouth.") in ps.  EX_CONFIG when config names another head.
 * ps and head are borrowed. */
int avatar_init(struct avatar *a, struct params *ps,
                const struct avatar_config *config, const struct head *head,
                struct error *err);
/* After params_randomise: last layers small, biases such that an untrained
 * model draws opaque Gaussians about as large as their spacing. */
void avatar_init_weights(struct avatar *a);
/* Buffers for one source picture at the configured sizes, for inference or for
 * training.  EX_OSERR; what was allocated waits for avatar_release. */
int avatar_plan(struct avatar *a, struct nn_options opt, struct error *err);
/* Free what _init and _plan allocated; zeroed then.  ps and head stay. */
void avatar_release(struct avatar *a);

/* offset (V,3): how far the mesh of src, at rest, is to stand off the head where hair
 * does, its neck to be drawn in (relief.h), and its closed lips to meet where the
 * picture's do (lip_lining.h); 0 without the prior.  Before avatar_bake of the same
 * pictures, which need not be read again. */
void avatar_relief(float *offset, struct avatar *a,
                   const struct avatar_source *src);

/* Phase A: fill a->set and what stands beside it. */
void avatar_bake(struct avatar *a, const struct avatar_source *src);

/* Phase B: all centres (N,3) of a frame whose mesh is verts (V,3), seen by
 * cam (3,4). */
void avatar_drive(float *means, struct avatar *a, const float *verts,
                  const float cam[12]);

/* How the head seen by cam has turned since the source
 * (lib/base/relative_pose.h), and back: dcam (3,4) is added to. */
void avatar_relative_pose(float pose[RELATIVE_POSE_SIZE],
                          const struct avatar *a, const float cam[12]);
/* dcam (3,4) += what dpose gives it. */
void avatar_relative_pose_backward(float dcam[12],
                                   const float dpose[RELATIVE_POSE_SIZE],
                                   const struct avatar *a);

/* ---- training (planned with NN_TRAIN or NN_FROZEN) --------------------- */

/* Where a renderer adds its gradients: arrays as a->set, zeroed by
 * avatar_bake; mean is this frame's and zeroed by avatar_drive_backward. */
struct splat_gradients avatar_gradients(struct avatar *a);
/* dverts (V,3) and dcam (3,4) += gradient of the centres of the last
 * avatar_drive with respect to the driven vertices (also through the lip
 * centroid) and to the camera its neck blend went by.  The static and mouth
 * parts are kept for the bake. */
void avatar_drive_backward(float *dverts, float dcam[12], struct avatar *a);
/* Adds to ps->g.  The source picture, mesh and camera are constants. */
void avatar_bake_backward(struct avatar *a);

#endif
