/* One person after the other as the streams of spid-synth are: who, then each
 * frame's motion and picture. */
#include "lib/lab/fit/fit_records.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/stream/records.h"
#include "lib/track/conf.h"

#define FIT_RATE 25.0           /* frames a second, of what has no times */
#define FIT_BETA 300
#define FIT_SOURCES 4         /* frames of a person that act */

/* CONF: camera, units, which head. */
static int fit_records_conf(const struct fit_records *r, struct error *err)
{
    const struct conf conf = {.producer = "spid-fit", .head = r->head,
                              .size = r->size, .rate = FIT_RATE};

    return conf_write(r->out, &conf, err);
}

int fit_records_open(struct fit_records *r, const char *path,
                     const struct head *head, const struct face_fit *fit,
                     const char *base, size_t size, struct error *err)
{
    *r = (struct fit_records){
        .head = head, .fit = fit, .base = base, .size = size
    };
    r->out = stream_create(path, err);
    if (!r->out)
        return -1;
    r->verts = malloc(3 * head->V * sizeof *r->verts);
    if (!r->verts)
        error_set(err, EX_OSERR, "out of memory");
    if (r->verts && !portrait_init(&r->portrait, size, err) &&
        !fit_records_conf(r, err))
        return 0;
    return fit_records_close(r, false, err);
}

int fit_records_close(struct fit_records *r, bool whole, struct error *err)
{
    int rc = -1;

    framesource_close(r->in);
    portrait_release(&r->portrait);
    identity_release(&r->id);
    free(r->verts);
    if (whole)
        rc = stream_finish(r->out, err);
    else
        stream_abandon(r->out);
    memset(r, 0, sizeof *r);
    return rc;
}

static void fit_records_shape(float beta[FIT_BETA], const struct fit_person *p)
{
    memset(beta, 0, FIT_BETA * sizeof *beta);
    for (int i = 0; i < FACE_SHAPES; i++)
        beta[i] = (float)p->beta[i];
}

/* The head of person p, who has no SHAP yet. */
static int fit_records_begin(struct fit_records *r, const struct fit_person *p,
                             struct error *err)
{
    float beta[FIT_BETA];

    fit_records_shape(beta, p);
    identity_release(&r->id);
    r->named = false;
    return head_fold(&r->id, r->head, beta, FACE_SHAPES, err);
}

/* SHAP of a person. */
static int fit_records_person(struct fit_records *r, size_t who,
                              struct error *err)
{
    float beta[FIT_BETA];
    int32_t person = (int32_t)who;
    struct shape s = {.beta = beta, .n = FIT_BETA, .person = &person};

    fit_records_shape(beta, &r->fit->person[who]);
    r->named = true;
    return shape_write(r->out, r->written, (double)r->written / FIT_RATE, &s,
                       err);
}

/* The label's picture into r->frame. */
static int fit_records_picture(struct fit_records *r, const struct label *l,
                               struct error *err)
{
    struct framesource_options opt = {0};
    char path[4096];
    const char *name[1] = {path};
    int rc = 1;

    snprintf(path, sizeof path, "%s/%s", r->base, l->file);
    if (!r->file || strcmp(r->file, l->file) || r->frame.index > l->frame) {
        framesource_close(r->in);
        r->file = l->file;
        r->in = framesource_open(name, 1, &opt, err);
        rc = r->in ? framesource_read(r->in, &r->frame, err) : -1;
    }
    while (rc > 0 && r->frame.index < l->frame)
        rc = framesource_read(r->in, &r->frame, err);
    if (!rc)
        error_set(err, EX_DATAERR, "%s: ended before frame %llu, which is "
                  "labelled", path, (unsigned long long)l->frame);
    return rc > 0 ? 0 : -1;
}

/* The landmarks (68,2) of motion m in pixels, and the crop around them. */
static void fit_records_landmarks(float *lmk, const struct fit_records *r,
                                  struct motion *m)
{
    float at[3 * HEAD_LANDMARKS], cam[12];

    head_pose(r->verts, &r->id, &m->pose);
    head_landmarks(at, r->head, r->verts);
    motion_camera(cam, m);
    camera_project(lmk, NULL, cam, (float)r->size, at, HEAD_LANDMARKS);
    struct square q = crop_from_landmarks(lmk, HEAD_LANDMARKS);
    m->crop[0] = (float)q.x;
    m->crop[1] = (float)q.y;
    m->crop[2] = (float)q.size;
}

/* MOTN and IMAG of motion m, whose picture rgb and mask show, and alone unless
 * it is NULL. */
static int fit_records_frame(struct fit_records *r, struct motion *m,
                             uint8_t *rgb, uint8_t *mask, uint8_t *alone,
                             struct error *err)
{
    const double time = (double)r->written / FIT_RATE;
    float lmk[2 * HEAD_LANDMARKS] = {0};
    const struct array l = motion_landmarks(lmk);
    const struct imag picture = {.height = r->size, .width = r->size,
                                 .rgb = rgb, .mask = mask, .alone = alone};

    m->pose.exp = m->exp;
    fit_records_landmarks(lmk, r, m);
    if (motion_write(r->out, r->written, time, m, r->head->nexp, &l, 1, err) ||
        imag_write(r->out, r->written, time, &picture, err))
        return -1;
    r->written++;
    return 0;
}

/* The portrait that was cut last, of person p doing m, acts.  An avatar's
 * pictures keep their background: all of them is mask. */
static int fit_records_act(struct fit_records *r, const struct fit_person *p,
                           const struct motion *m, struct error *err)
{
    float beta[FIT_BETA];
    struct motion act;

    fit_records_shape(beta, p);
    if (reenact_person(r->reenact, &r->portrait, beta, FIT_BETA, m, err))
        return -1;
    memset(r->portrait.mask, 255, r->size * r->size);
    for (size_t i = 0; i < r->acts; i++)
        if (reenact_draw(r->reenact, &act, err) ||
            fit_records_frame(r, &act, r->reenact->rgb, r->portrait.mask,
                              NULL, err))
            return -1;
    return 0;
}

/* Whether the k-th of a person's n frames is one that acts. */
static bool fit_records_acts(size_t k, size_t n)
{
    size_t every = (n + FIT_SOURCES - 1) / FIT_SOURCES;

    return k % every == 0;
}

/* Whether the frame is one of its clip's that are wanted. */
static bool fit_records_wants(struct fit_records *r, const struct label *l,
                              bool first)
{
    r->place = first || l->clip != r->clip ? 0 : r->place + 1;
    r->clip = l->clip;
    return r->every < 2 || r->place % r->every == 0;
}

int fit_records_write(struct fit_records *r, size_t k, struct error *err)
{
    const struct fit_frame *f = &r->fit->frame[k];
    const size_t who = f->label->person;
    const struct fit_person *p = &r->fit->person[who];
    struct motion m;

    if (k == p->first && fit_records_begin(r, p, err))
        return -1;
    if (!fit_records_wants(r, f->label, k == p->first))
        return 0;
    face_fit_motion(&m, r->fit, k);
    m.pose.exp = m.exp;
    if (fit_records_picture(r, f->label, err) ||
        portrait_cut(&r->portrait, r->frame.rgb, r->frame.width,
                     r->frame.height, f->window, &r->id, &m, err))
        return -1;
    if (r->plain && !r->portrait.plain)
        return 0;
    if ((!r->named && fit_records_person(r, who, err)) ||
        fit_records_frame(r, &m, r->portrait.rgb, r->portrait.mask,
                          r->portrait.alone, err))
        return -1;
    return r->reenact && fit_records_acts(k - p->first, p->count)
               ? fit_records_act(r, p, &m, err) : 0;
}
