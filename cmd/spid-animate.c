/* spid-animate: one picture driven by another's video, the whole pipeline in
 * one process (Phase A, then Phase B of the paper). */
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "cmd/take.h"
#include "lib/animate/animation.h"
#include "lib/animate/joblist.h"

static struct animation_options opt = {
    .animate.pipeline.precision = OPTION_PRECISION_DEFAULT
};
static struct prepare models;
static const char *list_path;
static bool absolute;

/* A colour or a picture, or the word source. */
static int animate_parse_background(const char *value, void *dest,
                                    struct error *err)
{
    opt.framing.background_given = true;
    opt.framing.source_background = strcmp(value, "source") == 0;
    return opt.framing.source_background ? 0
                                         : background_parse(value, dest, err);
}

static const struct cli_option options[] = {
    OPTIONS_ANIMATION(opt),
    OPTION_INT("size", 0, &opt.framing.size, 32, PERSON_MAX, "N",
               "pictures of N by N pixels (default the model's, 512)"),
    OPTION_STRING("list", 0, &list_path, "FILE",
                  "many clips: SOURCE, DRIVER and OUT on each line, tabs "
                  "between"),
    OPTION_CALL("background", 'b', &opt.background, "WHAT",
                animate_parse_background,
                "R,G,B, a name, a picture, or source (a picture's default)"),
    OPTION_FLAG("into-source", 0, &opt.framing.into_source,
                "the driven head in the whole photograph, moving from where "
                "it was"),
    OPTION_FLAG("cut", 0, &opt.framing.cut,
                "leave out what of the window lies outside of the "
                "photograph"),
    OPTION_CALL("format", 'f', &opt.sink.format, "FORMAT",
                framesink_parse_format,
                FRAMESINK_FORMATS " (default by the name)"),
    OPTION_FLAG("alpha", 0, &opt.sink.alpha,
                "keep the background clear (PNG, PAM, EXR, WebM, MOV, GIF, "
                "WebP, APNG, stream)"),
    OPTION_FLAG("no-sound", 0, &opt.no_sound, "leave the driver's sound out"),
    OPTION_FLAG("absolute", 0, &absolute,
                "the driver's own pose and expression, not what it does since "
                "it was neutral"),
    OPTION_NEUTRAL(&opt.neutral),
    {0}
};

static const struct cli_usage usage = {
    "spid-animate", "[OPTION ...] [--list FILE | SOURCE DRIVER]",
    "drive a person's picture by a video", options
};

/* Operands and options that exclude each other. */
static void animate_check_usage(char **operand, int operands)
{
    const struct framing_options *f = &opt.framing;

    if (operands != (list_path ? 0 : 2))
        die(EX_USAGE, "%d operand%s (expected %s)", operands,
            plural((unsigned)operands),
            list_path ? "none with --list" : "SOURCE and DRIVER");
    if (operands == 2 && !strcmp(operand[0], "-") && !strcmp(operand[1], "-"))
        die(EX_USAGE, "-: SOURCE and DRIVER (expected standard input for one "
            "of them)");
    if (absolute && (opt.neutral.given || f->into_source))
        die(EX_USAGE, "--absolute: the driver's own pose (expected no %s)",
            opt.neutral.given ? "--neutral" : "--into-source");
    if (f->into_source && (f->cut || opt.sink.alpha))
        die(EX_USAGE, "--into-source: the whole photograph (expected no %s)",
            opt.sink.alpha ? "--alpha" : "--cut");
    opt.relative = !absolute;
}

/* What is to be said of a source that was read. */
static void animate_report_source(const struct prepared *s, const char *name)
{
    option_source_tell(name, &s->notes);
    if (cli.stats) {
        stats_end("A: shape", stats_begin() - s->shape_s);
        stats_end("A: branches", stats_begin() - s->bake_s);
    }
}

/* A frame has left: warnings, times and the line of progress. */
static void animate_frame_done(void *ctx, const struct animate_frame *f)
{
    struct animation *a = ctx;

    option_track_tell(a->driver_name, f->index, f->track);
    animate_report_frame(&a->report, f);
    if (cli.stats)
        animate_report_times(stats_begin, stats_end, f);
    progress("frames", f->index + 1, a->total, f->track->lost ? "lost" : NULL);
}

/* The lines that are this program. */
static int animate_run_clip(const struct job *job, struct error *err)
{
    static struct animation a;
    int rc = -1;

    if (animation_open(&a, &opt, &models, job->out, err) == 0 &&
        animation_open_source(&a, job->source, job->driver, err) == 0) {
        animate_report_source(&a.source, job->source);
        rc = animation_open_driver(&a, job->driver, err);
        if (rc == 0) {
            option_driver_tell(job->driver, &a.driver, "driver-face");
            rc = animation_run(&a, animate_frame_done, &a, err);
        }
    }
    progress_end();
    if (rc == 0 && !cli.quiet)
        animate_report_print(stderr, &a.report, &a.source,
                             cli.stats != NULL, false);
    if (rc == 0)
        option_animation_done(&a);
    if (a.take)
        take_warn(a.take, job->driver);
    if (a.frames)
        option_damage_tell(job->driver, a.frames);
    animation_close(&a);
    return rc;
}

/* Clips whose output exists are done already. */
static int animate_run_list(void)
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
        if (animate_run_clip(job, &err)) {
            warn("%s: %s", job->out, err.text);
            failed++;
        }
    }
    notice("%zu clips: %zu made, %zu were there, %zu failed", list.count,
           list.count - done - failed, done, failed);
    joblist_release(&list);
    return failed ? EX_DATAERR : 0;
}

int main(int argc, char **argv)
{
    struct error err = {0};
    int rc = 0, first;

    cli_run_networks();
    first = cli_parse(&usage, argc, argv);
    animate_check_usage(argv + first, argc - first);
    models.once = !list_path;
    if (!list_path) {
        models.soon[0] = argv[first];
        models.then = argv[first + 1];
    }
    option_animation_load(&models, &opt);
    if (list_path) {
        rc = animate_run_list();
    } else {
        const struct job job = {argv[first], argv[first + 1], cli.output};

        if (animate_run_clip(&job, &err))
            die_error(&err);
    }
    stats_write();
    background_release(&opt.background);
    prepare_release(&models);
    return rc;
}
