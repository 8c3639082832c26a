/* The avatar: three branches of Gaussians, baked once from a source picture
 * (Phase A) and moved per frame by the driven mesh (Phase B); forward, and
 * backward for training.
 *
 *   avatar_init, params_allocate, params_randomise or params_load,
 *   [avatar_start,] avatar_plan
 *   per source:   avatar_bake; avatar_gaussians is what a renderer draws
 *   per frame:    avatar_drive gives the centres that moved
 *   training:     after a frame's splat_backward into avatar_gradients,
 *                 avatar_drive_backward; after the source's last frame,
 *                 avatar_bake_backward adds to the weights' gradients
 *
 * One struct avatar holds one baked person.  Order of the Gaussians: dynamic
 * (V + E), static (n x n, row by row), mouth (K x K).
 *
 * Configuration rgb_skip: a Gaussian starts from what the source picture
 * says, and its decoder learns the difference.  RGB logits start at the
 * logit of the source pixel at its place; opacity logits are lowered where
 * the mesh covers the plane and where the matte is empty, scales start at the
 * spacing of the grid or of the mesh, static depths at the mesh's surface; the
 * decoders are told visibility, coverage and matte.  Vertices the source does
 * not show take colour from their neighbours on the mesh.  Where the mesh can
 * move against the skull the plane draws nothing: a second, still copy of the
 * lips would cover the first.  What the mesh has behind the lips is left to
 * the mouth's sheet, which cannot fade, shrink or leave the space there.
 *
 * Bending: the paper's camera turns shoulders with the head.  Here they stay
 * upright before the camera: driven vertices and static Gaussians below the
 * chin are bent at the neck (lib/geom/bend.h), the mesh from upright
 * shoulders, the plane from where it was in the source. */
#ifndef SPID_AVATAR_AVATAR_H
#define SPID_AVATAR_AVATAR_H

#include <stddef.h>
#include <stdint.h>

#include "lib/model/config.h"
#include "lib/avatar/densify.h"
#include "lib/base/error.h"
#include "lib/geom/bend.h"
#include "lib/geom/turn.h"
#include "lib/head/head.h"
#include "lib/net/backbone.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/mlp_decoder.h"
#include "lib/net/plane_init.h"
#include "lib/nn/params.h"
#include "lib/splat/splat.h"

enum avatar_branch {
    BRANCH_DYNAMIC, BRANCH_STATIC, BRANCH_MOUTH, BRANCH_COUNT
};

/* The paper's ablations, for avatar.without. */
enum avatar_without {
    WITHOUT_DYNAMIC = 1, WITHOUT_STATIC = 2, WITHOUT_MOUTH = 4,
    WITHOUT_INTERP = 8,     /* no midpoints: V dynamic Gaussians */
    WITHOUT_DEFORM = 16,    /* Delta U = 0: the uniform plane */
    WITHOUT_BEND = 32       /* shoulders turn with the head */
};
/* The bit for "dynamic", "static", "mouth", "interp", "deform" or "bend"; 0
 * for any other word. */
unsigned avatar_without_parse(const char *word);
/* The same for words with commas between, added to *bits; -1 and EX_USAGE
 * naming the one that is unknown. */
int avatar_without_list(unsigned *bits, const char *words,
                        struct error *err);

/* The three decoders' numbers beyond the paper's with rgb_skip. */
#define AVATAR_STATIC_EXTRA 4   /* coverage, matte, surface depth, surface? */
#define AVATAR_DYNAMIC_EXTRA 4  /* n.v, seen, coverage, matte */
#define AVATAR_MOUTH_EXTRA 2    /* inside the ring, opening */
#define AVATAR_OFFSET_EPS 0.01f /* epsilon of cap, head units: 2 mm */

/* A source: picture, matte, driven mesh and camera. */
struct avatar_source {
    const uint8_t *rgb;     /* (S,S,3), S = config.size */
    const uint8_t *matte;   /* (S,S) */
    const float *verts;     /* (V,3) V_s */
    const float *cam;       /* (3,4) T_s */
};

struct avatar_scratch;      /* what the backward needs of the forward */

struct avatar {
    struct avatar_config config;
    const struct head *head;
    struct params *ps;
    struct densify dense;
    struct backbone backbone;
    struct plane_init init;
    struct conv_decoder static_decoder, mouth_decoder;
    struct mlp_decoder dynamic_decoder;
    size_t head_base;       /* h_k: index in ps, (V, vertex_width) */
    float light[3];         /* l of the source; 0 without rgb_skip */
    struct bend bend;       /* of the mean head */
    float *neck;            /* (V+E) weights of it */
    float *moving;          /* (V) 1 where expressions, jaw, lids or gaze move
                             * the skin, 0 on the skull */
    float *lining;          /* (V+E) 1 inside the mouth, behind the lips */
    unsigned without;       /* enum avatar_without; set before avatar_bake */

    /* Set by avatar_bake. */
    size_t first[BRANCH_COUNT + 1];     /* branch b: first[b]..first[b+1] */
    struct gaussians set;               /* all of them, at the source pose */
    float normal[3];        /* n_s, towards the source camera */
    struct head_mouth mouth;            /* l_s, r_lip, d_bowl, d_lip */
    float cap;              /* d_bowl + d_lip / 2 + epsilon */
    size_t clamped;         /* mouth Gaussians whose depth the cap changed */

    struct avatar_scratch *scratch;
};

/* Declare all tensors of the branches ("backbone.", "init.", "static.",
 * "dynamic.", "mouth.") in ps.  EX_CONFIG when config names another head. */
int avatar_init(struct avatar *a, struct params *ps,
                const struct avatar_config *config, const struct head *head,
                struct error *err);
/* After params_randomise: last layers small, biases such that an untrained
 * model draws opaque Gaussians about as large as their spacing. */
void avatar_start(struct avatar *a);
int avatar_plan(struct avatar *a, struct nn_options opt, struct error *err);
void avatar_update(struct avatar *a);   /* after every optimiser step */
void avatar_release(struct avatar *a);

/* Phase A: fill a->set and the fields above it. */
void avatar_bake(struct avatar *a, const struct avatar_source *src);

/* Phase B: all centres (N,3) of a frame.  The dynamic ones are the densified
 * driven vertices, the mouth's move by l_d - l_s; both shoulders bend. */
void avatar_drive(float *means, struct avatar *a, const float *verts,
                  const float cam[12]);

/* True when closed lips hide the sheet: the driven opening is under `gap`
 * head units (0.004 is 0.8 mm). */
/* How the head seen by cam has turned since the source (turn_since), and back:
 * dcam (3,4) is added to. */
void avatar_turn(float turn[TURN_COUNT], const struct avatar *a,
                 const float cam[12]);
void avatar_turn_backward(float dcam[12], const float dturn[TURN_COUNT],
                          const struct avatar *a);
int avatar_mouth_hidden(const struct avatar *a, const float *verts,
                        float gap);

/* ---- training (planned with NN_TRAIN or NN_FROZEN) --------------------- */

/* Where a renderer adds its gradients: arrays as a->set, zeroed by
 * avatar_bake; mean is this frame's and zeroed by avatar_drive_backward. */
struct splat_gradients avatar_gradients(struct avatar *a);
/* dverts (V,3) and dcam (3,4) += gradient of the centres of the last
 * avatar_drive with respect to the driven vertices (also through the lip
 * centroid) and to the camera it bent for.  The static and mouth parts are
 * kept for the bake. */
void avatar_drive_backward(float *dverts, float dcam[12], struct avatar *a);
/* Adds to ps->g.  The source picture, mesh and camera are constants. */
void avatar_bake_backward(struct avatar *a);

#endif
