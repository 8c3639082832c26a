/* spid-live: an avatar that a camera drives, until it is stopped.  Phase B of
 * the paper on the newest frame there is, whatever becomes of the camera. */
#include <omp.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/framesink.h"
#include "formats/framesource.h"
#include "lib/animate/animate.h"
#include "lib/animate/prepare.h"
#include "lib/animate/report.h"

static struct framesource_options source_options;
static struct track_options track_options;
static struct animate_options animate_options = {
    .precision = OPTION_PRECISION_DEFAULT, .closed = BAKED_CLOSED
};
static struct framesink_options sink_options;
static struct background background;
static struct prepare models = {.prune = -1};
static const char *head_path, *mask_path;
static double patience = 10;
static long most;               /* frames; 0: no end */
static bool preview, relative;

static const struct cli_option options[] = {
    OPTION_FLAG("star", 's', &animate_options.star,
                "SpiD*: draw three channels, no refiner"),
    OPTION_FLAG("preview", 'p', &preview, "show it in this terminal"),
    OPTION_CALL("format", 'f', &sink_options.format, "FORMAT",
                framesink_parse_format,
                "y4m, png, pam, stream or mp4 (default by the name; y4m for a "
                "pipe)"),
    OPTION_CALL("background", 'b', &background, "WHAT", background_parse,
                "R,G,B, a name or a picture (default black)"),
    OPTION_FLOAT("patience", 0, &patience, 0, 1e6, "SECONDS",
                 "wait so long for a source that stops (default 10)"),
    OPTION_INT("frames", 0, &most, 1, 1e15, "N", "end after so many frames"),
    OPTION_FLAG("relative", 0, &relative,
                "do what the driver does since its first frame, from the "
                "source's rest"),
    OPTION_FLOAT("smooth", 0, &track_options.smooth, 0, 100, "HZ",
                 "one-euro smoothing with this cut-off at rest (default 0: "
                 "off)"),
    OPTION_NO_TTA(&track_options.no_tta),
    OPTION_FLOAT("fps", 0, &source_options.rate, 0.001, 100000, "RATE",
                 "frames a second of what has no times (default 25)"),
    OPTION_FLAG("bt601", 0, &source_options.bt601,
                "Y4M is BT.601 (default BT.709)"),
    OPTION_FLAG("roi", 0, &animate_options.roi,
                "refine only the part with the head"),
    OPTION_STRING("mask", 0, &mask_path, "FILE",
                  "matte of the source: white where the person is"),
    OPTION_PRECISION_REFINE(&animate_options.precision, "networks"),
    OPTION_HEAD(&head_path),
    {0}
};

static const struct cli_usage usage = {
    "spid-live", "[-s] [-p] [-f FORMAT] [-b WHAT] [--patience SECONDS] "
    "[--frames N] [--relative] [--smooth HZ] [--no-tta] [--fps RATE] "
    "[--bt601] [--roi] [--mask FILE] [--precision TYPE] [--head FILE] "
    "[-o FILE] [-j N] [-m MODEL] [-q] [--stats FILE] SOURCE CAMERA",
    "drive a person's picture by a camera", options
};

struct program {
    const char *camera;         /* its name */
    struct prepared source;
    struct live live;
    struct track track;
    struct identity mean;       /* the driver's head: nobody's shape */
    struct driver driver;
    struct animate animate;
    struct framesink *sink;
    struct animate_report report;
    size_t restarts;            /* told so far */
};

/* Set by a signal, or when there are enough frames. */
static volatile sig_atomic_t stopped;

static void stop(int signal)
{
    (void)signal;
    stopped = 1;
}

/* Phase A. */
static void open_source(struct program *p, const char *name)
{
    struct error err = {0};
    char model[4096], head[4096];

    models.precision = animate_options.precision == NN_INT8
                           ? NN_FAST : animate_options.precision;
    if (cli_find_model("model.safetensors", model, sizeof model, &err) ||
        (!head_path && cli_find_model("head.safetensors", head, sizeof head,
                                      &err)) ||
        prepare_open(&models, model, head_path ? head_path : head, &err) ||
        prepare_source(&p->source, &models, name, mask_path, &err))
        die_error(&err);
    track_options.size = (double)models.model.config.size;
    animate_options.size = models.model.config.size;
    animate_options.model = &models.model;
    animate_options.workers = cli.threads > 0 ? cli.threads
                                              : omp_get_max_threads();
    animate_options.texture = p->source.texture.levels ? &p->source.texture
                                                       : NULL;
}

/* The camera, once more; it is opened by its first frame. */
static struct framesource *open_camera(void *program, struct error *err)
{
    const struct program *p = program;

    return framesource_open(&p->camera, 1, &source_options, err);
}

/* It is gone. */
static void camera_away(void *program, const struct error *why)
{
    const struct program *p = program;

    if (!stopped)
        warn("%s: no more frames%s%s%s; waiting for them", p->camera,
             why ? " (" : "", why ? why->text : "", why ? ")" : "");
}

/* Standard input ends for good. */
static void start_camera(struct program *p)
{
    struct live_follow follow = {
        .open = strcmp(p->camera, "-") ? open_camera : NULL,
        .away = camera_away, .ctx = p, .patience = patience, .stop = &stopped
    };
    struct error err = {0};
    struct framesource *frames = open_camera(p, &err);

    if (!frames || live_start_follow(&p->live, frames, &follow, &err))
        die_error(&err);
}

/* Frames until there is a face. */
static int find_face(struct program *p, struct error *err)
{
    enum driver_status status;

    if (head_fold(&p->mean, &models.head, NULL, 0, err) ||
        track_init(&p->track, &p->mean, &models.nets.motion, &track_options,
                   err))
        return -1;
    driver_init(&p->driver, &p->track, live_read, &p->live);
    p->driver.live = true;
    status = driver_start(&p->driver, NULL, NULL, err);
    if (status == DRIVER_NO_FACE)
        error_prefix(err, "%s", p->camera);
    if (status != DRIVER_STARTED)
        return -1;
    if (relative)
        driver_set_relative(&p->driver, &p->source.person.source,
                            NULL, models.head.nexp);
    return 0;
}

static void frame_done(void *program, const struct animate_frame *f)
{
    struct program *p = program;
    const unsigned long long n = f->index;

    if (p->live.restarts != p->restarts)
        warn("%s: frame %llu: frames again", p->camera, n);
    p->restarts = p->live.restarts;
    if (f->track->event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion",
             p->camera, n, f->track->why);
    else if (f->track->event == TRACK_FOUND)
        warn("%s: frame %llu: face found again", p->camera, n);
    animate_report_frame(&p->report, f);
    if (cli.stats)
        animate_report_times(stats_begin, stats_end, f);
    if (most && p->report.frames >= (size_t)most)
        stopped = 1;
}

static void open_output(struct program *p)
{
    struct error err = {0};

    sink_options.path = cli.output;
    sink_options.bt601 = source_options.bt601;
    sink_options.record = FRAMESINK_IMAG;
    sink_options.background = &background;
    if (preview && strcmp(cli.output, "-"))
        die(EX_USAGE, "--preview: not with -o %s (expected one of them)",
            cli.output);
    if (preview)
        sink_options.format = FRAMESINK_TERMINAL;
    else if (!strcmp(cli.output, "-") &&
             sink_options.format == FRAMESINK_AUTO)
        sink_options.format = FRAMESINK_Y4M;
    p->sink = framesink_open(&sink_options, &err);
    if (!p->sink)
        die_error(&err);
}

/* Free everything; when the run has failed its output is given up. */
static int close_all(struct program *p, int rc, struct error *err)
{
    if (rc == 0)
        rc = framesink_finish(p->sink, err);
    else
        framesink_abandon(p->sink);
    p->report.dropped = p->live.dropped;
    if (!cli.quiet && p->report.frames)
        animate_report_print(stderr, &p->report, &p->source,
                             cli.stats != NULL, true);
    animate_release(&p->animate);
    driver_release(&p->driver);
    live_stop(&p->live);
    track_release(&p->track);
    identity_release(&p->mean);
    prepared_release(&p->source);
    animate_report_release(&p->report);
    background_release(&background);
    prepare_release(&models);
    return rc;
}

int main(int argc, char **argv)
{
    static struct program p;
    struct sigaction action = {.sa_handler = stop};
    struct error err = {0};
    int rc, first = cli_parse(&usage, argc, argv);

    if (argc - first != 2)
        die(EX_USAGE, "%d operands (expected SOURCE and CAMERA)",
            argc - first);
    p.camera = argv[first + 1];
    p.report.program = usage.program;
    open_output(&p);
    open_source(&p, argv[first]);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    start_camera(&p);
    rc = find_face(&p, &err);
    if (rc == 0)
        rc = animate_init(&p.animate, &animate_options, &p.source.id,
                          &p.source.baked, &models.dense, &err);
    if (rc == 0)
        rc = animate_run(&p.animate, &p.driver, &p.live, p.sink, frame_done,
                         &p, &err);
    if (rc && stopped && !p.report.frames)      /* nothing was expected */
        err = (struct error){0};
    rc = close_all(&p, rc, &err);
    if (rc && err.code)
        die_error(&err);
    stats_write();
    return 0;
}
