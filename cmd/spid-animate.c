/* spid-animate: one picture driven by another's video, the whole pipeline in
 * one process (Phase A, then Phase B of the paper). */
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "formats/framesink.h"
#include "formats/framesource.h"
#include "lib/animate/animate.h"
#include "lib/animate/framing.h"
#include "lib/animate/joblist.h"
#include "lib/animate/prepare.h"
#include "lib/animate/report.h"
#include "lib/track/neutral.h"

static struct framesource_options source_options;
static struct track_options track_options;
static struct animate_options animate_options = {
    .precision = OPTION_PRECISION_DEFAULT
};
static struct framesink_options sink_options;
static struct background background;
static struct framing_options framing_options;
static struct neutral neutral;
static struct prepare models = {.prune = -1};
static const char *head_path, *mask_path, *list_path;
static double closed_mm = -1;
static bool live_mode, relative, absolute;

static int parse_background(const char *value, void *dest, struct error *err)
{
    framing_options.background_given = true;
    framing_options.source_background = strcmp(value, "source") == 0;
    return framing_options.source_background
               ? 0 : background_parse(value, dest, err);
}

static const struct cli_option options[] = {
    {"star", 's', CLI_FLAG, &animate_options.star, 0, 0, NULL,
     "SpiD*: draw three channels, no refiner", NULL},
    {"size", 0, CLI_INT, &framing_options.size, 32, PERSON_LARGEST, "N",
     "pictures of N by N pixels (default the model's, 512)", NULL},
    {"live", 'l', CLI_FLAG, &live_mode, 0, 0, NULL,
     "drop frames instead of lagging; report the latency", NULL},
    {"list", 0, CLI_STRING, &list_path, 0, 0, "FILE",
     "many clips: SOURCE, DRIVER and OUT on each line, tabs between", NULL},
    OPTION_WITHOUT(&models.without),
    {"prune", 0, CLI_FLOAT, &models.prune, 0, 1e6, "EPS",
     "drop Gaussians that no view shows above EPS", NULL},
    {"no-photo", 0, CLI_FLAG, &models.no_photo, 0, 0, NULL,
     "baked colours alone, no photograph as texture", NULL},
    {"keep-clear", 0, CLI_FLAG, &models.keep_clear, 0, 0, NULL,
     "keep Gaussians of opacity under 1/255", NULL},
    {"closed", 0, CLI_FLOAT, &closed_mm, 0, 100, "MM",
     "lips open less than this hide the mouth (default 0.5)", NULL},
    {"mask", 0, CLI_STRING, &mask_path, 0, 0, "FILE",
     "matte of the source: white where the person is", NULL},
    {"background", 'b', CLI_CALL, &background, 0, 0, "WHAT",
     "R,G,B, a name, a picture, or source (a picture's default)",
     parse_background},
    {"into-source", 0, CLI_FLAG, &framing_options.into_source, 0, 0, NULL,
     "the driven head in the whole photograph, moving from where it was",
     NULL},
    {"cut", 0, CLI_FLAG, &framing_options.cut, 0, 0, NULL,
     "leave out what of the window lies outside of the photograph", NULL},
    {"format", 'f', CLI_CALL, &sink_options.format, 0, 0, "FORMAT",
     "stream, y4m, png, pam, exr or mp4 (default by the name)",
     framesink_parse_format},
    {"alpha", 0, CLI_FLAG, &sink_options.alpha, 0, 0, NULL,
     "keep the background clear (PNG, PAM, EXR, stream)", NULL},
    {"smooth", 0, CLI_FLOAT, &track_options.smooth, 0, 100, "HZ",
     "one-euro smoothing with this cut-off at rest (default 0: off)", NULL},
    OPTION_NO_TTA(&track_options.no_tta),
    {"relative", 0, CLI_FLAG, &relative, 0, 0, NULL,
     "what the driver does since it was neutral, from the source's rest (the "
     "default)", NULL},
    {"absolute", 0, CLI_FLAG, &absolute, 0, 0, NULL,
     "the driver's own pose and expression", NULL},
    {"neutral", 0, CLI_CALL, &neutral, 0, 0, "FRAME",
     "first, auto or a number: the driver's frame at rest (default first)",
     neutral_parse},
    {"fps", 0, CLI_FLOAT, &source_options.rate, 0.001, 100000, "RATE",
     "frames a second of pictures without times (default 25)", NULL},
    {"bt601", 0, CLI_FLAG, &source_options.bt601, 0, 0, NULL,
     "Y4M is BT.601 (default BT.709)", NULL},
    {"roi", 0, CLI_FLAG, &animate_options.roi, 0, 0, NULL,
     "refine only the part with the head", NULL},
    {"f32", 0, CLI_FLAG, &animate_options.f32, 0, 0, NULL,
     "features in float before the refiner, not in half precision", NULL},
    OPTION_PRECISION_REFINE(&animate_options.precision, "networks"),
    OPTION_HEAD(&head_path),
    {0}
};

static const struct cli_usage usage = {
    "spid-animate", "[-s] [--size N] [-l] [--without PART] [--prune EPS] "
    "[--no-photo] [--keep-clear] [--closed MM] [--mask FILE] [-b WHAT] "
    "[--into-source] [--cut] [-f FORMAT] [--alpha] [--smooth HZ] [--no-tta] "
    "[--relative] [--absolute] [--neutral FRAME] [--fps RATE] [--bt601] "
    "[--roi] [--f32] [--precision TYPE] [--head FILE] [-o FILE] [-j N] "
    "[-m MODEL] [-q] [--stats FILE] [--list FILE | SOURCE DRIVER]",
    "drive a person's picture by a video", options
};

/* One clip: what is open while it runs. */
struct clip {
    const struct job *job;
    struct prepared source;
    struct framesource *frames; /* or */
    struct stream_reader *records;
    struct live live;
    struct track track;
    struct identity mean;       /* the driver's head: nobody's shape */
    struct driver driver;
    struct framing framing;
    struct animate animate;
    struct framesink *sink;
    struct animate_report report;
};

static void open_models(void)
{
    struct error err = {0};
    char model[4096], head[4096];

    /* 8 bits are the refiner's alone */
    models.precision = animate_options.precision == NN_INT8
                           ? NN_FAST : animate_options.precision;
    if (cli_find_model("model.safetensors", model, sizeof model, &err) ||
        (!head_path && cli_find_model("head.safetensors", head, sizeof head,
                                      &err)) ||
        prepare_open(&models, model, head_path ? head_path : head, &err))
        die_error(&err);
    track_options.size = (double)models.model.config.size;
    framing_options.model_size = models.model.config.size;
    animate_options.model = &models.model;
    animate_options.rules = models.model.config.system == SYSTEM_GAGAVATAR
                                ? SPLAT_DGR : SPLAT_GSPLAT;
    animate_options.workers = cli.threads > 0 ? cli.threads
                                              : omp_get_max_threads();
    animate_options.closed = closed_mm < 0 ? BAKED_CLOSED
        : (float)(closed_mm * 1e-3 * (double)models.head.scale);
}

/* Phase A. */
static int open_source(struct clip *c, struct error *err)
{
    const struct prepared *s = &c->source;

    if (prepare_source(&c->source, &models, c->job->source, mask_path, err))
        return -1;
    if (s->damaged)
        warn("%s: the picture is damaged or cut short: what is missing is grey",
             c->job->source);
    if (s->disc)
        warn("%s: no outline of the person found: the matte is a disc about "
             "the head (--mask FILE gives a better one)", c->job->source);
    if (cli.stats) {
        stats_end("A: shape", stats_begin() - s->shape_s);
        stats_end("A: branches", stats_begin() - s->bake_s);
    }
    if (framing_init(&c->framing, &animate_options, &framing_options, s, err))
        return error_prefix(err, "%s", c->job->source);
    if (c->framing.background.rgb) {    /* the sink has the address */
        background_release(&background);
        background = c->framing.background;
        c->framing.background = (struct background){0};
    }
    return 0;
}

/* The clip's own: its photograph. */
static const struct animate_options *clip_options(const struct clip *c)
{
    animate_options.texture = c->source.texture.levels ? &c->source.texture
                                                       : NULL;
    return &animate_options;
}

/* Motions from the source's own, since the driver was neutral. */
static int set_relative(struct clip *c, struct error *err)
{
    const struct neutral_clip clip = {
        &c->job->driver, 1, &source_options, &track_options, &c->mean,
        &models.nets.motion, models.head.nexp
    };
    struct motion rest;

    if (!c->source.person.has_source)   /* an avatar alone: nothing to add to */
        return 0;
    if (neutral.given && neutral_find(&rest, &neutral, &clip, err))
        return -1;
    driver_set_relative(&c->driver, &c->source.person.source,
                        neutral.given ? &rest : NULL, models.head.nexp);
    return 0;
}

/* A driver whose motions a stream has already; pictures are none. */
static int open_records(struct clip *c, struct error *err)
{
    if (live_mode)
        return error_set(err, EX_USAGE, "%s: a stream of motions cannot be "
                         "live (expected frames)", c->job->driver);
    c->records = stream_open(c->job->driver, NULL, err);
    if (!c->records)
        return -1;
    driver_init_records(&c->driver, c->records, models.head.nexp);
    if (driver_start(&c->driver, NULL, NULL, err) != DRIVER_STARTED)
        return -1;
    if (source_options.rate > 0)
        framesink_set_rate(c->sink, (int)(1000 * source_options.rate + 0.5),
                           1000);
    else
        framesink_set_rate(c->sink, 25, 1);
    if (neutral.given)
        return error_set(err, EX_USAGE, "%s: --neutral looks through frames "
                         "(expected a clip)", c->job->driver);
    return relative ? set_relative(c, err) : 0;
}

static int open_driver(struct clip *c, struct error *err)
{
    enum driver_status status;
    int num, den;

    if (prepare_is_stream(c->job->driver))
        return open_records(c, err);
    c->frames = framesource_open(&c->job->driver, 1, &source_options, err);
    if (!c->frames || head_fold(&c->mean, &models.head, NULL, 0, err) ||
        track_init(&c->track, &c->mean, &models.nets.motion, &track_options,
                   err) ||
        (live_mode && live_start(&c->live, c->frames, err)))
        return -1;
    if (live_mode)
        driver_init(&c->driver, &c->track, live_read, &c->live);
    else
        driver_init(&c->driver, &c->track, driver_read_source, c->frames);
    status = driver_start(&c->driver, NULL, NULL, err);
    if (status == DRIVER_NO_FACE)
        error_prefix(err, "%s", c->job->driver);
    if (status != DRIVER_STARTED)
        return -1;
    if (!absolute && set_relative(c, err))
        return -1;
    framesource_rate(c->frames, &num, &den);
    framesink_set_rate(c->sink, num, den);
    if (c->driver.early_count)
        warn("%s: no face in the first %zu frames: they take the motion of "
             "frame %zu", c->job->driver, c->driver.early_count,
             c->driver.early_count);
    return 0;
}

static void frame_done(void *ctx, const struct animate_frame *f)
{
    struct clip *c = ctx;

    if (f->track->event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion",
             c->job->driver, (unsigned long long)f->index, f->track->why);
    else if (f->track->event == TRACK_FOUND)
        warn("%s: frame %llu: face found again", c->job->driver,
             (unsigned long long)f->index);
    animate_report_frame(&c->report, f);
    if (cli.stats)
        animate_report_times(stats_begin, stats_end, f);
    progress("frames", f->index + 1,
             live_mode || !c->frames ? 0 : framesource_total(c->frames),
             f->track->lost ? "lost" : NULL);
}

/* What a clip opened; its output is given up when it failed. */
static void close_clip(struct clip *c, int failed)
{
    animate_release(&c->animate);
    driver_release(&c->driver);
    live_stop(&c->live);
    track_release(&c->track);
    identity_release(&c->mean);
    if (c->frames && framesource_damaged(c->frames))
        warn("%s: %zu pictures are damaged or cut short: what is missing is "
             "grey", c->job->driver, framesource_damaged(c->frames));
    framesource_close(c->frames);
    stream_close(c->records);
    if (failed)
        framesink_abandon(c->sink);
    framing_release(&c->framing);
    prepared_release(&c->source);
    animate_report_release(&c->report);
}

/* The lines that are this program. */
static int run_clip(const struct job *job, struct error *err)
{
    struct clip *c = calloc(1, sizeof *c);
    int rc = -1;

    if (!c)
        return error_set(err, EX_OSERR, "no memory for a clip");
    c->job = job;
    sink_options.path = job->out;
    sink_options.bt601 = source_options.bt601;
    sink_options.record = FRAMESINK_IMAG;
    sink_options.background = &background;
    c->sink = framesink_open(&sink_options, err);
    if (c->sink && open_source(c, err) == 0 && open_driver(c, err) == 0 &&
        animate_init(&c->animate, clip_options(c), &c->source.id,
                     &c->source.baked, &models.dense, err) == 0)
        rc = animate_run(&c->animate, &c->driver,
                         live_mode ? &c->live : NULL, c->sink, frame_done, c,
                         err);
    progress_end();
    if (rc == 0) {
        rc = framesink_finish(c->sink, err);
        c->sink = NULL;
        c->report.dropped = c->live.dropped;
    }
    if (rc == 0 && !cli.quiet)
        animate_report_print(stderr, &c->report, &c->source,
                             cli.stats != NULL, live_mode);
    close_clip(c, rc);
    free(c);
    return rc;
}

/* Clips whose output exists are done already. */
static int run_list(void)
{
    struct joblist list;
    struct error err = {0};
    size_t failed = 0, done = 0;

    if (joblist_read(&list, list_path, &err))
        die_error(&err);
    for (size_t i = 0; i < list.count; i++) {
        const struct job *job = &list.job[i];

        if (access(job->out, F_OK) == 0) {
            done++;
            continue;
        }
        err = (struct error){0};
        if (run_clip(job, &err)) {
            warn("%s: %s", job->out, err.text);
            failed++;
        }
    }
    if (!cli.quiet)
        fprintf(stderr, "spid-animate: %zu clips: %zu made, %zu were there, "
                "%zu failed\n", list.count, list.count - done - failed, done,
                failed);
    joblist_release(&list);
    return failed ? EX_DATAERR : 0;
}

int main(int argc, char **argv)
{
    struct error err = {0};
    int rc = 0, first = cli_parse(&usage, argc, argv);

    if (argc - first != (list_path ? 0 : 2))
        die(EX_USAGE, "%d operands (expected %s)", argc - first,
            list_path ? "none with --list" : "SOURCE and DRIVER");
    if (absolute && (relative || neutral.given || framing_options.into_source))
        die(EX_USAGE, "--absolute: the driver's own pose (expected no %s)",
            relative ? "--relative"
                     : neutral.given ? "--neutral" : "--into-source");
    if (framing_options.into_source &&
        (framing_options.cut || sink_options.alpha))
        die(EX_USAGE, "--into-source: the whole photograph (expected no %s)",
            sink_options.alpha ? "--alpha" : "--cut");
    open_models();
    if (list_path) {
        rc = run_list();
    } else {
        struct job job = {argv[first], argv[first + 1], cli.output};

        if (run_clip(&job, &err))
            die_error(&err);
    }
    stats_write();
    background_release(&background);
    prepare_release(&models);
    return rc;
}
