/* A thread that reads and checks the next record while the caller works on
 * this one: two slots, each the thread's or the caller's. */
#include "lib/stream/ahead.h"

#include <pthread.h>
#include <stdlib.h>
#include <sysexits.h>

/* What one stream_read gave. */
struct slot {
    struct record rec;
    struct error err;
    int rc;
    bool full;                 /* the caller's; else the thread's */
};

struct ahead {
    struct stream_reader *in;
    pthread_t thread;
    pthread_mutex_t lock;      /* of every slot's full */
    pthread_cond_t turn;
    struct slot slot[2];       /* in turn */
    int next;                  /* for the caller */
    bool held;                 /* he still uses the other one */
};

/* Until the slot is the caller's (full) or the thread's again. */
static void ahead_slot_wait(struct ahead *a, const struct slot *s, bool full)
{
    pthread_mutex_lock(&a->lock);
    while (s->full != full)
        pthread_cond_wait(&a->turn, &a->lock);
    pthread_mutex_unlock(&a->lock);
}

/* Hand the slot over. */
static void ahead_slot_set(struct ahead *a, struct slot *s, bool full)
{
    pthread_mutex_lock(&a->lock);
    s->full = full;
    pthread_cond_signal(&a->turn);
    pthread_mutex_unlock(&a->lock);
}

/* The thread: as far ahead as there are slots. */
static void *ahead_thread(void *arg)
{
    struct ahead *a = arg;
    int rc = 1;

    for (int k = 0; rc > 0; k = !k) {
        struct slot *s = &a->slot[k];

        ahead_slot_wait(a, s, false);
        rc = s->rc = stream_read(a->in, &s->rec, &s->err);
        ahead_slot_set(a, s, true);
    }
    return NULL;
}

struct ahead *ahead_open(struct stream_reader *in, struct error *err)
{
    struct ahead *a = calloc(1, sizeof *a);

    if (!a)
        return error_null(err, EX_OSERR, "out of memory");
    a->in = in;
    pthread_mutex_init(&a->lock, NULL);
    pthread_cond_init(&a->turn, NULL);
    if (pthread_create(&a->thread, NULL, ahead_thread, a)) {
        pthread_cond_destroy(&a->turn);
        pthread_mutex_destroy(&a->lock);
        free(a);
        return error_null(err, EX_OSERR, "cannot start a thread");
    }
    return a;
}

int ahead_read(struct ahead *a, const struct record **rec, struct error *err)
{
    struct slot *s = &a->slot[a->next];

    if (a->held)
        ahead_slot_set(a, &a->slot[!a->next], false);
    a->held = false;
    ahead_slot_wait(a, s, true);
    if (s->rc > 0) {
        a->held = true;
        a->next = !a->next;
    } else if (s->rc < 0) {
        *err = s->err;
    }
    *rec = &s->rec;
    return s->rc;
}

void ahead_close(struct ahead *a)
{
    pthread_join(a->thread, NULL);
    pthread_cond_destroy(&a->turn);
    pthread_mutex_destroy(&a->lock);
    free(a);
}
