/* Batches of frames made in parallel and handed out in order. */
#include "lib/lab/people/synth.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>


#include "lib/base/crop.h"
#include "lib/base/parallel.h"
#include "lib/lab/people/lens.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/scan_scene.h"
#include "lib/lab/people/stage.h"

/* A batch of frames is made in parallel, one frame a worker, and handed out
 * in order.  `slots` people are ready at a time. */
struct synth_scene {            /* a person and the background behind them */
    struct actor actor;
    float *wall;
    struct scan_scene scan;      /* in their place, with assets */
    uint64_t index;             /* of the person; UINT64_MAX: none */
};

struct synth_picture {          /* a finished frame */
    uint64_t number;            /* person * frames + frame */
    struct synth_motion motion;
    struct synth_scene *scene;
    float lmk[68][2], points[SYNTH_POINTS][2];
    float crop[3];
    float *verts;
    uint8_t *rgb, *mask, *label, *alone;
};

struct synth {
    struct synth_options opt;
    const struct head *head;
    size_t slots, batch, made, given;
    uint64_t next, total;
    struct synth_scene *scene;          /* (slots) */
    struct synth_picture *picture;          /* (batch) */
    size_t threads;
    struct stage *stage;        /* (threads) */
    struct scan_worker *worker;     /* (threads), with assets */
};

/* Room for a frame and what is to be known of it. */
static int synth_picture_init(struct synth_picture *t, const struct synth *s)
{
    size_t n = (size_t)s->opt.size * (size_t)s->opt.size;

    t->rgb = malloc(3 * n);
    t->mask = malloc(n);
    t->label = malloc(n);
    t->alone = s->opt.assets ? malloc(3 * n) : NULL;
    t->verts = s->opt.mesh ? malloc(3 * s->head->V * sizeof(float)) : NULL;
    return t->rgb && t->mask && t->label && (t->verts || !s->opt.mesh)
           && (t->alone || !s->opt.assets) ? 0 : -1;
}

struct synth *synth_open(const struct head *head,
                         const struct synth_options *opt, struct error *err)
{
    struct synth *s = calloc(1, sizeof *s);
    size_t n = (size_t)opt->size * (size_t)opt->size;

    if (!s)
        goto memory;
    s->opt = *opt;
    s->head = head;
    s->threads = (size_t)parallel_width();
    s->slots = s->threads * 2;
    s->batch = s->threads * 4;
    s->total = opt->people * opt->frames;
    s->scene = calloc(s->slots, sizeof *s->scene);
    s->picture = calloc(s->batch, sizeof *s->picture);
    s->stage = calloc(s->threads, sizeof *s->stage);
    s->worker = calloc(s->threads, sizeof *s->worker);
    if (!s->scene || !s->picture || !s->stage || !s->worker)
        goto memory;
    for (size_t i = 0; i < s->slots; i++)
        s->scene[i].index = UINT64_MAX;
    for (size_t i = 0; !opt->assets && i < s->slots; i++) {
        s->scene[i].wall = malloc(3 * n * sizeof(float));
        if (!s->scene[i].wall)
            goto memory;
    }
    for (size_t i = 0; i < s->batch; i++)
        if (synth_picture_init(&s->picture[i], s))
            goto memory;
    for (size_t i = 0; i < s->threads; i++)
        if (opt->assets ? scan_worker_init(&s->worker[i], head, opt->size, err)
                        : stage_init(&s->stage[i], opt->size, err))
            goto out;
    noise_lattice();
    lens_init();
    return s;
memory:
    error_set(err, EX_OSERR, "out of memory for pictures of %d pixels",
              opt->size);
out:
    synth_close(s);
    return NULL;
}

void synth_close(struct synth *s)
{
    if (!s)
        return;
    for (size_t i = 0; s->scene && i < s->slots; i++) {
        actor_release(&s->scene[i].actor);
        scan_scene_release(&s->scene[i].scan);
        free(s->scene[i].wall);
    }
    for (size_t i = 0; s->picture && i < s->batch; i++) {
        free(s->picture[i].rgb);
        free(s->picture[i].mask);
        free(s->picture[i].label);
        free(s->picture[i].alone);
        free(s->picture[i].verts);
    }
    for (size_t i = 0; s->stage && i < s->threads; i++)
        stage_release(&s->stage[i]);
    for (size_t i = 0; s->worker && i < s->threads; i++)
        scan_worker_release(&s->worker[i]);
    free(s->worker);
    free(s->scene);
    free(s->picture);
    free(s->stage);
    free(s);
}

/* Person `index` onto their slot. */
static int synth_scene_prepare(struct synth *s, uint64_t index,
                               struct error *err)
{
    struct synth_scene *c = &s->scene[index % s->slots];
    struct persona p;

    if (c->index == index)
        return 0;
    if (c->index != UINT64_MAX) {
        actor_release(&c->actor);
        scan_scene_release(&c->scan);
    }
    c->index = UINT64_MAX;
    if (s->opt.assets) {
        if (scan_scene_init(&c->scan, s->opt.assets, s->head, s->opt.seed,
                           s->opt.first + index, s->opt.effects, s->opt.size,
                           err))
            return -1;
        c->index = index;
        return 0;
    }
    persona_sample(&p, s->opt.seed, s->opt.first + index, s->head->nshape,
                   s->opt.effects);
    if (actor_init(&c->actor, s->head, &p, err))
        return -1;
    backdrop_paint(c->wall, &p, s->opt.size);
    c->index = index;
    return 0;
}

static void synth_picture_crop(struct synth_picture *t)
{
    struct square q = crop_from_landmarks(&t->lmk[0][0], 68);

    t->crop[0] = (float)q.x;
    t->crop[1] = (float)q.y;
    t->crop[2] = (float)q.size;
}

/* Where the head is to turn in a frame of a person; NULL: as it would. */
static const struct synth_turn *synth_turn(const struct synth *s,
                                           uint64_t frame)
{
    return s->opt.turns ? &s->opt.turn[frame % s->opt.turns] : NULL;
}

/* The same with assets. */
static int synth_picture_render_scan(struct synth *s, struct synth_picture *t,
                                     struct scan_worker *worker,
                                     struct error *err)
{
    uint64_t frame = t->number % s->opt.frames;
    struct scan_print out = { t->rgb, t->alone, t->mask, t->label };

    t->scene = &s->scene[t->number / s->opt.frames % s->slots];
    if (scan_scene_render(&out, &t->motion, t->lmk, t->points, worker,
                          &t->scene->scan, frame,
                          (double)frame / s->opt.fps, synth_turn(s, frame),
                          err))
        return -1;
    synth_picture_crop(t);
    if (t->verts)
        memcpy(t->verts, worker->verts, 3 * s->head->V * sizeof(float));
    return 0;
}

/* One frame of a sculpted person. */
static int synth_picture_render(struct synth *s, struct synth_picture *t,
                                struct stage *stage, struct error *err)
{
    uint64_t person = t->number / s->opt.frames;
    uint64_t frame = t->number % s->opt.frames;
    struct synth_scene *c = &s->scene[person % s->slots];
    const struct persona *p = &c->actor.look;
    struct synth_motion before;
    size_t n = (size_t)s->opt.size * (size_t)s->opt.size;
    double time = (double)frame / s->opt.fps;
    float f = 6 * (float)s->opt.size / 12;

    const struct synth_turn *turn = synth_turn(s, frame);

    synth_motion(&t->motion, p, time, s->head->nexp, turn);
    if (stage_render(stage, &c->actor, &t->motion, err))
        return -1;
    synth_motion(&before, p, time - (double)p->lens.shutter, s->head->nexp,
                 turn);
    float dx = t->motion.trans[0] - before.trans[0]
               + 0.45f * (t->motion.yaw - before.yaw);
    float dy = t->motion.trans[1] - before.trans[1]
               + 0.45f * (t->motion.pitch - before.pitch);
    lens_expose(stage, p, c->wall, frame, time, dx * f, dy * f);
    memcpy(t->lmk, stage->lmk, sizeof t->lmk);
    synth_picture_crop(t);
    t->scene = c;
    memcpy(t->rgb, stage->rgb, 3 * n);
    memcpy(t->mask, stage->mask, n);
    memcpy(t->label, stage->label, n);
    if (t->verts)
        memcpy(t->verts, stage->verts, 3 * s->head->V * sizeof(float));
    return 0;
}

/* One frame, with assets or of a sculpted person, by thread `me`. */
static int synth_picture_make(struct synth *s, struct synth_picture *t, int me,
                              struct error *err)
{
    return s->opt.assets
               ? synth_picture_render_scan(s, t, &s->worker[me], err)
               : synth_picture_render(s, t, &s->stage[me], err);
}

/* One of the batch's people. */
static int synth_make_scene(void *ctx, size_t i, struct error *err)
{
    struct synth *s = ctx;

    return synth_scene_prepare(s, s->next / s->opt.frames + i, err);
}

/* One of its frames. */
static int synth_make_picture(void *ctx, size_t i, struct error *err)
{
    struct synth *s = ctx;

    s->picture[i].number = s->next + i;
    return synth_picture_make(s, &s->picture[i], (int)parallel_slot(), err);
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
        .beta = s->opt.assets ? t->scene->scan.beta : t->scene->actor.look.beta,
        .nbeta = s->opt.assets ? s->head->nshape
                               : t->scene->actor.look.nbeta,
        .alone = t->alone,
        .motion = &t->motion, .lmk = &t->lmk[0][0], .verts = t->verts,
        .points = s->opt.assets ? &t->points[0][0] : NULL,
        .rgb = t->rgb, .mask = t->mask, .label = t->label
    };
    memcpy(frame->crop, t->crop, sizeof t->crop);
    return 1;
}
