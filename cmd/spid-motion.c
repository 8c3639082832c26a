/* spid-motion: frames in, motion parameters out.  Phase B of the paper up to
 * Theta_d: crop, E_m and its six heads (Eqs. rot to eye). */
#include <string.h>

#include "cmd/motion_output.h"
#include "cmd/options.h"
#include "cmd/take.h"
#include "formats/framesource.h"
#include "formats/module.h"
#include "lib/head/person.h"
#include "lib/track/conf.h"
#include "lib/track/driver.h"
#include "lib/track/encoders.h"
#include "lib/track/neutral.h"

static struct framesource_options source_options;
static struct track_options track_options;
static const char *head_path, *identity_path, *overlay_path, *relative_path;
static struct neutral neutral;
static bool with_light;
static const char *take_path, *stream_path;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

static const struct cli_option options[] = {
    OPTION_CROP(&track_options,
                "fixed face crop: centre and side in pixels of the frame"),
    OPTION_FACE("face", &track_options.face, "the first frame that shows it"),
    OPTION_WINDOW(&track_options,
                  "portrait window (default: about the first face)"),
    OPTION_FLOAT("smooth", 0, &track_options.smooth, 0, 100, "HZ",
                 "one-euro smoothing with this cut-off at rest (default 0: "
                 "off)"),
    OPTION_NO_TTA(&track_options.no_tta),
    OPTION_FLAG("light", 0, &with_light,
                "the first motion says the light on its face, too"),
    OPTION_FLAG("no-align", 0, &track_options.no_align,
                "poses as the encoder says them, not aligned with earlier "
                "frames"),
    OPTION_STRING("relative", 0, &relative_path, "FILE",
                  "movements since the neutral frame, from this identity's "
                  "own"),
    OPTION_NEUTRAL(&neutral),
    OPTION_OUTPUT("overlay", 0, &overlay_path, "FILE",
                  "write a video of crop, landmarks and mesh on the frames"),
    OPTION_OUTPUT("arkit", 0, &take_path, "FILE",
                  "write a take of Live Link Face (CSV), and no stream "
                  "without -o"),
    OPTION_OUTPUT("output", 'o', &stream_path, "FILE",
                  "write to FILE (\"-\": standard output, the default)"),
    OPTION_FLOAT("fps", 0, &source_options.rate, 0.001, 100000, "RATE",
                 "frames a second of pictures without times (default 25)"),
    OPTION_FLAG("bt601", 0, &source_options.bt601,
                "Y4M and video files are BT.601, whatever they say"),
    OPTION_STRING("identity", 'i', &identity_path, "FILE",
                  "shape of the driver, for crop and overlay (default: mean)"),
    OPTION_HEAD(&head_path),
    OPTION_PRECISION(&precision, "network"),
    {0}
};

static const struct cli_usage usage = {
    "spid-motion", "[OPTION ...] [INPUT...]",
    "estimate head motion from video, pictures or piped frames", options};

struct program {
    struct head head;
    struct person person;
    struct identity id;
    struct model model;
    struct encoders nets;
    struct track track;
    const char *const *name;    /* of the inputs */
    size_t names;
    struct framesource *in;
    struct driver driver;
    struct motion_output out;
    size_t lost;
};

/* Model, head and whose shape it has. */
static void motion_open_model(struct program *p)
{
    struct error err = {0};

    if (option_model_open(&p->model, &err)
        || option_head_load(&p->head, head_path, &err)
        || encoders_open(&p->nets, &p->model, false, precision, &err)
        || (identity_path && person_load(&p->person, identity_path,
                                         p->head.nexp, &err))
        || person_fold(&p->id, &p->head, &p->person, &err))
        die_error(&err);
    if (take_path && take_check_head(&p->head, &err))
        die_error(&err);
    track_options.size = (double)p->model.config.size;
}

/* Frames and tracker. */
static void motion_open_input(struct program *p, char **name, int count)
{
    static const char *const standard_input[] = {"-"};
    struct error err = {0};

    p->name = count ? (const char *const *)name : standard_input;
    p->names = count ? (size_t)count : 1;
    p->in = framesource_open(p->name, p->names, &source_options, &err);
    if (!p->in || track_init(&p->track, &p->id, &p->nets.motion,
                             &track_options, &err))
        die_error(&err);
    driver_init(&p->driver, &p->track, driver_read_source, p->in);
    if (with_light)
        p->driver.light = &p->nets.light;
}

/* The program ends; of what it began to write whole frames stay. */
static void __attribute__((noreturn)) motion_give_up(struct program *p,
                                                     const struct error *err)
{
    motion_output_abandon(&p->out);
    die_error(err);
}

/* Draw one frame; r is NULL for a frame before the first face. */
static void motion_draw_overlay(struct program *p, const struct frame *f,
                                const struct track_result *r)
{
    struct error err = {0};
    int num, den;

    framesource_rate(p->in, &num, &den);
    if (motion_output_draw(&p->out, f, r, &p->track.window,
                           track_options.size, num, den, &err))
        motion_give_up(p, &err);
}

/* A frame in which the face was looked for in vain. */
static void motion_draw_searched_frame(void *program, const struct frame *f)
{
    struct program *p = program;

    if (p->out.drawn)
        motion_draw_overlay(p, f, NULL);
}

/* --neutral: looked for before anything is written. */
static void motion_find_neutral(struct program *p, struct motion *rest)
{
    const struct neutral_clip clip = {
        p->name, p->names, &source_options, &track_options, &p->id,
        &p->nets.motion, p->head.nexp
    };
    struct error err = {0};

    if (neutral_find(rest, &neutral, &clip, &err))
        motion_give_up(p, &err);
}

/* --relative: the driver's movements, from that person's own motion. */
static void motion_set_relative(struct program *p)
{
    struct person source = {0};
    struct motion rest;
    struct error err = {0};

    if (person_load(&source, relative_path, p->head.nexp, &err))
        motion_give_up(p, &err);
    if (!source.has_source) {
        error_set(&err, EX_DATAERR, "--relative=%s: no MOTN record (expected "
                  "an identity, as spid-shape writes it)", relative_path);
        motion_give_up(p, &err);
    }
    if (neutral.given)
        motion_find_neutral(p, &rest);
    driver_set_relative(&p->driver, &source.calm,
                        neutral.given ? &rest : NULL, p->head.nexp);
    person_release(&source);
}

/* Find the first face, then write CONF: it holds the window. */
static void motion_start_tracking(struct program *p)
{
    struct error err = {0};
    double begun = stats_begin();
    struct conf conf = {
        .producer = "spid-motion", .head = &p->head, .model = &p->model
    };

    if (driver_start(&p->driver, p->name[0], motion_draw_searched_frame, p,
                     &err))
        motion_give_up(p, &err);
    stats_end("start", begun);
    if (relative_path)
        motion_set_relative(p);
    framesource_rate(p->in, &conf.fps_num, &conf.fps_den);
    conf.sound = framesource_sound(p->in, &conf.sound_start);
    conf.window = &p->track.window;
    conf.width = p->driver.first.width;
    conf.height = p->driver.first.height;
    if (motion_output_begin(&p->out, &conf, take_path, &err))
        motion_give_up(p, &err);
    option_driver_tell(framesource_name(p->in), &p->driver, "face");
}

/* For --stats. */
static void motion_count_times(const struct driver_frame *f)
{
    const double now = stats_begin();

    stats_end("decode", now - f->decode_s);
    stats_end("crop", now - f->r.crop_s);
    stats_end("network", now - f->r.network_s);
    stats_end("heads", now - f->r.heads_s);
    if (f->r.detect_s > 0)
        stats_end("detect", now - f->r.detect_s);
}

/* What is to be said about a clip that has been read. */
static void motion_report_clip(const struct program *p)
{
    if (p->lost)
        warn("%s: no face in %zu frame%s in all", framesource_name(p->in),
             p->lost, plural(p->lost));
    option_damage_tell(framesource_name(p->in), p->in);
}

static void motion_release(struct program *p)
{
    driver_release(&p->driver);
    track_release(&p->track);
    encoders_release(&p->nets);
    model_close(&p->model);
    framesource_close(p->in);
    identity_release(&p->id);
    person_release(&p->person);
    head_release(&p->head);
}

int main(int argc, char **argv)
{
    static struct program p;
    struct driver_frame f;
    struct error err = {0};
    int rc;

    int first = cli_parse_stage(&usage, argc, argv, false);
    if (neutral.given && !relative_path)
        die(EX_USAGE, "--neutral: relative to whom (expected --relative "
            "FILE)");
    module_preload((const char *const *)argv + first,
                   (size_t)(argc - first));
    motion_open_model(&p);
    motion_open_input(&p, argv + first, argc - first);
    if (motion_output_open(&p.out, stream_path, take_path, overlay_path,
                           &p.id, &err))
        motion_give_up(&p, &err);
    motion_start_tracking(&p);
    while ((rc = driver_next(&p.driver, &f, &err)) > 0) {
        option_track_tell(framesource_name(p.in), f.picture.index, &f.r);
        p.lost += f.r.lost;
        motion_count_times(&f);
        if (motion_output_write(&p.out, &f, p.head.nexp, &err)) {
            rc = -1;
            break;
        }
        if (p.out.drawn && f.picture.rgb)
            motion_draw_overlay(&p, &f.picture, &f.r);
        progress("frames", f.picture.index + 1, framesource_total(p.in),
                 f.r.lost ? "lost" : NULL);
    }
    progress_end();
    if (motion_output_close(&p.out, rc, &err))
        die_error(&err);
    motion_report_clip(&p);
    stats_write();
    motion_release(&p);
    return 0;
}
