/* Workers on frames: one at a time reads and tracks, all pose, move, draw and
 * refine, and pictures are written by ticket, in order. */
#include "lib/animate/animate.h"

#include <sched.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/base/processors.h"

/* ---- workers ----------------------------------------------------------- */

/* What the portrait is cut to, or set into. */
static int animate_worker_open_frame(struct animate_worker *w,
                                     struct error *err)
{
    const struct animate_part *part = w->owner->opt.part;
    const struct inset *inset = w->owner->opt.inset;

    if (inset) {
        w->whole = malloc(3 * inset->photo->width * inset->photo->height);
        if (!w->whole)
            return error_set(err, EX_OSERR, "no memory for the photograph");
        return inset_scratch_init(&w->inset, inset, err);
    }
    if (!part)
        return 0;
    const size_t n = part->width * part->height;
    w->part_color = malloc(3 * n * sizeof *w->part_color);
    w->part_alpha = malloc(n * sizeof *w->part_alpha);
    return w->part_color && w->part_alpha ? 0
        : error_set(err, EX_OSERR, "no memory for a picture");
}

/* Pipeline and buffers of one worker, unless it has them. */
static int animate_worker_open(struct animate_worker *w, struct error *err)
{
    struct pipeline_options opt = w->owner->opt.pipeline;

    if (w->open)
        return 0;
    opt.threads = w->owner->opt.workers > 1 ? 1 : 0;
    opt.refine = &w->owner->refine;
    w->open = true;
    return pipeline_init(&w->pipeline, &opt, &w->owner->avatar, err) ||
           animate_worker_open_frame(w, err) ? -1 : 0;
}

int animate_init(struct animate *a, const struct animate_options *opt,
                 const struct pipeline_avatar *avatar, struct error *err)
{
    memset(a, 0, sizeof *a);
    a->opt = *opt;
    a->avatar = *avatar;
    if (a->opt.workers < 1)
        a->opt.workers = 1;
    a->count = a->opt.workers + (a->opt.workers > 1);
    a->worker = calloc((size_t)a->count, sizeof *a->worker);
    if (!a->worker)
        return error_set(err, EX_OSERR, "no memory for %d workers", a->count);
    for (int i = 0; i < a->count; i++)
        a->worker[i].owner = a;
    pthread_mutex_init(&a->in, NULL);
    pthread_mutex_init(&a->out, NULL);
    pthread_cond_init(&a->turn, NULL);
    /* planned as they run: several each share no work */
    const bool before = parallel_alone(a->opt.workers > 1);
    const int rc = a->opt.pipeline.star
        ? 0 : pipeline_open_refiner(&a->refine, &a->opt.pipeline, err);
    parallel_alone(before);
    if (rc)
        animate_release(a);
    return rc;
}

void animate_release(struct animate *a)
{
    for (int i = 0; a->worker && i < a->count; i++) {
        struct animate_worker *w = &a->worker[i];

        pipeline_release(&w->pipeline);
        inset_scratch_release(&w->inset);
        free(w->whole);
        free(w->part_color);
        free(w->part_alpha);
    }
    if (a->worker) {
        pthread_mutex_destroy(&a->in);
        pthread_mutex_destroy(&a->out);
        pthread_cond_destroy(&a->turn);
    }
    free(a->worker);
    refine_release(&a->refine);
    memset(a, 0, sizeof *a);
}

/* ---- a clip ------------------------------------------------------------ */

/* The first fault wins; nothing more is read. */
static void animate_fail(struct animate *a, const struct error *err)
{
    pthread_mutex_lock(&a->out);
    if (!a->failed)
        a->err = *err;
    a->failed = true;
    pthread_cond_broadcast(&a->turn);
    pthread_mutex_unlock(&a->out);
}

/* Off the processors that others work on.  a->out is held. */
static void animate_hold(struct animate_worker *w)
{
    struct animate *a = w->owner;
    int taken[PARALLEL_MAX + 1];

    for (int i = 0; i < a->count; i++)
        taken[i] = &a->worker[i] == w ? -1 : a->worker[i].processor;
    processors_avoid(w->thread, taken, a->count);
}

/* The worker is on that processor, which is its own now; -1: it leaves that to the others.
 * a->out is held. */
static void animate_place(struct animate_worker *w, int processor)
{
    struct animate *a = w->owner;

    w->processor = processor;
    for (int i = 0; i < a->count; i++)
        if (a->worker[i].processor >= 0)
            animate_hold(&a->worker[i]);
}

/* The worker is one of those that work.  a->out is held. */
static void animate_work(struct animate_worker *w)
{
    animate_hold(w);
    animate_place(w, sched_getcpu());
    w->owner->working++;
}

/* It is none of them any more.  a->out is held. */
static void animate_rest(struct animate_worker *w)
{
    animate_place(w, -1);
    w->owner->working--;
    pthread_cond_broadcast(&w->owner->turn);
}

static void animate_stop(struct animate_worker *w)
{
    pthread_mutex_lock(&w->owner->out);
    animate_rest(w);
    pthread_mutex_unlock(&w->owner->out);
}

/* Wait until one more may work; false when a frame failed. */
static bool animate_begin(struct animate_worker *w)
{
    struct animate *a = w->owner;

    pthread_mutex_lock(&a->out);
    while (a->working >= a->opt.workers && !a->failed)
        pthread_cond_wait(&a->turn, &a->out);
    animate_work(w);
    pthread_mutex_unlock(&a->out);
    return !a->failed;
}

/* Wait until *next, a count of frames, has come to this one, while another may work;
 * false when one failed. */
static bool animate_wait(struct animate_worker *w, const uint64_t *next,
                         uint64_t ticket)
{
    struct animate *a = w->owner;

    pthread_mutex_lock(&a->out);
    if (*next != ticket) {
        animate_rest(w);
        while (*next != ticket && !a->failed)
            pthread_cond_wait(&a->turn, &a->out);
        animate_work(w);
    }
    if (next == &a->next_out) {
        /* threads that an encoder starts are not held */
        animate_place(w, -1);
        processors_avoid(w->thread, NULL, 0);
    }
    pthread_mutex_unlock(&a->out);
    return !a->failed;
}

/* The turn goes to the next frame. */
static void animate_pass_on(struct animate_worker *w, uint64_t *next)
{
    struct animate *a = w->owner;

    pthread_mutex_lock(&a->out);
    ++*next;
    if (next == &a->next_out)
        animate_rest(w);                    /* it is done */
    pthread_cond_broadcast(&a->turn);
    pthread_mutex_unlock(&a->out);
}

/* Whether others work, too: then each has its own, and else, as with a first frame
 * or a slow camera's, whoever is free helps. */
static bool animate_is_busy(struct animate *a)
{
    pthread_mutex_lock(&a->out);
    const bool busy = a->working > 1;
    pthread_mutex_unlock(&a->out);
    return busy;
}

/* Take the next frame and track it: 1, or 0 when there is none.  *ticket is
 * its place in the order. */
static int animate_take(struct animate_worker *w, struct driver_frame *f,
                        uint64_t *ticket, double *arrived)
{
    struct animate *a = w->owner;
    struct error err = {0};
    int rc = 0;

    pthread_mutex_lock(&a->in);
    if (!a->ended && (!a->opt.frames || a->next_in < a->opt.frames) &&
        animate_begin(w)) {
        /* one at a time, so with whoever is free: the longest of what frames
         * cannot do beside each other */
        parallel_alone(false);
        rc = driver_next(a->driver, f, &err);
        parallel_alone(animate_is_busy(a));
        a->ended = rc <= 0;
        if (rc == 0)
            animate_stop(w);
        *ticket = a->next_in;
        a->next_in += rc == 1;
        *arrived = a->live ? live_arrived(a->live) : 0;
    }
    pthread_mutex_unlock(&a->in);
    if (rc < 0) {
        /* let the frames before it out first */
        animate_wait(w, &a->next_out, *ticket);
        animate_fail(a, &err);
    }
    return rc == 1;
}

/* The part of the portrait that is written. */
static void animate_worker_cut(struct animate_worker *w,
                               struct framesink_frame *g,
                               const struct animate_part *part)
{
    for (size_t y = 0; y < part->height; y++) {
        const size_t from = (y + part->top) * g->width + part->left;
        const size_t to = y * part->width;

        memcpy(w->part_color + 3 * to, g->color + 3 * from,
               3 * part->width * sizeof *g->color);
        memcpy(w->part_alpha + to, g->alpha + from,
               part->width * sizeof *g->alpha);
    }
    g->color = w->part_color;
    g->alpha = w->part_alpha;
    g->width = part->width;
    g->height = part->height;
}

/* The frame as it is written: the portrait, part of it, or the photograph
 * with it. */
static struct framesink_frame animate_worker_frame(struct animate_worker *w,
                                                   const struct frame *of)
{
    const struct animate_options *opt = &w->owner->opt;
    const struct pipeline *l = &w->pipeline;
    const struct pipeline_picture p = pipeline_picture(l);
    struct framesink_frame g = {
        .width = p.side, .height = p.side, .channels = 3, .color = p.color,
        .alpha = p.alpha, .frame = of->index, .time = of->time
    };

    if (opt->inset) {
        const struct inset_motion shoulders =
            inset_motion(l->avatar.baked->pivot, l->move.frame.stay,
                         l->avatar.baked->view, l->cam);

        inset_draw(w->whole, opt->inset, &w->inset, p.color, p.alpha,
                   &shoulders);
        g.width = opt->inset->photo->width;
        g.height = opt->inset->photo->height;
        g.color = g.alpha = NULL;
        g.rgb = w->whole;
    } else if (opt->part) {
        animate_worker_cut(w, &g, opt->part);
    }
    return g;
}

/* Wait for the frame's turn and write it; -1 when it or an earlier one
 * failed. */
static int animate_deliver(struct animate_worker *w, struct driver_frame *f,
                           struct animate_times *t, uint64_t ticket,
                           double arrived)
{
    struct animate *a = w->owner;
    const struct framesink_frame g = animate_worker_frame(w, &f->picture);
    struct error err = {0};

    if (!animate_wait(w, &a->next_out, ticket))
        return -1;
    const double begun = cpu_seconds();
    if (framesink_write(a->sink, &g, &err)) {
        animate_fail(a, &err);
        return -1;
    }
    t->encode = cpu_seconds() - begun;
    if (a->done) {
        struct animate_frame r = {
            .index = f->picture.index, .time = f->picture.time,
            .track = &f->r, .color = pipeline_picture(&w->pipeline).color, .t = *t,
            .latency = a->live ? cpu_seconds() - arrived : 0
        };
        a->done(a->ctx, &r);
    }
    animate_pass_on(w, &a->next_out);
    return 0;
}

/* A frame, refined when those before it are; -1 also when one of them failed. */
static int animate_draw(struct animate_worker *w, struct pipeline_times *t,
                        const struct motion *m, uint64_t ticket,
                        struct error *err)
{
    struct animate *a = w->owner;

    if (pipeline_splat(&w->pipeline, t, m, err) ||
        !animate_wait(w, &a->next_refined, ticket) ||
        pipeline_refine(&w->pipeline, t, err))
        return -1;
    animate_pass_on(w, &a->next_refined);
    return pipeline_finish(&w->pipeline, t, err);
}

/* A thread: frames until there are no more. */
static void *animate_worker_run(void *arg)
{
    struct animate_worker *w = arg;
    struct animate *a = w->owner;
    struct driver_frame f;
    uint64_t ticket;
    double arrived;

    cpu_flush_denormals();
    w->thread = pthread_self();
    while (!a->failed && animate_take(w, &f, &ticket, &arrived)) {
        struct animate_times t = {
            .decode = f.decode_s, .crop = f.r.crop_s,
            .network = f.r.network_s, .heads = f.r.heads_s
        };
        struct error err = {0};

        f.r.motion.pose.exp = f.r.motion.exp;
        if (animate_worker_open(w, &err) ||
            animate_draw(w, &t.draw, &f.r.motion, ticket, &err)) {
            animate_fail(a, &err);
            break;
        }
        if (animate_deliver(w, &f, &t, ticket, arrived))
            break;
    }
    return NULL;
}

int animate_run(struct animate *a, struct driver *d, struct live *live,
                struct framesink *sink,
                void (*done)(void *ctx, const struct animate_frame *f),
                void *ctx, struct error *err)
{
    pthread_t thread[PARALLEL_MAX + 1];
    int started = 0;

    a->driver = d;
    a->live = live;
    a->sink = sink;
    a->done = done;
    a->ctx = ctx;
    a->next_in = a->next_refined = a->next_out = 0;
    a->working = 0;
    for (int i = 0; i < a->count; i++)
        a->worker[i].processor = -1;
    a->ended = false;
    a->failed = false;
    if (a->opt.workers == 1)
        animate_worker_run(&a->worker[0]);
    while (a->opt.workers > 1 && started < a->count &&
           !pthread_create(&thread[started], NULL, animate_worker_run,
                           &a->worker[started]))
        started++;
    for (int i = 0; i < started; i++)
        pthread_join(thread[i], NULL);
    if (a->opt.workers > 1 && started == 0)
        return error_set(err, EX_OSERR, "cannot start a thread");
    if (a->failed) {
        *err = a->err;
        return -1;
    }
    return 0;
}
