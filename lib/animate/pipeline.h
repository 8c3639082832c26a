/* Phase B of one frame: drive -> draw -> compose -> refine, from a motion to
 * the finished picture of a baked avatar.  Whoever draws avatars calls this:
 * spid animate and live (lib/animate/animate.h), the pictures of photographs
 * that act (lib/lab/fit), evaluation (lib/lab/eval).  The piped programs take
 * the same steps on records: spid-flame head_pose, spid-branches baked_drive,
 * spid-splat canvas_draw, spid-refine refine_picture. */
#ifndef SPID_ANIMATE_PIPELINE_H
#define SPID_ANIMATE_PIPELINE_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/animate/canvas.h"
#include "lib/animate/refine.h"
#include "lib/animate/refine_picture.h"
#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"
#include "lib/photo/texture.h"
#include "lib/splat/types.h"

struct pipeline_options {
    size_t size;                /* of what is drawn and refined, pixels */
    size_t picture;             /* of the picture, at least size: colours are
                                 * enlarged to it, the photograph looked up
                                 * in it; 0: as size */
    const struct model *model;  /* open, for the refiner; NULL with star */
    struct refine *refine;      /* one that pipelines share; NULL: its own */
    bool star;                  /* SpiD*: three channels, no refiner */
    enum splat_rules rules;     /* the renderer's */
    unsigned branches;          /* bit b: branch b is drawn; 0: all */
    bool roi;                   /* refine only where the head is */
    bool exact;                 /* no cut-offs, for measuring */
    bool f32;                   /* features drawn and kept in float, not in
                                 * half precision */
    enum nn_type precision;     /* of the refiner */
    int threads;                /* of the renderer (types.h); 0: all */
};

/* Who is drawn; all borrowed until another is set. */
struct pipeline_avatar {
    const struct identity *id;          /* with its head */
    const struct baked *baked;
    const struct densify *dense;
    const struct texture *texture;      /* the photograph; NULL: baked colours
                                         * alone */
};

struct pipeline {
    struct pipeline_options opt;
    struct pipeline_avatar avatar;
    struct splat splat;
    struct refine own;          /* unless opt.refine */
    float cam[12];              /* of the last frame */
    float *verts;               /* (V,3) */
    struct baked_move move;
    struct canvas canvas;       /* drawn; the picture itself with star */
    struct refine_picture refined;      /* the picture without */
};

/* Processor seconds of a frame's stages. */
struct pipeline_times {
    double flame, branches, splat, refine;
};

/* Memory, renderer and, unless star, the model's refiner, for that avatar.
 * EX_OSERR; EX_CONFIG when the model has no refiner.  On an error *p is to be
 * released all the same. */
int pipeline_init(struct pipeline *p, const struct pipeline_options *opt,
                  const struct pipeline_avatar *avatar, struct error *err);
/* Free what it holds; zeroed then. */
void pipeline_release(struct pipeline *p);

/* The refiner that these options ask for, to be shared. */
int pipeline_open_refiner(struct refine *r, const struct pipeline_options *opt,
                          struct error *err);

/* A frame of the avatar with motion m. */
int pipeline_draw(struct pipeline *p, const struct motion *m,
                  struct error *err);
/* Its steps, of which t says how long they take, unless NULL: what is drawn (Eq. C);
 * refined (Eq. SR), which pipelines that share a refiner do in the order of the
 * frames, one at a time; and finished. */
int pipeline_splat(struct pipeline *p, struct pipeline_times *t,
                   const struct motion *m, struct error *err);
int pipeline_refine(struct pipeline *p, struct pipeline_times *t,
                    struct error *err);
int pipeline_finish(struct pipeline *p, struct pipeline_times *t,
                    struct error *err);

/* The finished picture: side P in pixels, color (P,P,3) premultiplied and
 * alpha (P,P). */
struct pipeline_picture {
    size_t side;
    const float *color, *alpha;
};
/* That of the last frame, valid until the next one. */
struct pipeline_picture pipeline_picture(const struct pipeline *p);

#endif
