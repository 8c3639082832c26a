/* A reading thread with two slots: the newest frame, and the one its consumer
 * works on. */
#include "lib/animate/live.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

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

/* The thread: reads until the end, a fault or live_stop. */
static void *live_reader(void *arg)
{
    struct live *l = arg;
    struct frame f;
    int rc = 1;

    while (rc == 1) {
        struct error err = {0};

        rc = framesource_read(l->source, &f, &err);
        pthread_mutex_lock(&l->lock);
        if (rc == 1 && live_keep(&l->newest, &f))
            rc = error_set(&err, EX_OSERR, "no memory for a frame");
        if (rc == 1) {
            l->seen++;
            l->dropped += l->fresh;
            l->fresh = true;
        }
        l->status = rc;
        if (rc < 0)
            l->err = err;
        if (l->stop)
            rc = 0;
        pthread_cond_broadcast(&l->changed);
        pthread_mutex_unlock(&l->lock);
    }
    return NULL;
}

int live_start(struct live *l, struct framesource *source, struct error *err)
{
    memset(l, 0, sizeof *l);
    l->source = source;
    l->status = 1;
    pthread_mutex_init(&l->lock, NULL);
    pthread_cond_init(&l->changed, NULL);
    if (pthread_create(&l->thread, NULL, live_reader, l))
        return error_set(err, EX_OSERR, "cannot start the reading thread");
    l->started = true;
    return 0;
}

int live_read(void *live, struct frame *f, struct error *err)
{
    struct live *l = live;
    int rc = 1;

    pthread_mutex_lock(&l->lock);
    while (!l->fresh && l->status == 1)
        pthread_cond_wait(&l->changed, &l->lock);
    if (l->fresh) {
        struct live_slot t = l->current;

        l->current = l->newest;
        l->newest = t;
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
    pthread_mutex_lock(&l->lock);
    l->stop = true;
    pthread_mutex_unlock(&l->lock);
    pthread_join(l->thread, NULL);
    free(l->newest.rgb);
    free(l->current.rgb);
    pthread_mutex_destroy(&l->lock);
    pthread_cond_destroy(&l->changed);
    memset(l, 0, sizeof *l);
}
