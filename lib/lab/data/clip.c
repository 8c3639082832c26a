/* Frames spread over a clip, each made a source picture of (lib/track/source),
 * then written with one shape for all. */
#include "lib/lab/data/clip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesource.h"
#include "formats/image.h"
#include "lib/base/arena.h"
#include "lib/base/camera.h"
#include "lib/head/lbs.h"
#include "lib/head/person.h"
#include "lib/stream/records.h"
#include "lib/track/conf.h"
#include "lib/track/landmarks.h"
#include "lib/track/source.h"

/* What is known of a clip while it is read. */
struct clip_state {
    struct person *person;      /* (kept) */
    double *time;               /* (kept) */
    uint64_t *index;            /* (kept) */
    size_t room;
    struct arena memory;        /* of the three */
    struct square window;
    size_t width, height;
    int fps_num, fps_den;
    size_t good, outlined;      /* frames that were kept, also if not in the
                                 * end; with an outline */
    double face;                /* sum over the good */
};

static void clip_state_release(struct clip_state *s, size_t kept)
{
    for (size_t i = 0; i < kept; i++)
        person_release(&s->person[i]);
    arena_release(&s->memory);
}

/* Room for twice as many frames as are to be kept. */
static int clip_state_init(struct clip_state *s, size_t frames,
                           struct error *err)
{
    const size_t room = 2 * frames;

    *s = (struct clip_state){.room = room};
    s->person = arena_take(&s->memory, room, sizeof *s->person);
    s->time = arena_take(&s->memory, room, sizeof *s->time);
    s->index = arena_take(&s->memory, room, sizeof *s->index);
    return arena_check(&s->memory, "a clip's frames", err);
}

/* A person's picture at the records' size, not at the clip's own. */
static int clip_resize(struct person *p, size_t size, struct error *err)
{
    struct person small = {0}, own = {.rgb = p->rgb, .matte = p->matte,
                                      .back = p->back, .confidence = p->confidence,
                                      .size = p->size};

    if (p->size == size)
        return 0;
    if (person_resize(&small, p, size, err))
        return -1;
    p->rgb = small.rgb;
    p->matte = small.matte;
    p->back = small.back;
    p->confidence = small.confidence;
    p->size = small.size;
    person_release(&own);
    return 0;
}

/* A frame's picture, face and matte; a frame without a good face is passed
 * over.  -1 only when memory is short. */
static int clip_add_frame(struct clip_state *s, struct clip_report *r,
                          const struct clip *c, const struct frame *f,
                          struct error *err)
{
    struct image im;
    struct track_options opt = c->opt.track;
    struct source src;
    struct error why = {0};

    r->tried++;
    if (r->kept) {
        opt.has_window = true;
        opt.window = s->window;
    }
    if (frame_copy(&im, f, err))
        return -1;
    int rc = source_make(&src, &im, c->head, c->nets, &opt, &why);
    image_release(&im);
    if (rc) {
        if (why.code != EX_OSERR)
            return 0;
        *err = why;
        return -1;
    }
    const double face = src.person.source.crop[2] * src.window.size /
                        c->opt.track.size;
    if (face < c->opt.min_face) {
        source_release(&src);
        return 0;
    }
    s->window = src.window;
    s->width = f->width;
    s->height = f->height;
    s->good++;
    s->outlined += src.notes.how != SOURCE_HEAD;
    s->face += face;
    s->time[r->kept] = f->time;
    s->index[r->kept] = f->index;
    s->person[r->kept] = source_move_person(&src);
    source_release(&src);
    return clip_resize(&s->person[r->kept++], (size_t)c->opt.track.size, err);
}

/* Of the frames that are kept n stay, spread over them. */
static void clip_thin(struct clip_state *s, struct clip_report *r, size_t n)
{
    const size_t had = r->kept;

    r->kept = 0;
    for (size_t i = 0; i < had; i++) {
        if (i && i * n / had == (i - 1) * n / had) {
            person_release(&s->person[i]);
            continue;
        }
        s->person[r->kept] = s->person[i];
        s->time[r->kept] = s->time[i];
        s->index[r->kept++] = s->index[i];
    }
}

/* Read all frames once; every step-th is tried.  Of a clip that does not say
 * how long it is twice as many as wanted are kept, and every second of them
 * goes when there is no more room. */
static int clip_read(struct clip_state *s, struct clip_report *r,
                     const struct clip *c, struct framesource *in,
                     struct error *err)
{
    const size_t want = c->opt.frames;
    size_t step = 1;
    struct frame f;
    int rc;

    while ((rc = framesource_read(in, &f, err)) == 1) {
        const size_t all = framesource_total(in);

        framesource_rate(in, &s->fps_num, &s->fps_den);
        if (all > want)
            step = all / want;
        if (r->kept == s->room) {
            clip_thin(s, r, want);
            step *= 2;
        }
        if (r->read++ % step == 0 && (!all || r->kept < want) &&
            clip_add_frame(s, r, c, &f, err))
            return -1;
    }
    if (r->kept > want)
        clip_thin(s, r, want);
    if (rc < 0 && r->kept >= c->opt.min_frames)
        rc = 0;                 /* a video cut short: its frames suffice */
    return rc;
}

/* The mean of what E_beta said of each frame. */
static int clip_mean_shape(float *beta, struct identity *id,
                           const struct clip_state *s, size_t kept,
                           const struct head *head, struct error *err)
{
    const size_t n = s->person[0].nshape;

    memset(beta, 0, SHAPE_ENCODER_OUT * sizeof *beta);
    for (size_t i = 0; i < kept; i++)
        for (size_t k = 0; k < n; k++)
            beta[k] += s->person[i].shape[k] / (float)kept;
    return head_fold(id, head, beta, n, err);
}

/* MOTN with landmarks and IMAG with the mask of frame i. */
static int clip_write_frame(struct stream_writer *w,
                            const struct clip_state *s, size_t i,
                            struct landmarks *l, const struct clip *c,
                            struct error *err)
{
    struct person *p = &s->person[i];
    float lmk[3 * HEAD_LANDMARKS], uv[2 * HEAD_LANDMARKS], cam[12];
    const struct array mark = motion_landmarks(uv);
    const struct imag picture = {.height = p->size, .width = p->size,
                                 .rgb = p->rgb, .mask = p->matte};

    p->source.pose.exp = p->source.exp;
    landmarks_pose(lmk, l, &p->source.pose);
    motion_camera(cam, &p->source);
    camera_project(uv, NULL, cam, (float)p->size, lmk, HEAD_LANDMARKS);
    return motion_write(w, s->index[i], s->time[i], &p->source, c->head->nexp,
                        &mark, 1, err) ||
                   imag_write(w, s->index[i], s->time[i], &picture, err)
               ? -1
               : 0;
}

/* Everything that was kept. */
static int clip_write(struct stream_writer *w, const struct clip_state *s,
                      size_t kept, const struct clip *c, struct error *err)
{
    const struct conf conf = {
        .producer = "spid-prepare", .head = c->head, .model = c->model,
        .fps_num = s->fps_num, .fps_den = s->fps_den, .window = &s->window,
        .width = s->width, .height = s->height};
    float beta[SHAPE_ENCODER_OUT];
    struct identity id = {0};
    struct landmarks l = {0};
    int rc = -1;

    if (clip_mean_shape(beta, &id, s, kept, c->head, err) == 0 &&
        landmarks_init(&l, &id, err) == 0 &&
        conf_write(w, &conf, err) == 0)
        rc = shape_write(w, s->index[0], s->time[0], &(struct shape){
            .beta = beta, .n = SHAPE_ENCODER_OUT}, err);
    for (size_t i = 0; i < kept && rc == 0; i++)
        rc = clip_write_frame(w, s, i, &l, c, err);
    landmarks_release(&l);
    identity_release(&id);
    return rc;
}

/* Whether enough is good; the score. */
static int clip_score(struct clip_report *r, const struct clip_state *s,
                      const struct clip *c, const char *path,
                      struct error *err)
{
    if (r->kept < c->opt.min_frames || r->kept == 0) {
        error_set(err, EX_DATAERR, "%s: a good face in %zu of %zu frames "
                  "looked at (expected %zu, of at least %.0f pixels)", path,
                  r->kept, r->tried, c->opt.min_frames, c->opt.min_face);
        return 1;
    }
    r->face = s->face / (double)s->good;
    r->outlined = (double)s->outlined / (double)s->good;
    r->score = (double)s->good / (double)r->tried * (r->outlined + 1) / 2 *
               fmin(1, r->face / 256);
    return 0;
}

int clip_prepare(struct stream_writer *w, struct clip_report *r,
                 const struct clip *c, const char *path, struct error *err)
{
    struct clip_state s;
    struct framesource *in;
    int rc;

    memset(r, 0, sizeof *r);
    in = framesource_open(&path, 1, &(struct framesource_options){0}, err);
    if (!in)
        return 1;
    if (clip_state_init(&s, c->opt.frames, err)) {
        framesource_close(in);
        return -1;
    }
    rc = clip_read(&s, r, c, in, err);
    framesource_close(in);
    if (rc < 0 && err->code != EX_OSERR)
        rc = 1;                 /* damaged: bad, *err says why */
    if (rc == 0)
        rc = clip_score(r, &s, c, path, err);
    if (rc == 0)
        rc = clip_write(w, &s, r->kept, c, err);
    clip_state_release(&s, r->kept);
    return rc;
}
