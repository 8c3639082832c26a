/* spid-motion: frames in, motion parameters out.  Phase B of the paper up to
 * Theta_d: crop, E_m and its six heads (Eqs. rot to eye). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/framesink.h"
#include "formats/framesource.h"
#include "lib/record/person.h"
#include "lib/stream/stream.h"
#include "lib/track/conf.h"
#include "lib/track/driver.h"
#include "lib/track/encoders.h"
#include "lib/track/overlay.h"

static struct framesource_options source_options;
static struct track_options track_options;
static const char *head_path, *identity_path, *overlay_path, *relative_path;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

static const struct cli_option options[] = {
    OPTION_CROP(&track_options,
                "fixed face crop: centre and side in pixels of the frame"),
    OPTION_WINDOW(&track_options,
                  "portrait window (default: about the first face)"),
    OPTION_FLOAT("smooth", 0, &track_options.smooth, 0, 100, "HZ",
                 "one-euro smoothing with this cut-off at rest (default 0: "
                 "off)"),
    OPTION_NO_TTA(&track_options.no_tta),
    OPTION_STRING("relative", 0, &relative_path, "FILE",
                  "movements since the first frame, from this identity's "
                  "own"),
    OPTION_STRING("overlay", 0, &overlay_path, "FILE",
                  "write a video of crop, landmarks and mesh on the frames"),
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
    "spid-motion",
    "[--crop X,Y,SIZE] [--window X,Y,SIZE] [--smooth HZ] [--no-tta] "
    "[--relative FILE] [--overlay FILE] [--fps RATE] [--bt601] [-i FILE] "
    "[--head FILE] [--precision TYPE] [-o FILE] [-j N] [-m MODEL] [-q] "
    "[--stats FILE] [INPUT...]",
    "estimate head motion from video, pictures or piped frames", options};

struct program {
    struct head head;
    struct person person;
    struct identity id;
    struct model model;
    struct encoders nets;
    struct track track;
    struct framesource *in;
    struct driver driver;
    struct stream_writer *out;
    struct overlay overlay;
    struct framesink *drawn;    /* NULL without --overlay */
    uint64_t drawn_frames;
    size_t lost;
};

/* Model, head and whose shape it has. */
static void open_model(struct program *p)
{
    struct error err = {0};

    if (option_model_open(&p->model, &err)
        || option_head_load(&p->head, head_path, &err)
        || encoders_open(&p->nets, &p->model, false, precision, &err)
        || (identity_path && person_load(&p->person, identity_path,
                                         p->head.nexp, &err))
        || person_fold(&p->id, &p->head, &p->person, &err))
        die_error(&err);
    track_options.size = (double)p->model.config.size;
}

/* Frames and tracker. */
static void open_input(struct program *p, char **name, int count)
{
    static const char *const standard_input[] = {"-"};
    struct error err = {0};

    p->in = framesource_open(count ? (const char *const *)name
                                   : standard_input,
                             count ? (size_t)count : 1, &source_options,
                             &err);
    if (!p->in || track_init(&p->track, &p->id, &p->nets.motion,
                             &track_options, &err))
        die_error(&err);
    driver_init(&p->driver, &p->track, driver_read_source, p->in);
}

/* The stream, and the video of --overlay. */
static void open_output(struct program *p)
{
    struct error err = {0};

    p->out = stream_create(cli.output, &err);
    if (!p->out)
        die_error(&err);
    if (!overlay_path)
        return;
    p->drawn = framesink_open(&(struct framesink_options){
        .path = overlay_path, .format = FRAMESINK_AUTO
    }, &err);
    if (p->drawn && framesink_stream(p->drawn))
        die(EX_USAGE, "--overlay=%s: not a name of a video or pictures "
            "(expected .mp4, .y4m, .png with %%05d)", overlay_path);
    if (!p->drawn || overlay_init(&p->overlay, &p->id, &err))
        die_error(&err);
}

/* Draw one frame; r is NULL for a frame before the first face. */
static void draw_overlay(struct program *p, const struct frame *f,
                         const struct track_result *r)
{
    struct error err = {0};
    struct framesink_frame g = {.width = f->width, .height = f->height,
                                .frame = p->drawn_frames++, .time = f->time};
    double begun = stats_begin();
    char text[80];

    snprintf(text, sizeof text, "%llu  %.2f s%s",
             (unsigned long long)f->index, f->time,
             !r ? "  no face yet" : r->lost ? "  lost" : "");
    if (g.frame == 0) {
        int num, den;
        framesource_rate(p->in, &num, &den);
        framesink_set_rate(p->drawn, num, den);
    }
    g.rgb = overlay_draw(&p->overlay, f->rgb, f->width, f->height,
                         r ? &r->motion : NULL, r && r->lost,
                         p->track.window, track_options.size, text);
    if (!g.rgb)
        die(EX_OSERR, "no memory for the overlay");
    if (framesink_write(p->drawn, &g, &err))
        die_error(&err);
    stats_end("overlay", begun);
}

/* A frame in which the face was looked for in vain. */
static void draw_searched_frame(void *program, const struct frame *f)
{
    struct program *p = program;

    if (p->drawn)
        draw_overlay(p, f, NULL);
}

/* --relative: the driver's movements, from that person's own motion. */
static void set_relative(struct program *p)
{
    struct person source = {0};
    struct error err = {0};

    if (person_load(&source, relative_path, p->head.nexp, &err))
        die_error(&err);
    if (!source.has_source)
        die(EX_DATAERR, "--relative=%s: no MOTN record (expected an "
            "identity, as spid-shape writes it)", relative_path);
    driver_set_relative(&p->driver, &source.source, p->head.nexp);
    person_release(&source);
}

/* Find the first face, then write CONF: it holds the window. */
static void start_tracking(struct program *p)
{
    struct error err = {0};
    double begun = stats_begin();
    enum driver_status status;
    struct conf conf = {
        .producer = "spid-motion", .head = &p->head,
        .model = &p->model
    };

    status = driver_start(&p->driver, draw_searched_frame, p, &err);
    if (status != DRIVER_STARTED) {
        stream_abandon(p->out);
        framesink_abandon(p->drawn);
        if (status == DRIVER_NO_FACE)
            error_prefix(&err, "%s", framesource_name(p->in));
        die_error(&err);
    }
    stats_end("start", begun);
    if (relative_path)
        set_relative(p);
    framesource_rate(p->in, &conf.fps_num, &conf.fps_den);
    conf.window = &p->track.window;
    conf.width = p->driver.first.width;
    conf.height = p->driver.first.height;
    if (conf_write(p->out, &conf, &err))
        die_error(&err);
    if (p->driver.early_count)
        warn("%s: no face in the first %zu frames: they take the motion of "
             "frame %zu", framesource_name(p->in), p->driver.early_count,
             p->driver.early_count);
}

/* Say when the face is lost and found again. */
static void report_frame(struct program *p, const struct driver_frame *f)
{
    const unsigned long long n = f->picture.index;

    if (f->r.event == TRACK_LOST)
        warn("%s: frame %llu: face lost (%s); holding the last motion",
             framesource_name(p->in), n, f->r.why);
    else if (f->r.event == TRACK_FOUND)
        warn("%s: frame %llu: face found again",
             framesource_name(p->in), n);
    p->lost += f->r.lost;
}

/* For --stats. */
static void count_times(const struct driver_frame *f)
{
    const double now = stats_begin();

    stats_end("decode", now - f->decode_s);
    stats_end("crop", now - f->r.crop_s);
    stats_end("network", now - f->r.network_s);
    stats_end("heads", now - f->r.heads_s);
    if (f->r.detect_s > 0)
        stats_end("detect", now - f->r.detect_s);
}

/* MOTN: Theta_d of one frame. */
static int write_motion(struct program *p, const struct driver_frame *f,
                        struct error *err)
{
    static const uint8_t one = 1;
    struct array lost = array_make("lost", DTYPE_U8, &one, 1, 1, 0, 0, 0);
    double begun = stats_begin();
    int rc = motion_write(p->out, f->picture.index, f->picture.time,
                          &f->r.motion, p->head.nexp, &lost, f->r.lost, err);

    stats_end("encode", begun);
    return rc;
}

/* Complete both outputs, or give them up. */
static int finish_outputs(struct program *p, int rc, struct error *err)
{
    progress_end();
    if (p->drawn && rc == 0) {
        rc = framesink_finish(p->drawn, err);
        p->drawn = NULL;
    }
    if (rc < 0) {               /* no END: the next program knows */
        stream_abandon(p->out);
        if (p->drawn)
            framesink_finish(p->drawn, NULL);
        die_error(err);
    }
    if (stream_finish(p->out, err))
        die_error(err);
    if (p->lost)
        warn("%s: no face in %zu frames in all", framesource_name(p->in),
             p->lost);
    if (framesource_damaged(p->in))
        warn("%zu pictures are damaged or cut short: what is missing is grey",
             framesource_damaged(p->in));
    return 0;
}

int main(int argc, char **argv)
{
    static struct program p;
    struct driver_frame f;
    struct error err = {0};
    int rc;

    int first = cli_parse_stage(&usage, argc, argv, false);
    open_model(&p);
    open_input(&p, argv + first, argc - first);
    open_output(&p);
    start_tracking(&p);
    while ((rc = driver_next(&p.driver, &f, &err)) > 0) {
        report_frame(&p, &f);
        count_times(&f);
        if (write_motion(&p, &f, &err)) {
            rc = -1;
            break;
        }
        if (p.drawn && f.picture.rgb)
            draw_overlay(&p, &f.picture, &f.r);
        progress("frames", f.picture.index + 1, framesource_total(p.in),
                 f.r.lost ? "lost" : NULL);
    }
    finish_outputs(&p, rc, &err);
    stats_write();
    driver_release(&p.driver);
    track_release(&p.track);
    encoders_release(&p.nets);
    model_close(&p.model);
    overlay_release(&p.overlay);
    framesource_close(p.in);
    identity_release(&p.id);
    person_release(&p.person);
    head_release(&p.head);
    return 0;
}
