/* Frames as they come: a thread reads the source and keeps only the newest
 * frame, so that a slow consumer drops frames instead of falling behind. */
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

struct live {
    struct framesource *source;         /* borrowed */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    struct live_slot newest, current;
    bool fresh;                 /* newest has not been taken */
    bool started, stop;
    int status;                 /* of framesource_read: 1 while it goes on */
    struct error err;
    size_t seen, dropped;
};

int live_start(struct live *l, struct framesource *source,
               struct error *err);
/* The newest frame (driver_read_fn with the struct live as ctx): waits for
 * one; 0 at the end; valid until the next call. */
int live_read(void *live, struct frame *f, struct error *err);
/* When the frame of the last live_read arrived. */
double live_arrived(const struct live *l);
/* Ends the thread once its read returns, and frees the buffers. */
void live_stop(struct live *l);

#endif
