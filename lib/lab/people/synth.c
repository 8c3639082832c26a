/* Batches of frames made in parallel and handed out in order. */
#include "lib/lab/people/synth.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/base/parallel.h"
#include "lib/lab/people/noise.h"

/* A batch of frames is made in parallel, one frame a worker, and handed out
 * in order.  `slots` people are ready at a time. */
struct synth_scene {            /* a person and the background behind them */
    struct scan_scene scan;
    uint64_t index;             /* of the person; UINT64_MAX: none */
};

struct synth_picture {          /* a finished frame */
    uint64_t number;            /* person * frames + frame */
    struct motion motion;
    struct synth_scene *scene;
    float lmk[68][2], points[LANDMARK_FACE][2];
    float *verts;
    uint8_t *rgb, *mask, *label, *alone;
};

struct synth {
    struct arena memory;
    struct synth_options opt;
    struct scan_assets *plain;  /* of our own, when none are given */
    const struct head *head;
    size_t slots, batch, made, given;
    uint64_t next, total;
    struct synth_scene *scene;          /* (slots) */
    struct synth_picture *picture;          /* (batch) */
    size_t threads;
    struct scan_worker *worker;     /* (threads) */
};

/* Room for a frame and what is to be known of it. */
static void synth_picture_take(struct synth_picture *t, struct synth *s)
{
    size_t n = (size_t)s->opt.size * (size_t)s->opt.size;

    t->rgb = arena_take(&s->memory, n, 3);
    t->mask = arena_take(&s->memory, n, 1);
    t->label = arena_take(&s->memory, n, 1);
    t->alone = arena_take(&s->memory, n, 3);
    if (s->opt.mesh)
        t->verts = arena_take(&s->memory, 3 * s->head->V, sizeof *t->verts);
}

/* Everything but people, who come by themselves. */
static int synth_open_all(struct synth *s, struct error *err)
{
    const char *traits = s->opt.traits;
    struct arena *a = &s->memory;

    if (!s->opt.assets)
        s->opt.assets = s->plain = scan_plain_open(traits, s->head, err);
    if (!s->opt.assets)
        return -1;
    s->slots = s->threads * 2;
    s->batch = s->threads * 4;
    s->total = s->opt.people * s->opt.frames;
    s->scene = arena_take(a, s->slots, sizeof *s->scene);
    s->picture = arena_take(a, s->batch, sizeof *s->picture);
    s->worker = arena_take(a, s->threads, sizeof *s->worker);
    if (arena_check(a, "pictures", err))
        return -1;
    for (size_t i = 0; i < s->slots; i++)
        s->scene[i].index = UINT64_MAX;
    for (size_t i = 0; i < s->batch; i++)
        synth_picture_take(&s->picture[i], s);
    for (size_t i = 0; i < s->threads; i++)
        if (scan_worker_init(&s->worker[i], s->head, s->opt.size, err))
            return -1;
    noise_lattice_fill();
    return arena_check(a, "pictures", err);
}

struct synth *synth_open(const struct head *head,
                         const struct synth_options *opt, struct error *err)
{
    struct synth *s = calloc(1, sizeof *s);

    if (!s)
        return error_null(err, EX_OSERR, "out of memory");
    s->opt = *opt;
    s->head = head;
    s->threads = (size_t)parallel_width();
    if (synth_open_all(s, err) == 0)
        return s;
    synth_close(s);
    return NULL;
}

void synth_close(struct synth *s)
{
    if (!s)
        return;
    for (size_t i = 0; s->scene && i < s->slots; i++)
        scan_scene_release(&s->scene[i].scan);
    for (size_t i = 0; s->worker && i < s->threads; i++)
        scan_worker_release(&s->worker[i]);
    scan_close(s->plain);
    arena_release(&s->memory);
    free(s);
}

/* One of the batch's people onto their slot. */
static int synth_make_scene(void *synth, size_t i, struct error *err)
{
    struct synth *s = synth;
    const uint64_t index = s->next / s->opt.frames + i;
    struct synth_scene *c = &s->scene[index % s->slots];

    if (c->index == index)
        return 0;
    scan_scene_release(&c->scan);
    c->index = UINT64_MAX;
    if (scan_scene_init(&c->scan, s->opt.assets, s->head, s->opt.seed,
                        s->opt.first + index, s->opt.effects, s->opt.size,
                        err))
        return -1;
    c->index = index;
    return 0;
}

static void synth_picture_crop(struct synth_picture *t)
{
    struct square q = crop_from_landmarks(&t->lmk[0][0], 68);

    t->motion.crop[0] = (float)q.x;
    t->motion.crop[1] = (float)q.y;
    t->motion.crop[2] = (float)q.size;
}

/* Where the head is to turn in a frame of a person; NULL: as it would. */
static const struct synth_turn *synth_turn(const struct synth *s,
                                           uint64_t frame)
{
    return s->opt.turns ? &s->opt.turn[frame % s->opt.turns] : NULL;
}

/* One of the batch's frames, by a thread's worker. */
static int synth_make_picture(void *synth, size_t i, struct error *err)
{
    struct synth *s = synth;
    struct synth_picture *t = &s->picture[i];
    struct scan_worker *worker = &s->worker[parallel_slot()];
    const uint64_t frame = (s->next + i) % s->opt.frames;
    struct scan_print out = { t->rgb, t->alone, t->mask, t->label };

    t->number = s->next + i;
    t->scene = &s->scene[t->number / s->opt.frames % s->slots];
    if (scan_scene_render(&out, &t->motion, t->lmk, t->points, worker,
                          &t->scene->scan, frame,
                          (double)frame / s->opt.fps, synth_turn(s, frame),
                          err))
        return -1;
    synth_picture_crop(t);
    light_slope(t->motion.light, &t->scene->scan.figure.light);
    t->motion.lit = true;
    if (t->verts)
        memcpy(t->verts, worker->verts, 3 * s->head->V * sizeof(float));
    return 0;
}

/* Make the next batch: first its people, then its frames. */
static int synth_make_batch(struct synth *s, struct error *err)
{
    uint64_t left = s->total - s->next;
    uint64_t first = s->next / s->opt.frames, room;

    s->made = left < s->batch ? (size_t)left : s->batch;
    /* no more people than slots */
    room = (first + s->slots) * s->opt.frames - s->next;
    s->made = room < s->made ? (size_t)room : s->made;
    uint64_t last = (s->next + s->made - 1) / s->opt.frames;
    int rc = parallel_try(last - first + 1, synth_make_scene, s, err) ||
             parallel_try(s->made, synth_make_picture, s, err) ? -1 : 0;
    s->next += s->made;
    s->given = 0;
    if (rc)
        s->made = 0;
    return rc;
}

int synth_next(struct synth *s, struct synth_frame *frame, struct error *err)
{
    if (s->given == s->made) {
        if (s->next == s->total)
            return 0;
        if (synth_make_batch(s, err))
            return -1;
    }
    const struct synth_picture *t = &s->picture[s->given++];
    *frame = (struct synth_frame){
        .person = s->opt.first + t->number / s->opt.frames,
        .frame = t->number % s->opt.frames,
        .beta = t->scene->scan.beta, .nbeta = s->head->nshape,
        .alone = t->alone,
        .motion = &t->motion, .lmk = &t->lmk[0][0], .verts = t->verts,
        .points = s->opt.assets->plain ? NULL : &t->points[0][0],
        .rgb = t->rgb, .mask = t->mask, .label = t->label
    };
    return 1;
}
