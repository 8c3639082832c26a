/* The whole of Phase B in one process: frames in, pictures out.  Frames are
 * the unit of parallel work: tracking is one after the other, because a crop
 * comes from the frame before; posing, moving, drawing and refining run on as
 * many frames at once as there are workers, each on one core and without
 * barriers; pictures leave in order, and one that waits for its turn is in
 * nobody's way.  The same library calls as the piped programs make, so the same
 * bytes. */
#ifndef SPID_ANIMATE_ANIMATE_H
#define SPID_ANIMATE_ANIMATE_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/framesink.h"
#include "lib/animate/inset.h"
#include "lib/animate/live.h"
#include "lib/animate/pipeline.h"
#include "lib/base/error.h"
#include "lib/track/driver.h"

/* Part of a portrait, pixels. */
struct animate_part {
    size_t left, top, width, height;
};

struct animate_options {
    struct pipeline_options pipeline;   /* threads: set by animate_init */
    int workers;                /* frames worked on at once; at least 1 */
    uint64_t frames;            /* so many and no more; 0: all */
    const struct inset *inset;          /* set the portrait into this
                                         * photograph; NULL: the portrait */
    const struct animate_part *part;    /* write only this; NULL: all of it */
};

/* Seconds a frame spent in each stage. */
struct animate_times {
    double decode, crop, network, heads, encode;
    struct pipeline_times draw;
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
    bool open;                  /* has had a frame, and all below since */
    struct pipeline pipeline;
    float *part_color, *part_alpha;     /* of opt.part */
    struct inset_scratch inset;
    uint8_t *whole;             /* the photograph with the portrait in it */
    pthread_t thread;
    int processor;              /* its own while it works; or -1 */
    struct animate *owner;
};

struct animate {
    struct animate_options opt;
    struct pipeline_avatar avatar;
    struct animate_worker *worker;
    int count;                  /* of them: with several, one more than work at
                                 * once, for when a picture waits for its turn */
    struct refine refine;       /* all workers', unless star */

    /* a run */
    struct driver *driver;
    struct live *live;
    struct framesink *sink;
    void (*done)(void *ctx, const struct animate_frame *f);
    void *ctx;
    pthread_mutex_t in, out;
    pthread_cond_t turn;
    uint64_t next_in, next_refined, next_out;
    int working;                /* workers that do not wait */
    bool ended;
    _Atomic bool failed;
    struct error err;
};

/* Prepare the workers, each with a pipeline of its own for that avatar from its first
 * frame on. */
int animate_init(struct animate *a, const struct animate_options *opt,
                 const struct pipeline_avatar *avatar, struct error *err);
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

#endif
