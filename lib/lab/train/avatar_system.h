/* The avatar, its renderer and refiner as one thing that learns from
 * pictures: source -> Gaussians -> features -> picture -> loss, and back.
 *
 * With a refiner that is shown the photograph, places are blended, looked up
 * and composed as lib/animate does (lib/photo), and the light stays where it was,
 * for both pictures. */
#ifndef SPID_LAB_TRAIN_AVATAR_SYSTEM_H
#define SPID_LAB_TRAIN_AVATAR_SYSTEM_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/avatar/avatar.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/net/refiner.h"
#include "lib/splat/types.h"
#include "lib/lab/train/config.h"
#include "lib/lab/data/data.h"
#include "lib/photo/texture.h"
#include "lib/lab/train/alignment.h"
#include "lib/lab/train/perceptual.h"

/* L_img, L_perc and L_lmk, in the order of the log. */
enum picture_term {
    PICTURE_COARSE, PICTURE_COARSE_FACE, PICTURE_FINAL, PICTURE_FINAL_FACE,
    PICTURE_PERCEPTUAL, PICTURE_MASK, PICTURE_SQUARE, PICTURE_MOUTH,
    PICTURE_ALIGNMENT, PICTURE_COUNT
};
extern const char *const picture_term_name[PICTURE_COUNT];

struct avatar_system {
    const struct head *head;
    struct avatar_config config;
    struct avatar avatar;
    struct refiner refiner;         /* when config.has_refiner */
    struct splat splat;
    struct perceptual perceptual;   /* side 0: a pyramid stands in for it */
    struct alignment alignment;     /* side 0: none */
    struct texture texture;         /* of the source, when photo */
    struct splat_place_view view;   /* of the last frame, when photo */
    bool photo;                     /* the refiner is shown the photograph */
    bool fixed;                     /* only the refiner learns: the rest runs
                                     * as in use, and has no gradient */
    size_t image, channels;         /* side of the picture; C */
    float *feat, *dfeat;            /* (image,image,C) */
    float *alpha, *dalpha;          /* (image,image) as splatted */
    float *rgb, *drgb;              /* (image,image,3) the final picture */
    float *rgb_alpha, *drgb_alpha;  /* (image,image) of it */
    float *refined;                 /* (image,image,3) as the refiner has it,
                                     * before the photograph joins */
    float *coarse, *dcoarse;        /* (image,image,3) without the refiner */
    float *coarse_alpha;            /* (image,image) of it */
    float *place, *dplace;          /* (image,image,4), when photo */
    float *shown, *dshown;          /* (image,image,5) what the photograph
                                     * shows; zeros unless photo */
    float *gain;                    /* of the frame (lib/splat/relight.h), when */
    bool lit;                       /* it is known what light falls on it */
    float *dfield;                  /* (image/4,image/4,4) */
    float *target, *mask;           /* (image,image,3), (image,image) */
    float *means;                   /* (N,3) of a frame */
    float *verts, *dverts;          /* (V,3) driven */
    float *source, *rest;           /* (V,3) V_s, the same at rest */
    float *tmp;                     /* of loss_pyramid */
    float source_cam[12];           /* T_s */
    float dcam[12];                 /* gradient for the frame's [R|t] */
    float *block;                   /* what the arrays are part of */
};

/* Declare avatar and refiner in ps. */
int avatar_system_init(struct avatar_system *s, struct params *ps,
                       const struct avatar_config *config,
                       const struct head *h, struct error *err);
/* After params_allocate and params_randomise; fresh starts the biases, smooth
 * renders without cut-offs (see train_config).  s->fixed may be set before. */
int avatar_system_plan(struct avatar_system *s, size_t image, bool fresh,
                       bool smooth, struct nn_options opt, struct error *err);
/* L_perc by the network in this file from now on; after avatar_system_plan. */
int avatar_system_perceptual(struct avatar_system *s, const char *path,
                             struct error *err);
/* And L_lmk by the network in this one. */
int avatar_system_alignment(struct avatar_system *s, const char *path,
                            struct error *err);
/* Free what it holds; zeroed then. */
void avatar_system_release(struct avatar_system *s);

/* Phase A from a frame (which holds its whole picture, of config.size),
 * with motion m (NULL: its true one) of identity id. */
int avatar_system_bake(struct avatar_system *s, const struct data_frame *f,
                       const struct identity *id, const struct head_motion *m,
                       const float *cam, struct error *err);
/* Phase B: verts and cam to feat, alpha, coarse and rgb. */
int avatar_system_draw(struct avatar_system *s, const float *verts,
                       const float cam[12], struct error *err);
/* Losses of what was drawn against frame f: terms (PICTURE_COUNT) are added;
 * the gradients wait in dcoarse, drgb, dalpha, times scale. */
int avatar_system_losses(struct avatar_system *s, double *terms,
                         const struct data_frame *f,
                         const struct train_config *c, double scale,
                         struct error *err);
/* Back to the Gaussians (kept for avatar_system_bake_backward), to dverts and
 * to dcam, which are overwritten; with fixed, to the refiner's weights
 * alone. */
int avatar_system_draw_backward(struct avatar_system *s, struct error *err);
/* From the kept gradients of the Gaussians back through the branches to their
 * weights; with fixed nothing is done. */
void avatar_system_bake_backward(struct avatar_system *s);

#endif
