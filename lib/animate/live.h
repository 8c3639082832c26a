/* Frames as they come: a thread reads the source and keeps only the newest
 * frame, so that a slow consumer drops frames instead of falling behind.  A
 * source that ends may be waited for until it is back. */
#ifndef SPID_ANIMATE_LIVE_H
#define SPID_ANIMATE_LIVE_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/framesource.h"
#include "lib/base/error.h"

struct live_slot {
    uint8_t *rgb;
    size_t room;
    struct frame frame;
    double arrived;             /* cpu_seconds() when it was complete */
};

/* What to do when the source ends or fails. */
struct live_follow {
    struct framesource *(*open)(void *ctx, struct error *err);  /* again; NULL:
                                                                 * it ends */
    void (*away)(void *ctx, const struct error *why);   /* it is gone; called
                                                         * by the thread */
    void *ctx;
    bool paced;                 /* a frame comes when its time does, not when
                                 * it can be read: a file plays */
    double patience;            /* seconds without a frame, then it has ended */
    const _Atomic bool *stop;   /* set, also by a signal's handler: no more
                                 * frames */
};

struct live {
    struct framesource *source;         /* borrowed; owned when followed */
    struct live_follow follow;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct live_slot newest, current;
    bool fresh;                 /* newest has not been taken */
    bool started;
    _Atomic bool stop;
    int status;                 /* of framesource_read: 1 while it goes on */
    struct error err;
    size_t seen;
    _Atomic size_t dropped, restarts;   /* so far */
    double begun;               /* clock of the first frame */
    bool restart;               /* the next frame follows no other */
};

/* Start the thread on a source (borrowed) that ends when it ends, or whose
 * follow->open says how it comes back; then it is owned from here on, frames
 * count on, their times are the clock's, and the first one after a restart or of
 * another size has `restart` set.  Without a thread nothing is held, and
 * EX_OSERR. */
int live_start(struct live *l, struct framesource *source,
               const struct live_follow *follow, struct error *err);
/* The newest frame (driver_read_fn with the struct live as ctx): waits for
 * one; 0 at the end; valid until the next call. */
int live_read(void *live, struct frame *f, struct error *err);
/* When the frame of the last live_read arrived. */
double live_arrived(const struct live *l);
/* Ends the thread once its read returns, and frees the buffers; when it does
 * not return within a second and the source is followed, both stay until the
 * program ends. */
void live_stop(struct live *l);

#endif
