/* One source, driven by one clip or camera, into one output: the paper's
 * figure from end to end, with what is open while it lasts.  spid animate and
 * spid live are this and their option tables. */
#ifndef SPID_ANIMATE_ANIMATION_H
#define SPID_ANIMATE_ANIMATION_H

#include <stdbool.h>

#include "formats/framesink.h"
#include "formats/framesource.h"
#include "lib/animate/animate.h"
#include "lib/animate/framing.h"
#include "lib/animate/live.h"
#include "lib/animate/prepare.h"
#include "lib/animate/report.h"
#include "lib/avatar/target_light.h"
#include "lib/base/error.h"
#include "lib/track/neutral.h"
#include "lib/track/track.h"

/* What every clip of a run shares.  Zeroed but for what the user asked. */
struct animation_options {
    struct framesource_options source;
    struct track_options track;
    struct animate_options animate;
    struct framesink_options sink;      /* .path is the animation's */
    struct framing_options framing;
    struct background background;       /* what the user asked for */
    struct neutral neutral;
    struct target_light light;
    const char *head;           /* NULL: the one beside the model */
    const char *mask;           /* of the source, or NULL: found */
    bool no_sound;              /* the driver's is left out */
    bool relative;              /* a driver's motions are what it does since
                                 * it was neutral; those of a stream are
                                 * taken as they are */
};

struct animation {
    const struct animation_options *opt;        /* borrowed, with models */
    struct prepare *models;
    const char *driver_name, *output;   /* borrowed */
    struct prepared source;
    struct animate_options animate;     /* opt's, for this source */
    struct framing framing;
    struct background background;       /* opt's or the framing's, borrowed */
    struct framesource *frames;         /* or */
    struct stream_reader *records;      /* or */
    struct livelink *take;
    struct live live;
    struct track track;
    struct identity mean;       /* the driver's head: nobody's shape */
    struct driver driver;
    struct {
        bool done;              /* the clip has been read to it; if that */
        int rc;                 /* failed: */
        struct error err;
    } first_face;
    struct animate workers;
    struct framesink *sink;
    size_t total;               /* frames the driver announces; 0: unknown */
    bool silent;                /* the driver has sound, the output none */
    bool sound_lost;            /* it is of a clip that is not there */
    struct animate_report report;
};

/* Load model and head once, and what they decide of the options: sizes, the
 * renderer's rules, precision of the encoders.  workers: frames in flight. */
int animation_load(struct prepare *models, struct animation_options *opt,
                   const char *model, const char *head, int workers,
                   struct error *err);

/* Start an animation and open its output; a is zeroed before.  What follows
 * is called in this order; after any failure animation_close. */
int animation_open(struct animation *a, const struct animation_options *opt,
                   struct prepare *models, const char *out,
                   struct error *err);
/* Phase A of the source at path, and what its pictures will show.  driver: the
 * path that animation_open_driver will be given, whose first face is looked
 * for in the meantime; or NULL. */
int animation_open_source(struct animation *a, const char *path,
                          const char *driver, struct error *err);
/* The driver at path, frames, a stream of motions or a take of Live Link Face,
 * up to its first face.
 * The clip's rate becomes the output's. */
int animation_open_driver(struct animation *a, const char *path,
                          struct error *err);
/* In place of it: a camera, which follow->open opens now and again whenever it is
 * gone.  Standard input has only one end, and so have files, which play. */
int animation_open_camera(struct animation *a, const char *name,
                          const struct live_follow *follow,
                          struct error *err);
/* Phase B of all frames, and the output completed; done as in animate_run. */
int animation_run(struct animation *a,
                  void (*done)(void *ctx, const struct animate_frame *f),
                  void *ctx, struct error *err);
/* Free everything.  An output that animation_run has not completed is given
 * up.  A camera that does not answer keeps what it reads into until the
 * program ends, and so must a stay. */
void animation_close(struct animation *a);

#endif
