/* The library's five calls: one prepared person, one tracker, one pipeline. */
#include "lib/api/spid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesink.h"
#include "lib/animate/pipeline.h"
#include "lib/animate/prepare.h"
#include "lib/base/parallel.h"
#include "lib/track/relative.h"
#include "lib/track/source.h"
#include "lib/track/track.h"

#define HEAD_FILE "head.safetensors"
#define MODEL_FILE "model.safetensors"

struct spid {
    struct spid_options opt;
    struct prepare models;
    struct prepared source;
    struct pipeline pipeline;
    struct identity mean;       /* the driver's head: nobody's shape */
    struct track track;
    struct relative rest;       /* when relative, from the first face on */
    bool tracked, started;      /* the tracker is ready; there was a face */
    size_t width, height;       /* of the last frame followed */
    struct motion motion;
    struct error err;
};

/* ---- opening ------------------------------------------------------------- */

/* Where the model is, and the head beside it. */
static int spid_find(char model[4096], char head[4096], const char *given)
{
    const char *path = given ? given : getenv("SPID_MODEL");

    snprintf(model, 4096, "%s", path ? path : SPID_DATADIR "/" MODEL_FILE);
    const char *slash = strrchr(model, '/');
    const int folder = slash ? (int)(slash - model) + 1 : 0;
    return snprintf(head, 4096, "%.*s%s", folder, model, HEAD_FILE) < 4096
               ? 0 : -1;
}

/* The renderer for the person. */
static int spid_open_pipeline(struct spid *s)
{
    const struct model *m = &s->models.model;
    const bool star = s->opt.star || !m->config.has_refiner;
    const struct pipeline_avatar avatar = prepared_avatar(&s->source,
                                                          &s->models);
    const struct pipeline_options opt = {
        .size = m->config.size, .model = star ? NULL : m, .star = star,
        .rules = m->config.system == SYSTEM_SPID ? SPLAT_GSPLAT
                                                 : SPLAT_DGR,
        .precision = NN_FAST, .threads = parallel_width()
    };

    return pipeline_init(&s->pipeline, &opt, &avatar, &s->err);
}

/* The person at rest, as the source shows it. */
static int spid_set_own_motion(struct spid *s)
{
    if (!s->source.person.has_source)
        return error_set(&s->err, EX_DATAERR, "the source has no motion of "
                         "its own (expected a picture, or MOTN beside SRCI)");
    s->motion = s->source.person.source;
    s->motion.pose.exp = s->motion.exp;
    return 0;
}

/* Everything of s, which is zeroed but for its options. */
static int spid_prepare(struct spid *s, const char *source)
{
    char model[4096], head[4096];

    if (spid_find(model, head, s->opt.model))
        return error_set(&s->err, EX_NOINPUT, "the model's name is too long");
    if (s->opt.threads > 0)
        parallel_set_width(s->opt.threads);
    s->models = (struct prepare){
        .star = s->opt.star, .once = true, .precision = NN_FAST
    };
    if (prepare_open(&s->models, model, head, &s->err))
        return -1;
    s->models.track.finest = source_finest(s->models.model.config.size);
    if (prepare_source(&s->source, &s->models, source, NULL, NULL, &s->err))
        return error_prefix(&s->err, "%s", source);
    return spid_set_own_motion(s) || spid_open_pipeline(s) ? -1 : 0;
}

struct spid *spid_open(const char *source, const struct spid_options *opt,
                       char *error, size_t size)
{
    struct spid *s = calloc(1, sizeof *s);

    if (s && opt)
        s->opt = *opt;
    if (s && spid_prepare(s, source) == 0)
        return s;
    snprintf(error, size, "%s", s ? s->err.text : "out of memory");
    spid_close(s);
    return NULL;
}

void spid_close(struct spid *s)
{
    if (!s)
        return;
    pipeline_release(&s->pipeline);
    if (s->tracked)
        track_release(&s->track);
    identity_release(&s->mean);
    prepared_release(&s->source);
    prepare_release(&s->models);
    free(s);
}

const char *spid_error(const struct spid *s)
{
    return s->err.text;
}

size_t spid_size(const struct spid *s)
{
    return s->pipeline.opt.size;
}

/* ---- driving ------------------------------------------------------------- */

void spid_motion(struct spid_motion *m, const struct spid *s)
{
    const struct motion *from = &s->motion;

    memcpy(m->rotation, from->R, sizeof m->rotation);
    memcpy(m->translation, from->t, sizeof m->translation);
    memcpy(m->expression, from->exp, sizeof m->expression);
    memcpy(m->jaw, from->pose.jaw, sizeof m->jaw);
    memcpy(m->lids, from->pose.lid, sizeof m->lids);
    memcpy(m->eyes, from->pose.eye, sizeof m->eyes);
}

int spid_drive(struct spid *s, const struct spid_motion *m)
{
    const float *number = m->rotation;
    struct motion *to = &s->motion;

    for (size_t i = 0; i < sizeof *m / sizeof *number; i++)
        if (!isfinite(number[i]))
            return error_set(&s->err, EX_DATAERR, "number %zu of the motion "
                             "is not finite", i);
    memcpy(to->R, m->rotation, sizeof m->rotation);
    memcpy(to->t, m->translation, sizeof m->translation);
    memcpy(to->exp, m->expression, sizeof m->expression);
    memcpy(to->pose.jaw, m->jaw, sizeof m->jaw);
    memcpy(to->pose.lid, m->lids, sizeof m->lids);
    memcpy(to->pose.eye, m->eyes, sizeof m->eyes);
    to->pose.exp = to->exp;
    return 0;
}

/* The tracker, when the first frame comes. */
static int spid_open_track(struct spid *s)
{
    const struct track_options opt = {
        .size = (double)s->models.model.config.size
    };

    if (s->tracked)
        return 0;
    if (head_fold(&s->mean, &s->models.head, NULL, 0, &s->err) ||
        track_init(&s->track, &s->mean, &s->models.nets.motion, &opt, &s->err))
        return -1;
    s->tracked = true;
    return 0;
}

/* What the tracker found becomes the person's motion. */
static void spid_take(struct spid *s, struct track_result *r, bool first)
{
    const struct head *h = &s->models.head;
    struct motion calm = r->motion;

    r->motion.pose.exp = r->motion.exp;
    calm_face(&calm, &s->track.calm);
    if (s->opt.relative && first)
        relative_init(&s->rest, &s->source.person.calm, &calm, h->nexp);
    if (s->opt.relative)
        relative_apply(&r->motion, &s->rest);
    s->motion = r->motion;
    s->motion.pose.exp = s->motion.exp;
}

int spid_follow(struct spid *s, const uint8_t *rgb, size_t width,
                size_t height, double time)
{
    const struct frame f = {.width = width, .height = height, .rgb = rgb,
                            .time = time};
    struct track_result r;
    int rc;

    if (spid_open_track(s))
        return -1;
    const bool first = !s->started || width != s->width || height != s->height;
    s->width = width;
    s->height = height;
    if (first) {
        rc = track_start(&s->track, &r, &f, NULL, &s->err);
        s->started = rc > 0;
        if (rc <= 0)
            return rc;
    } else if (track_step(&s->track, &r, &f, &s->err)) {
        return -1;
    } else if (r.lost) {
        return 0;
    }
    spid_take(s, &r, first);
    return 1;
}

/* ---- drawing ------------------------------------------------------------- */

int spid_draw(struct spid *s, uint8_t *rgba)
{
    if (pipeline_draw(&s->pipeline, &s->motion, &s->err))
        return -1;
    const struct pipeline_picture p = pipeline_picture(&s->pipeline);
    const struct framesink_frame f = {
        .width = p.side, .height = p.side, .channels = 3, .color = p.color,
        .alpha = p.alpha
    };
    framesink_compose_rgba(rgba, &f);
    return 0;
}
