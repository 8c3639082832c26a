/* A driving clip: frames in, one motion per frame out; or motions that a
 * stream or a take of Live Link Face has already, passed on as they are.  spid-motion and
 * spid animate both read their driver through this. */
#ifndef SPID_TRACK_DRIVER_H
#define SPID_TRACK_DRIVER_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/framesource.h"
#include "formats/livelink.h"
#include "lib/base/error.h"
#include "lib/stream/stream.h"
#include "lib/track/relative.h"
#include "lib/track/track.h"

#define DRIVER_PATIENCE 1000   /* frames looked through for a first face */

/* The next frame: 1, 0 at the end, -1 (framesource_read with its source as
 * ctx, or a live source's own). */
typedef int driver_read_fn(void *ctx, struct frame *f, struct error *err);

struct driver {
    struct track *track;        /* borrowed; CONF needs its window */
    driver_read_fn *read;
    void *ctx;
    struct stream_reader *records;      /* instead of frames, or */
    void (*pass)(void *ctx, const struct record *rec);  /* takes those records
                                 * that move nothing; NULL: nobody */
    struct livelink *take;              /* likewise; NULL */
    size_t nexp;                /* of their motions */
    uint64_t rows;              /* of the take, so far */
    struct frame first;         /* the frame with the first face; until then
                                 * the last that was looked at */
    struct track_result found;
    double *early;              /* times of the frames before it */
    int lying;                  /* quarter turns clockwise after which the
                                 * first of them would show one; 0: none */
    size_t early_count, early_next, early_room;
    bool first_given;
    bool live;                  /* set by the caller before driver_start: looks
                                 * for a face as long as there are frames, and
                                 * delivers none from before it */
    bool faceless;              /* live: the source has started again, and no
                                 * face was found in it yet */
    struct motion last;         /* live: for frames without a face */
    const struct light_net *light;      /* set likewise: the first motion says
                                 * the light on its face; NULL: it does not */
    bool relative;              /* motions are relative to the first */
    struct relative rest;
};

struct driver_frame {
    struct frame picture;       /* rgb is NULL for the frames before the first
                                 * face, which are delivered late */
    struct track_result r;
    double decode_s;
};

/* From frames: read with ctx gives them, t (borrowed) follows the face. */
void driver_init(struct driver *d, struct track *t, driver_read_fn *read,
                 void *ctx);
/* From the MOTN records of a stream (borrowed) for a head of nexp expression
 * directions: no tracker, no pictures. */
void driver_init_records(struct driver *d, struct stream_reader *records,
                         size_t nexp);
/* From a take (borrowed), likewise. */
void driver_init_take(struct driver *d, struct livelink *take, size_t nexp);
/* Free what it holds; zeroed then. */
void driver_release(struct driver *d);

/* Read on until a face is found, so that the window is known (CONF is written
 * before the first motion).  seen, when not NULL, is called for every frame
 * looked through in vain.  0; -1: *err names the input, `name` where the tracker
 * is what fails, and says what was tried when there is no face in the clip, in
 * its first DRIVER_PATIENCE frames or where it was said to be. */
int driver_start(struct driver *d, const char *name,
                 void (*seen)(void *, const struct frame *), void *seen_ctx,
                 struct error *err);

/* From now on motions are what the driver does relative to neutral (NULL: its
 * first frame with a face), added to source (relative_init).  Where
 * motions are the tracker's, neutral is calm (calm.h).  After
 * driver_start. */
void driver_set_relative(struct driver *d, const struct motion *source,
                         const struct motion *neutral, size_t nexp);

/* The next frame and its motion: 1; 0 at the end; -1 (all frames before the
 * fault have been delivered).  Frames before the first face come first, marked
 * lost, with the first motion. */
int driver_next(struct driver *d, struct driver_frame *f, struct error *err);

/* framesource_read with the signature of driver_read_fn. */
int driver_read_source(void *source, struct frame *f, struct error *err);

#endif
