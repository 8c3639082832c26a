/* From a source and a driver to an output: what is opened for a clip, in
 * order, and closed (animation.h). */
#include "lib/animate/animation.h"

#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/track/take.h"

int animation_load(struct prepare *models, struct animation_options *opt,
                   const char *model, const char *head, int workers,
                   struct error *err)
{
    struct pipeline_options *a = &opt->animate.pipeline;

    /* 8 bits are the refiner's alone */
    models->precision = a->precision == NN_INT8 ? NN_FAST : a->precision;
    if (prepare_open(models, model, head, err))
        return -1;
    if (models->model.config.system == SYSTEM_LAM)
        a->star = true;         /* it has no refiner */
    models->star = a->star;
    opt->track.size = (double)models->model.config.size;
    opt->track.detector = models->track.detector = &models->detector;
    opt->track.across = models->track.across = &models->across;
    opt->framing.model_size = models->model.config.size;
    models->track.finest = framing_finest(&opt->framing);
    a->model = &models->model;
    a->rules = models->model.config.system == SYSTEM_SPID
                   ? SPLAT_GSPLAT : SPLAT_DGR;
    opt->animate.workers = workers;
    return 0;
}

int animation_open(struct animation *a, const struct animation_options *opt,
                   struct prepare *models, const char *out,
                   struct error *err)
{
    struct framesink_options sink = opt->sink;

    memset(a, 0, sizeof *a);
    a->opt = opt;
    a->models = models;
    a->background = opt->background;
    a->output = sink.path = out;
    sink.record = FRAMESINK_IMAG;
    sink.background = &a->background;
    a->sink = framesink_open(&sink, err);
    return a->sink ? 0 : -1;
}

/* Tracker and driver over the frames that read gives. */
static int animation_init_driver(struct animation *a, driver_read_fn *read,
                                 void *ctx, struct error *err)
{
    if (head_fold(&a->mean, &a->models->head, NULL, 0, err) ||
        track_init(&a->track, &a->mean, &a->models->nets.motion,
                   &a->opt->track, err))
        return -1;
    driver_init(&a->driver, &a->track, read, ctx);
    if (a->opt->light.from == LIGHT_DRIVER)
        a->driver.light = &a->models->nets.light;
    return 0;
}

/* The driver up to the first face, or its first motion. */
static int animation_start_driver(struct animation *a, struct error *err)
{
    return driver_start(&a->driver, a->driver_name, NULL, NULL, err);
}

/* A clip up to its first face, into a->first_face. */
static void animation_read_to_face(struct animation *a, bool alone)
{
    struct error *err = &a->first_face.err;

    a->first_face.rc = -1;
    a->first_face.done = true;
    a->frames = framesource_open(&a->driver_name, 1, &a->opt->source, err);
    if (!a->frames ||
        animation_init_driver(a, driver_read_source, a->frames, err))
        return;
    if (!alone)
        parallel_alone(true);
    a->first_face.rc = animation_start_driver(a, err);
}

/* The same as a thread beside Phase A. */
static void *animation_run_read_to_face(void *a)
{
    animation_read_to_face(a, false);
    return NULL;
}

int animation_open_source(struct animation *a, const char *path,
                          const char *driver, struct error *err)
{
    struct prepare_beside reading = {.run = animation_run_read_to_face,
                                     .ctx = a};
    const struct prepared *s = &a->source;
    const bool clip = driver && strcmp(driver, "-") &&
                      !stream_probe(driver) && !livelink_probe(driver);

    a->driver_name = driver;
    if (prepare_source(&a->source, a->models, path, a->opt->mask,
                       clip ? &reading : NULL, err))
        return -1;
    a->animate = a->opt->animate;
    if (framing_init(&a->framing, &a->animate, &a->opt->framing, s, err))
        return error_prefix(err, "%s", path);
    if (a->framing.background.rgb)
        a->background = a->framing.background;
    return 0;
}

/* Motions from the source's own, since the driver was neutral. */
static int animation_set_relative(struct animation *a, struct error *err)
{
    const struct animation_options *opt = a->opt;
    const size_t nexp = a->models->head.nexp;
    const struct neutral_clip clip = {
        &a->driver_name, 1, &opt->source, &opt->track, &a->mean,
        &a->models->nets.motion, nexp
    };
    struct motion rest;

    if (!a->source.person.has_source)   /* an avatar alone: nothing to add to */
        return 0;
    if (opt->neutral.given && neutral_find(&rest, &opt->neutral, &clip, err))
        return -1;
    driver_set_relative(&a->driver, &a->source.person.calm,
                        opt->neutral.given ? &rest : NULL, nexp);
    return 0;
}

/* Motions that are there already exclude what needs pictures. */
static int animation_check_motions(const struct animation *a,
                                   struct error *err)
{
    if (a->opt->neutral.given)
        return error_set(err, EX_USAGE, "%s: --neutral looks through frames "
                         "(expected a clip)", a->driver_name);
    return 0;
}

/* A take, at rest where all its numbers are 0. */
static int animation_open_take(struct animation *a, struct error *err)
{
    static const float rest[LIVELINK_CHANNELS];
    const struct animation_options *opt = a->opt;
    const struct head *h = &a->models->head;
    struct motion neutral;

    if (animation_check_motions(a, err))
        return -1;
    if (!head_has_arkit(h))
        return error_set(err, EX_CONFIG, "%s: the head has not ARKit's "
                         "expressions (expected one of spid-head --from)",
                         a->driver_name);
    a->take = livelink_open(a->driver_name, opt->source.rate, err);
    if (!a->take)
        return -1;
    driver_init_take(&a->driver, a->take, h->nexp);
    if (animation_start_driver(a, err))
        return -1;
    framesink_set_rate(a->sink, (int)(1000 * livelink_rate(a->take) + 0.5),
                       1000);
    take_to_motion(&neutral, h->nexp, rest);
    if (opt->relative && a->source.person.has_source)
        driver_set_relative(&a->driver, &a->source.person.calm, &neutral,
                            h->nexp);
    return 0;
}

/* driver's pass: CONF says the rate and whose sound it is. */
static void animation_pass(void *animation, const struct record *rec)
{
    struct animation *a = animation;

    if (record_is(rec, RECORD_CONF))
        framesink_read_conf(a->sink, rec);
}

/* A driver whose motions a stream has already; pictures are none. */
static int animation_open_records(struct animation *a, struct error *err)
{
    const struct animation_options *opt = a->opt;
    const char *name = a->driver_name;

    if (animation_check_motions(a, err))
        return -1;
    a->records = stream_open(name, NULL, err);
    if (!a->records)
        return -1;
    driver_init_records(&a->driver, a->records, a->models->head.nexp);
    a->driver.pass = animation_pass;
    a->driver.ctx = a;
    framesink_set_rate(a->sink, (int)(1000 * opt->source.rate + 0.5), 1000);
    if (animation_start_driver(a, err))
        return -1;
    framesink_set_rate(a->sink, 25, 1);
    if (opt->no_sound)
        framesink_set_sound(a->sink, NULL, 0);
    a->sound_lost = framesink_lost_sound(a->sink);
    return 0;
}

/* The clip's sound goes along, where the output takes it.  Files that are read
 * are not written. */
static int animation_join_output(struct animation *a, struct error *err)
{
    double start = 0;
    const char *clip = framesource_sound(a->frames, &start);
    int num, den;

    if (framesource_reads(a->frames, a->output))
        return error_set(err, EX_USAGE, "%s: is read, too (expected another "
                         "name for the output)", a->output);
    a->silent = clip && (a->opt->no_sound ||
                         !framesink_set_sound(a->sink, clip, start));
    a->total = framesource_total(a->frames);
    framesource_rate(a->frames, &num, &den);
    framesink_set_rate(a->sink, num, den);
    return 0;
}

int animation_open_driver(struct animation *a, const char *path,
                          struct error *err)
{
    a->driver_name = path;
    if (stream_probe(path))
        return animation_open_records(a, err);
    if (livelink_probe(path))
        return animation_open_take(a, err);
    if (!a->first_face.done)
        animation_read_to_face(a, true);
    if (a->first_face.rc) {
        *err = a->first_face.err;
        return -1;
    }
    if (a->opt->relative && animation_set_relative(a, err))
        return -1;
    return animation_join_output(a, err);
}

int animation_open_camera(struct animation *a, const char *name,
                          const struct live_follow *follow,
                          struct error *err)
{
    struct live_follow f = *follow;
    struct framesource *frames = follow->open(follow->ctx, err);

    a->driver_name = name;
    f.paced = frames && framesource_recorded(frames);
    if (f.paced || strcmp(name, "-") == 0) {
        f.open = NULL;
        a->frames = frames;
    }
    if (!frames || live_start(&a->live, frames, &f, err) ||
        animation_init_driver(a, live_read, &a->live, err))
        return -1;
    a->driver.live = true;
    return animation_start_driver(a, err) ||
           (a->opt->relative && animation_set_relative(a, err)) ? -1 : 0;
}

int animation_run(struct animation *a,
                  void (*done)(void *ctx, const struct animate_frame *f),
                  void *ctx, struct error *err)
{
    struct framesink *sink = a->sink;
    const struct pipeline_avatar avatar = prepared_avatar(&a->source,
                                                          a->models);
    int rc = target_light_apply(&a->source.baked, &a->opt->light,
                                &a->driver.found.motion, err);

    if (rc == 0)
        rc = animate_init(&a->workers, &a->animate, &avatar, err);
    if (rc == 0)
        rc = animate_run(&a->workers, &a->driver,
                         a->live.started ? &a->live : NULL, sink, done, ctx,
                         err);
    a->report.dropped = a->live.dropped;
    if (rc)
        return -1;
    if (a->frames && !a->live.started)
        framesink_set_end(sink, framesource_end(a->frames));
    a->sink = NULL;
    return framesink_finish(sink, err);
}

void animation_close(struct animation *a)
{
    animate_release(&a->workers);
    driver_release(&a->driver);
    live_stop(&a->live);
    track_release(&a->track);
    identity_release(&a->mean);
    framesource_close(a->frames);
    stream_close(a->records);
    livelink_close(a->take);
    framesink_abandon(a->sink);
    framing_release(&a->framing);
    prepared_release(&a->source);
    animate_report_release(&a->report);
}
