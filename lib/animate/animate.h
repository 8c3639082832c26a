/* The whole of Phase B in one process: frames in, pictures out.  Frames are
 * the unit of parallel work: tracking is one after the other, because a crop
 * comes from the frame before; posing, moving, drawing and refining run on as
 * many frames at once as there are workers, each on one core and without
 * barriers; pictures leave in order.  No more frames are in flight than there
 * are workers.  The same library calls as the piped programs make, so the
 * same bytes. */
#ifndef SPID_ANIMATE_ANIMATE_H
#define SPID_ANIMATE_ANIMATE_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/framesink.h"
#include "lib/animate/inset.h"
#include "lib/animate/live.h"
#include "lib/avatar/baked.h"
#include "lib/base/error.h"
#include "lib/head/lbs.h"
#include "lib/animate/refine.h"
#include "lib/splat/types.h"
#include "lib/photo/texture.h"
#include "lib/photo/zoom.h"
#include "lib/track/driver.h"

/* Part of a portrait, pixels. */
struct animate_part {
    size_t left, top, width, height;
};

struct animate_options {
    size_t size;                /* of what is drawn and refined, pixels */
    size_t picture;             /* of the picture, at least size: colours are
                                 * enlarged to it, the photograph looked up
                                 * in it; 0: as size */
    const struct model *model;  /* open, for the refiner; NULL with star */
    bool star;                  /* SpiD*: three channels, no refiner */
    enum splat_rules rules;     /* the renderer's */
    bool roi;                   /* refine only where the head is */
    bool f32;                   /* features drawn and kept in float, as by
                                 * spid-splat --f32, not in half precision */
    enum nn_type precision;     /* of the refiner */
    int workers;                /* frames in flight; at least 1 */
    float closed;               /* as in baked_drive */
    const struct texture *texture;      /* the photograph, borrowed; NULL:
                                         * baked colours alone */
    const struct inset *inset;          /* set the portrait into this
                                         * photograph; NULL: the portrait */
    const struct animate_part *part;    /* write only this; NULL: all of it */
};

/* Seconds a frame spent in each stage. */
struct animate_times {
    double decode, crop, network, heads, flame, branches, splat, refine,
           encode;
};

/* What became of one frame, reported in order. */
struct animate_frame {
    uint64_t index;
    double time;                /* of the clip */
    const struct track_result *track;
    const float *color;         /* (P,P,3) of the portrait, over black */
    struct animate_times t;
    double latency;             /* from its arrival, 0 unless live */
};

struct animate_worker {
    struct splat splat;
    struct refine refine;
    float *verts;               /* (V,3) */
    struct baked_move move;
    float *image;               /* (S,S,3) drawn, or refined */
    float *features;            /* (S,S,C) in float, */
    uint16_t *features_half;    /* or in half precision; neither for SpiD* */
    float *alpha;               /* (S,S) */
    float *place;               /* (S,S,3) blended places, with a texture */
    struct zoom zoom;           /* to the picture's size, when larger, and */
    struct texture_field field; /* ... what the refiner says of it */
    float *part_color, *part_alpha;     /* of opt.part */
    struct inset_scratch inset;
    struct inset_motion shoulders;      /* of the last animate_draw */
    uint8_t *whole;             /* the photograph with the portrait in it */
    float *photo;               /* (S,S,5) what it shows, for the refiner */
    pthread_t thread;
    struct animate *owner;
};

struct animate {
    struct animate_options opt;
    const struct identity *id;          /* borrowed, with its head */
    const struct baked *baked;
    const struct densify *dense;
    struct animate_worker *worker;

    /* a run */
    struct driver *driver;
    struct live *live;
    struct framesink *sink;
    void (*done)(void *ctx, const struct animate_frame *f);
    void *ctx;
    pthread_mutex_t in, out;
    pthread_cond_t turn;
    uint64_t next_in, next_out;
    bool ended;
    _Atomic bool failed;
    struct error err;
};

/* Prepare the workers: each loads the Gaussians and, unless star, the model's
 * refiner.  id, baked and dense are borrowed until animate_release. */
int animate_init(struct animate *a, const struct animate_options *opt,
                 const struct identity *id, const struct baked *baked,
                 const struct densify *dense, struct error *err);
/* Free what it holds; zeroed then. */
void animate_release(struct animate *a);

/* From the driver's frames (driver_start was called) to the sink, which stays
 * the caller's to finish.  live is NULL, or what the driver reads from.  done
 * (may be NULL) is called for every frame, in order, one call at a time.
 * -1 and *err: all frames before the fault have been written. */
int animate_run(struct animate *a, struct driver *d, struct live *live,
                struct framesink *sink,
                void (*done)(void *ctx, const struct animate_frame *f),
                void *ctx, struct error *err);

/* The finished picture of animate_draw: side P in pixels, color (P,P,3)
 * premultiplied and alpha (P,P). */
struct animate_picture {
    size_t side;
    const float *color, *alpha;
};
/* That of w's last frame, valid until the next one. */
struct animate_picture animate_picture(const struct animate_worker *w);

/* One frame of one worker, without reading and writing. */
int animate_draw(struct animate_worker *w, struct animate_times *t,
                 const struct motion *m, struct error *err);

#endif
