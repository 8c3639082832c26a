/* Workers on frames: one at a time reads and tracks, all pose, move, draw and
 * refine, and pictures are written by ticket, in order. */
#include "lib/animate/animate.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/camera.h"
#include "lib/head/motion.h"
#include "lib/splat/splat.h"
#include "lib/photo/place.h"

/* ---- workers ----------------------------------------------------------- */

/* With the Gaussians loaded. */
static int animate_worker_open_renderer(struct animate_worker *w, int channels,
                                        int threads, struct error *err)
{
    const struct animate *a = w->owner;
    struct splat_options opt = splat_defaults((int)a->opt.size,
                                              (int)a->opt.size, channels);
    struct gaussians g = baked_set(a->baked);

    opt.rules = a->opt.rules;
    opt.threads = threads;
    opt.place = a->opt.texture;
    opt.kept = true;
    opt.fixed16 = opt.fixed16 && !a->opt.f32;
    return splat_init(&w->splat, &opt, err) ||
           splat_load(&w->splat, &g, err) ? -1 : 0;
}

/* Eq. SR's input: as spid-splat writes it, so that the bytes are the same. */
static bool animate_worker_open_features(struct animate_worker *w)
{
    const struct animate *a = w->owner;
    size_t n = (a->opt.size * a->opt.size * a->baked->C + 31) / 32 * 32;

    if (a->baked->C > SPLAT_COLORS && !a->opt.f32)
        w->features_half = aligned_alloc(64, n * sizeof *w->features_half);
    else
        w->features = malloc(n * sizeof *w->features);
    return w->features_half || w->features;
}

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

/* Buffers, renderer and refiner of one worker. */
static int animate_worker_open(struct animate_worker *w, struct error *err)
{
    const struct animate *a = w->owner;
    size_t pixels = a->opt.size * a->opt.size;
    int channels = a->opt.star ? 3 : (int)a->baked->C;
    int threads = a->opt.workers > 1 ? 1 : 0;

    w->verts = malloc(3 * a->id->head->V * sizeof *w->verts);
    w->image = aligned_alloc(64, (3 * pixels * sizeof(float) + 63) / 64 * 64);
    w->alpha = malloc(pixels * sizeof *w->alpha);
    w->place = a->opt.texture ? malloc(PLACE_CHANNELS * pixels *
                                       sizeof *w->place) : NULL;
    w->photo = a->opt.texture && !a->opt.star
             ? malloc(TEXTURE_PHOTO * pixels * sizeof *w->photo) : NULL;
    if (!w->verts || !w->image || !w->alpha ||
        (a->opt.texture && (!w->place || (!a->opt.star && !w->photo))) ||
        (!a->opt.star && !animate_worker_open_features(w)))
        return error_set(err, EX_OSERR, "no memory for a picture of %zu "
                         "pixels", a->opt.size);
    if (baked_move_init(&w->move, a->baked, err))
        return -1;
    if (animate_worker_open_renderer(w, channels, threads, err))
        return -1;
    if (a->opt.picture > a->opt.size &&
        zoom_init(&w->zoom, a->opt.size, a->opt.picture, a->opt.texture, err))
        return -1;
    if (animate_worker_open_frame(w, err))
        return -1;
    if (a->opt.star)
        return 0;
    return refine_open(&w->refine, a->opt.model, a->opt.precision,
                       a->opt.roi, err);
}

int animate_init(struct animate *a, const struct animate_options *opt,
                 const struct identity *id, const struct baked *baked,
                 const struct densify *dense, struct error *err)
{
    memset(a, 0, sizeof *a);
    a->opt = *opt;
    a->id = id;
    a->baked = baked;
    a->dense = dense;
    if (a->opt.workers < 1)
        a->opt.workers = 1;
    pthread_mutex_init(&a->in, NULL);
    pthread_mutex_init(&a->out, NULL);
    pthread_cond_init(&a->turn, NULL);
    a->worker = calloc((size_t)a->opt.workers, sizeof *a->worker);
    if (!a->worker)
        return error_set(err, EX_OSERR, "no memory for %d workers",
                         a->opt.workers);
    for (int i = 0; i < a->opt.workers; i++) {
        a->worker[i].owner = a;
        if (animate_worker_open(&a->worker[i], err)) {
            animate_release(a);
            return -1;
        }
    }
    return 0;
}

void animate_release(struct animate *a)
{
    for (int i = 0; a->worker && i < a->opt.workers; i++) {
        struct animate_worker *w = &a->worker[i];

        splat_release(&w->splat);
        refine_release(&w->refine);
        zoom_release(&w->zoom);
        inset_scratch_release(&w->inset);
        free(w->whole);
        free(w->part_color);
        free(w->part_alpha);
        free(w->verts);
        baked_move_release(&w->move);
        free(w->image);
        free(w->alpha);
        free(w->place);
        free(w->photo);
        free(w->features);
        free(w->features_half);
    }
    if (a->worker) {
        pthread_mutex_destroy(&a->in);
        pthread_mutex_destroy(&a->out);
        pthread_cond_destroy(&a->turn);
    }
    free(a->worker);
    memset(a, 0, sizeof *a);
}

/* ---- a frame ----------------------------------------------------------- */

/* Eq. SR on what was drawn, and what the photograph shows of it. */
static int animate_worker_refine(struct animate_worker *w,
                                 const struct splat_place_view *view,
                                 struct error *err)
{
    const struct animate *a = w->owner;
    struct refine_input in = {
        .height = a->opt.size, .width = a->opt.size, .channels = a->baked->C,
        .f32 = w->features, .f16 = w->features_half, .alpha = w->alpha,
        .turn = w->move.relative_pose, .photo = w->photo
    };

    if (w->photo)
        texture_lookup(w->photo, a->opt.texture, view, w->place, w->alpha,
                       a->opt.size);
    if (refine_frame(w->image, &w->refine, &in, err))
        return -1;
    if (!w->zoom.to)
        return refine_photo(w->image, w->alpha, &w->refine, &in, err);
    texture_clamp_to_alpha(w->image, 3, w->alpha, a->opt.size * a->opt.size);
    return refine_field(&w->field, &w->refine, &in, err);
}

/* Eq. C: colours for SpiD*, features for the refiner; places, too, where
 * there is a photograph to look them up in. */
static int animate_worker_splat(struct animate_worker *w,
                                const struct splat_place_view *v,
                                const float cam[12], struct error *err)
{
    const struct animate *a = w->owner;
    const struct splat_camera c =
        splat_camera_square(cam, (int)a->opt.size, CAMERA_FOCAL);
    float *image = a->opt.star ? w->image : w->features;

    return splat_draw(&w->splat, &(struct splat_pictures){
        .image = image, .half = image ? NULL : w->features_half,
        .alpha = w->alpha, .place = w->place
    }, &c, v, NULL, err);
}

/* The photograph over what was drawn, at the picture's size. */
static void animate_worker_show(struct animate_worker *w,
                                const struct splat_place_view *v)
{
    const struct animate *a = w->owner;

    if (w->zoom.to)
        zoom_picture(&w->zoom, w->image, w->alpha, w->place, v,
                     a->opt.texture, &w->field);
    else if (a->opt.star && w->place)
        texture_apply(w->image, 3, w->alpha, a->opt.texture, v, w->place,
                      a->opt.size);
}

struct animate_picture animate_picture(const struct animate_worker *w)
{
    const struct zoom *z = &w->zoom;

    return z->to ? (struct animate_picture){z->to, z->color, z->alpha}
                 : (struct animate_picture){w->owner->opt.size, w->image,
                                            w->alpha};
}

int animate_draw(struct animate_worker *w, struct animate_times *t,
                 const struct motion *m, struct error *err)
{
    const struct animate *a = w->owner;
    const struct baked *b = a->baked;
    struct head_mouth mouth;
    struct splat_place_view view;
    float cam[12];
    double t0 = cpu_seconds();

    head_pose(w->verts, a->id, &m->pose);               /* V_d */
    motion_camera(cam, m);                              /* T_d */
    head_mouth(&mouth, a->id->head, w->verts);
    double t1 = cpu_seconds();
    baked_drive(&w->move, b, a->dense, w->verts, mouth.centre, mouth.chin,
                mouth.gap, a->opt.closed, cam);         /* mu_D, mu_M */
    double t2 = cpu_seconds();
    place_view_make(&view, b->view, cam);
    if (baked_move_scene(&w->splat, &w->move, b, err) ||
        animate_worker_splat(w, &view, cam, err))
        return -1;
    double t3 = cpu_seconds();
    if (!a->opt.star && animate_worker_refine(w, &view, err))
        return -1;
    animate_worker_show(w, &view);
    w->shoulders = inset_motion(b->pivot, w->move.frame.stay, b->view, cam);
    t->flame = t1 - t0;
    t->branches = t2 - t1;
    t->splat = t3 - t2;
    t->refine = a->opt.star ? 0 : cpu_seconds() - t3;
    return 0;
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

/* Take the next frame and track it: 1, or 0 when there is none.  *ticket is
 * its place in the order. */
static int animate_take(struct animate *a, struct driver_frame *f,
                        uint64_t *ticket, double *arrived)
{
    struct error err = {0};
    int rc = 0;

    pthread_mutex_lock(&a->in);
    if (!a->ended) {
        rc = driver_next(a->driver, f, &err);
        a->ended = rc <= 0;
        *ticket = a->next_in;
        a->next_in += rc == 1;
        *arrived = a->live ? live_arrived(a->live) : 0;
    }
    pthread_mutex_unlock(&a->in);
    if (rc < 0) {
        /* let the frames before it out first */
        pthread_mutex_lock(&a->out);
        while (a->next_out < *ticket && !a->failed)
            pthread_cond_wait(&a->turn, &a->out);
        pthread_mutex_unlock(&a->out);
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
    const struct animate_picture p = animate_picture(w);
    struct framesink_frame g = {
        .width = p.side, .height = p.side, .channels = 3, .color = p.color,
        .alpha = p.alpha, .frame = of->index, .time = of->time
    };

    if (opt->inset) {
        inset_draw(w->whole, opt->inset, &w->inset, p.color, p.alpha,
                   &w->shoulders);
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
    int rc = 0;

    pthread_mutex_lock(&a->out);
    while (a->next_out != ticket && !a->failed)
        pthread_cond_wait(&a->turn, &a->out);
    if (a->failed)
        rc = -1;
    double begun = cpu_seconds();
    if (rc == 0 && framesink_write(a->sink, &g, &err)) {
        a->err = err;
        a->failed = true;
        rc = -1;
    }
    t->encode = cpu_seconds() - begun;
    if (rc == 0 && a->done) {
        struct animate_frame r = {
            .index = f->picture.index, .time = f->picture.time,
            .track = &f->r, .color = animate_picture(w).color, .t = *t,
            .latency = a->live ? cpu_seconds() - arrived : 0
        };
        a->done(a->ctx, &r);
    }
    a->next_out++;
    pthread_cond_broadcast(&a->turn);
    pthread_mutex_unlock(&a->out);
    return rc;
}

/* A thread: frames until there are no more. */
static void *animate_worker_run(void *arg)
{
    struct animate_worker *w = arg;
    struct animate *a = w->owner;
    struct driver_frame f;
    uint64_t ticket;
    double arrived;

    if (a->opt.workers > 1)
        omp_set_num_threads(1);
    cpu_flush_denormals();
    while (!a->failed && animate_take(a, &f, &ticket, &arrived)) {
        struct animate_times t = {
            .decode = f.decode_s, .crop = f.r.crop_s,
            .network = f.r.network_s, .heads = f.r.heads_s
        };
        struct error err = {0};

        f.r.motion.pose.exp = f.r.motion.exp;
        if (animate_draw(w, &t, &f.r.motion, &err)) {
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
    int started = 0;

    a->driver = d;
    a->live = live;
    a->sink = sink;
    a->done = done;
    a->ctx = ctx;
    a->next_in = a->next_out = 0;
    a->ended = false;
    a->failed = false;
    if (a->opt.workers == 1)
        animate_worker_run(&a->worker[0]);
    while (a->opt.workers > 1 && started < a->opt.workers &&
           !pthread_create(&a->worker[started].thread, NULL,
                           animate_worker_run, &a->worker[started]))
        started++;
    for (int i = 0; i < started; i++)
        pthread_join(a->worker[i].thread, NULL);
    if (a->opt.workers > 1 && started == 0)
        return error_set(err, EX_OSERR, "cannot start a thread");
    if (a->failed) {
        *err = a->err;
        return -1;
    }
    return 0;
}
