/* spid-live: an avatar that a camera drives, until it is stopped.  Phase B of
 * the paper on the newest frame there is, whatever becomes of the camera. */
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "cmd/options.h"
#include "lib/animate/animation.h"

static struct animation_options opt = {
    .animate.pipeline.precision = OPTION_PRECISION_DEFAULT,
    .framing.background_given = true
};
static struct prepare models;
static double patience = 10;
static long frames;             /* 0: no end */
static bool preview;

static const struct cli_option options[] = {
    OPTIONS_ANIMATION(opt),
    OPTION_FLAG("preview", 'p', &preview, "show it in this terminal"),
    OPTION_CALL("format", 'f', &opt.sink.format, "FORMAT",
                framesink_parse_format,
                FRAMESINK_FORMATS " (default by the name; y4m for a pipe)"),
    OPTION_CALL("background", 'b', &opt.background, "WHAT", background_parse,
                "R,G,B, a name or a picture (default black)"),
    OPTION_FLAG("public", 0, &opt.sink.anyone,
                "-o http://...: other machines may look, too"),
    OPTION_FLOAT("patience", 0, &patience, 0, 1e6, "SECONDS",
                 "wait so long for a source that stops (default 10)"),
    OPTION_INT("frames", 0, &frames, 1, 1e15, "N", "end after so many frames"),
    OPTION_FLAG("relative", 0, &opt.relative,
                "do what the driver does since its first frame, from the "
                "source's rest"),
    {0}
};

static const struct cli_usage usage = {
    "spid-live", "[OPTION ...] SOURCE CAMERA",
    "drive a person's picture by a camera", options
};

struct program {
    const char *camera;         /* its name */
    struct animation animation;
    size_t restarts;            /* told so far */
};

/* Set by a signal, or when there are enough frames. */
static _Atomic bool stopped;

static void live_on_signal(int signal)
{
    (void)signal;
    stopped = 1;
}

/* Where the pictures go: a name, a pipe or this terminal. */
static void live_open_output(struct program *p)
{
    struct error err = {0};
    const bool pipe = strcmp(cli.output, "-") == 0;

    if (preview && !pipe)
        die(EX_USAGE, "--preview: not with -o %s (expected one of them)",
            cli.output);
    if (preview)
        opt.sink.format = FRAMESINK_TERMINAL;
    else if (pipe && opt.sink.format == FRAMESINK_AUTO)
        opt.sink.format = FRAMESINK_Y4M;
    if (animation_open(&p->animation, &opt, &models, cli.output, &err))
        die_error(&err);
    p->animation.report.program = usage.program;
    if (framesink_takes_sound(p->animation.sink))
        notice("%s: without sound: a live picture has none", cli.output);
}

/* The camera, once more; it is opened by its first frame. */
static struct framesource *live_open_camera(void *program, struct error *err)
{
    const struct program *p = program;

    return framesource_open(&p->camera, 1, &opt.source, err);
}

/* It is gone. */
static void live_camera_away(void *program, const struct error *why)
{
    const struct program *p = program;

    if (!stopped)
        warn("%s: no more frames%s%s%s; waiting for them", p->camera,
             why ? " (" : "", why ? why->text : "", why ? ")" : "");
}

/* Phase A, then the camera until there is a face. */
static int live_open_driver(struct program *p, const char *source,
                            struct error *err)
{
    const struct live_follow follow = {
        .open = live_open_camera, .away = live_camera_away, .ctx = p,
        .patience = patience, .stop = &stopped
    };
    struct sigaction action = {.sa_handler = live_on_signal};

    if (animation_open_source(&p->animation, source, NULL, err))
        return -1;
    option_source_tell(source, &p->animation.source.notes);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    return animation_open_camera(&p->animation, p->camera, &follow, err);
}

/* A frame has left: warnings and times; enough of them end the program. */
static void live_frame_done(void *program, const struct animate_frame *f)
{
    struct program *p = program;
    struct animation *a = &p->animation;

    if (a->live.restarts != p->restarts)
        warn("%s: frame %llu: frames again", p->camera,
             (unsigned long long)f->index);
    p->restarts = a->live.restarts;
    option_track_tell(p->camera, f->index, f->track);
    animate_report_frame(&a->report, f);
    if (cli.stats)
        animate_report_times(stats_begin, stats_end, f);
    if (frames && a->report.frames >= (size_t)frames)
        stopped = 1;
}

int main(int argc, char **argv)
{
    static struct program p;
    struct animation *a = &p.animation;
    struct error err = {0};
    int rc, first;

    cli_run_networks();
    first = cli_parse(&usage, argc, argv);
    if (argc - first != 2)
        die(EX_USAGE, "%d operand%s (expected SOURCE and CAMERA)",
            argc - first, plural((unsigned)(argc - first)));
    p.camera = argv[first + 1];
    opt.animate.frames = (uint64_t)frames;
    models.once = true;
    models.soon[0] = argv[first];
    models.soon[1] = p.camera;
    live_open_output(&p);
    option_animation_load(&models, &opt);
    rc = live_open_driver(&p, argv[first], &err);
    if (rc == 0)
        rc = animation_run(a, live_frame_done, &p, &err);
    if (!cli.quiet && a->report.frames)
        animate_report_print(stderr, &a->report, &a->source,
                             cli.stats != NULL, true);
    if (rc && stopped && !a->report.frames)     /* nothing was expected */
        err = (struct error){0};
    animation_close(a);
    background_release(&opt.background);
    prepare_release(&models);
    if (rc && err.code)
        die_error(&err);
    stats_write();
    return 0;
}
