/* A reading thread with two slots: the newest frame, and the one its consumer
 * works on. */
#include "lib/animate/live.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <time.h>
#include <unistd.h>

#include "lib/base/cpu.h"

/* Copy a frame into a slot; -1 when memory is short. */
static int live_keep(struct live_slot *s, const struct frame *f)
{
    size_t bytes = 3 * f->width * f->height;

    if (bytes > s->room) {
        uint8_t *p = realloc(s->rgb, bytes);

        if (!p)
            return -1;
        s->rgb = p;
        s->room = bytes;
    }
    memcpy(s->rgb, f->rgb, bytes);
    s->frame = *f;
    s->frame.rgb = s->rgb;
    s->arrived = cpu_seconds();
    return 0;
}

/* Has the program been asked to end? */
static bool live_stop_requested(const struct live *l)
{
    return l->stop || (l->follow.stop && *l->follow.stop);
}

/* Number and time of a followed source's frame, and whether it belongs to the
 * one before. */
static void live_stamp(struct live *l, struct frame *f)
{
    const struct frame *before = &l->newest.frame;

    if (!l->follow.open)
        return;
    if (l->seen == 0)
        l->begun = cpu_seconds();
    else if (f->width != before->width || f->height != before->height)
        l->restart = true;
    f->index = l->seen;
    f->time = cpu_seconds() - l->begun;
    f->restart = l->restart;
}

/* The next frame of the source, which is opened again when it is followed: 1;
 * 0 at the end, -1. */
static int live_next(struct live *l, struct frame *f, struct error *err)
{
    double left = cpu_seconds();
    bool away = false;

    for (;;) {
        int rc = l->source ? framesource_read(l->source, f, err) : -1;

        if (rc == 1) {
            l->restarts += away;
            l->restart |= away;
            return 1;
        }
        if (!l->follow.open || live_stop_requested(l) ||
            cpu_seconds() - left > l->follow.patience)
            return rc;
        if (!away)
            l->follow.away(l->follow.ctx, rc < 0 ? err : NULL);
        else
            usleep(100000);
        away = true;
        framesource_close(l->source);
        *err = (struct error){0};
        l->source = l->follow.open(l->follow.ctx, err);
    }
}

/* Until a frame that was read is due. */
static void live_await_time(struct live *l, const struct frame *f)
{
    double left;

    if (!l->follow.paced)
        return;
    if (l->seen == 0)
        l->begun = cpu_seconds() - f->time;
    while ((left = l->begun + f->time - cpu_seconds()) > 0 &&
           !live_stop_requested(l))
        usleep((useconds_t)(1e6 * fmin(left, 0.1)) + 1);
}

/* Take over what the reader read; l->lock is held. */
static int live_deliver(struct live *l, struct frame *f, struct error *err)
{
    bool skipped = l->fresh;    /* a restart in a dropped frame still counts */

    live_stamp(l, f);
    f->restart |= skipped && l->newest.frame.restart;
    if (live_keep(&l->newest, f))
        return error_set(err, EX_OSERR, "no memory for a frame");
    l->restart = false;
    l->seen++;
    l->dropped += skipped;
    l->fresh = true;
    return 1;
}

/* The thread: reads until the end, a fault or live_stop. */
static void *live_reader(void *arg)
{
    struct live *l = arg;
    struct frame f;
    int rc = 1;

    while (rc == 1) {
        struct error err = {0};

        rc = live_next(l, &f, &err);
        if (rc == 1)
            live_await_time(l, &f);
        pthread_mutex_lock(&l->lock);
        if (rc == 1)
            rc = live_deliver(l, &f, &err);
        l->status = rc;
        if (rc < 0)
            l->err = err;
        if (live_stop_requested(l))
            rc = 0;
        pthread_cond_broadcast(&l->changed);
        pthread_mutex_unlock(&l->lock);
    }
    return NULL;
}

int live_start(struct live *l, struct framesource *source,
               const struct live_follow *follow, struct error *err)
{
    memset(l, 0, sizeof *l);
    l->source = source;
    l->follow = *follow;
    l->status = 1;
    pthread_mutex_init(&l->lock, NULL);
    pthread_cond_init(&l->changed, NULL);
    if (pthread_create(&l->thread, NULL, live_reader, l)) {
        pthread_mutex_destroy(&l->lock);
        pthread_cond_destroy(&l->changed);
        if (follow->open)       /* owned */
            framesource_close(source);
        return error_set(err, EX_OSERR, "cannot start the reading thread");
    }
    l->started = true;
    return 0;
}

/* A moment from now, as pthread functions want it. */
static struct timespec live_moment(long ms)
{
    struct timespec t;

    clock_gettime(CLOCK_REALTIME, &t);
    t.tv_nsec += ms % 1000 * 1000000;
    t.tv_sec += ms / 1000 + t.tv_nsec / 1000000000;
    t.tv_nsec %= 1000000000;
    return t;
}

int live_read(void *live, struct frame *f, struct error *err)
{
    struct live *l = live;
    int rc = 1;

    pthread_mutex_lock(&l->lock);
    while (!l->fresh && l->status == 1 && !live_stop_requested(l)) {
        struct timespec soon = live_moment(100);    /* a signal wakes nobody */

        pthread_cond_timedwait(&l->changed, &l->lock, &soon);
    }
    if (live_stop_requested(l)) {
        rc = 0;
    } else if (l->fresh) {
        struct live_slot t = l->current;

        l->current = l->newest;
        l->newest = t;
        l->newest.frame = l->current.frame;     /* to compare the next with */
        l->fresh = false;
        *f = l->current.frame;
    } else {
        rc = l->status;
        if (rc < 0 && err)
            *err = l->err;
    }
    pthread_mutex_unlock(&l->lock);
    return rc;
}

double live_arrived(const struct live *l)
{
    return l->current.arrived;
}

void live_stop(struct live *l)
{
    if (!l->started)
        return;
    struct timespec soon = live_moment(1000);

    pthread_mutex_lock(&l->lock);
    l->stop = true;
    pthread_mutex_unlock(&l->lock);
    if (!l->follow.open)
        pthread_join(l->thread, NULL);
    else if (pthread_timedjoin_np(l->thread, NULL, &soon))
        return;                 /* waits for a source: ends with the program */
    else
        framesource_close(l->source);
    free(l->newest.rgb);
    free(l->current.rgb);
    pthread_mutex_destroy(&l->lock);
    pthread_cond_destroy(&l->changed);
    memset(l, 0, sizeof *l);
}
