/* spid-synth: synthetic people with their true parameters. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/framesink.h"
#include "lib/head/mesh.h"
#include "lib/head/motion.h"
#include "lib/stream/records.h"
#include "lib/lab/people/scan.h"
#include "lib/lab/people/synth.h"
#include "lib/track/conf.h"

static long people = 1, frames = 1, seed = 1, first, size = 512;
static double fps = 25, effects = 1;
static const char *head_path, *assets_path, *traits_path, *light_path;
static bool without_mesh;

#define SYNTH_TURNS 1000        /* that --turn takes */
#define TURN_MAX 90.0           /* degrees */

static struct {
    struct synth_turn each[SYNTH_TURNS];
    size_t n;
} turns;
static enum framesink_format format = FRAMESINK_AUTO;

/* --without: only meshes can be left out. */
static int synth_parse_without(const char *value, void *dest, struct error *err)
{
    if (strcmp(value, "mesh"))
        return error_set(err, EX_USAGE, "'%s' cannot be left out "
                         "(expected mesh)", value);
    *(bool *)dest = true;
    return 0;
}

/* One angle into radians; *at moves past it. */
static int synth_parse_angle(float *angle, const char **at, struct error *err)
{
    char *end;
    const double degrees = strtod(*at, &end);

    if (end == *at || !(fabs(degrees) <= TURN_MAX))
        return error_set(err, EX_USAGE, "'%s' is no angle (expected -%g to %g "
                         "degrees)", *at, TURN_MAX, TURN_MAX);
    *angle = (float)(degrees * acos(-1) / 180);
    *at = end;
    return 0;
}

/* --turn LIST */
static int synth_parse_turn(const char *text, void *dest, struct error *err)
{
    const char *at = text;

    (void)dest;
    for (turns.n = 0; turns.n < SYNTH_TURNS; at++) {
        struct synth_turn *t = &turns.each[turns.n++];
        float *const next[] = {&t->pitch, &t->roll};

        *t = (struct synth_turn){0};
        if (synth_parse_angle(&t->yaw, &at, err))
            return -1;
        for (int i = 0; i < 2 && *at == ':'; i++) {
            at++;
            if (synth_parse_angle(next[i], &at, err))
                return -1;
        }
        if (!*at)
            return 0;
        if (*at != ',')
            break;
    }
    return error_set(err, EX_USAGE, "'%s' is no list of turns (expected up to "
                     "%d of YAW[:PITCH[:ROLL]], commas between)", text,
                     SYNTH_TURNS);
}

static const struct cli_option options[] = {
    OPTION_INT("people", 'n', &people, 1, 1e9, "N",
               "how many people (default 1)"),
    OPTION_INT("frames", 0, &frames, 1, 1e9, "N",
               "frames of each person (default 1)"),
    OPTION_INT("seed", 's', &seed, 0, 9e15, "N",
               "which people: the same seed, the same bytes (default 1)"),
    OPTION_INT("first", 0, &first, 0, 1e9, "N",
               "number of the first person (default 0)"),
    OPTION_INT("size", 0, &size, SYNTH_SIZE_MIN, SYNTH_SIZE_MAX, "PIXELS",
               "side of the picture (default 512)"),
    OPTION_FLOAT("fps", 0, &fps, 0.01, 1000, "RATE",
                 "frames per second of a person's time (default 25)"),
    OPTION_FLOAT("effects", 0, &effects, 0, 1, "X",
                 "what the camera adds: 0 nothing to 1 everything (default "
                 "1)"),
    OPTION_CALL("turn", 0, NULL, "LIST", synth_parse_turn,
                "YAW[:PITCH[:ROLL]],...: degrees of each frame's head, again "
                "from the first"),
    OPTION_CALL("without", 0, &without_mesh, "mesh", synth_parse_without,
                "leave out the MESH records"),
    OPTION_CALL("format", 0, &format, "NAME", framesink_parse_format,
                FRAMESINK_FORMATS " instead of what -o's name says"),
    OPTION_STRING("assets", 0, &assets_path, "DIR",
                  "people of scans under real light, from this folder, "
                  "in place of a plain figure"),
    OPTION_STRING("light", 0, &light_path, "FILE",
                  "with --assets: all under this panorama"),
    OPTION_STRING("traits", 0, &traits_path, "FILE",
                  "how people look and move, in place of what is built in"),
    OPTION_HEAD(&head_path),
    {0}
};

static const struct cli_usage usage = {
    "spid-synth", "[OPTION ...]",
    "make people: pictures with their true parameters", options
};

/* MOTN, MESH and IMAG of one frame. */
static int synth_write_frame(struct stream_writer *w, const struct head *head,
                             const struct synth_frame *f, uint64_t number,
                             struct error *err)
{
    double time = (double)number / fps;
    float cam[12];
    struct array marks[2] = {
        motion_landmarks(f->lmk),
        motion_points(f->points, LANDMARK_FACE)
    };
    const struct imag picture = {
        .height = (size_t)size, .width = (size_t)size, .rgb = f->rgb,
        .mask = f->mask, .label = f->label, .alone = f->alone
    };

    if (motion_write(w, number, time, f->motion, head->nexp, marks,
                     f->points ? 2 : 1, err))
        return -1;
    motion_camera(cam, f->motion);
    if (f->verts && mesh_write(w, number, time, head, f->verts, cam,
                               number == 0, NULL, 0, err))
        return -1;
    return imag_write(w, number, time, &picture, err);
}

/* Frames into a stream with their truth, or as pictures alone. */
static int synth_write_output(struct framesink *sink, const struct head *head,
                              const struct synth_frame *f, uint64_t number,
                              struct error *err)
{
    struct stream_writer *w = framesink_stream(sink);
    const double time = (double)number / fps;
    const struct framesink_frame picture = {
        .width = (size_t)size, .height = (size_t)size, .channels = 3,
        .rgb = f->rgb, .frame = number, .time = time
    };
    const struct conf conf = {.producer = "spid-synth", .head = head,
                              .size = (size_t)size, .rate = fps,
                              .seed = &seed};
    int32_t who = (int32_t)f->person;
    struct shape shape = {.beta = f->beta, .n = f->nbeta, .person = &who};

    if (!w)
        return framesink_write(sink, &picture, err);
    if ((number == 0 && conf_write(w, &conf, err)) ||
        (f->frame == 0 && shape_write(w, number, time, &shape, err)))
        return -1;
    return synth_write_frame(w, head, f, number, err);
}

/* Every frame of opt into the sink. */
static void synth_write_frames(const struct head *head,
                               struct synth_options *opt)
{
    struct error err = {0};
    struct synth_frame f;
    uint64_t number = 0;
    int rc;
    struct framesink_options out = {
        .path = cli.output, .format = format,
        .rate_num = (int)lrint(fps * 1000), .rate_den = 1000
    };
    struct framesink *sink = framesink_open(&out, &err);

    if (!sink)
        die_error(&err);
    opt->mesh = framesink_stream(sink) && !without_mesh;
    struct synth *s = synth_open(head, opt, &err);
    double begun = stats_begin();
    while ((rc = s ? synth_next(s, &f, &err) : -1) > 0) {
        stats_end("synth", begun);
        if ((rc = synth_write_output(sink, head, &f, number, &err)))
            break;
        progress("frames", ++number, (size_t)(opt->people * opt->frames),
                 NULL);
        begun = stats_begin();
    }
    if (rc < 0) {
        framesink_abandon(sink);
        die_error(&err);
    }
    progress_end();
    synth_close(s);
    if (framesink_finish(sink, &err))
        die_error(&err);
}

int main(int argc, char **argv)
{
    struct head head;

    int operand = cli_parse(&usage, argc, argv);
    if (operand < argc)
        die(EX_USAGE, "%s: nothing is read (expected no operand)",
            argv[operand]);
    if (light_path && !assets_path)
        die(EX_USAGE, "--light: a plain figure has rooms of its own (expected "
            "--assets)");
    struct error err = {0};
    if (option_head_load(&head, head_path, &err))
        die_error(&err);
    struct synth_options opt = {
        .seed = (uint64_t)seed, .first = (uint64_t)first,
        .people = (uint64_t)people, .frames = (uint64_t)frames,
        .size = (int)size, .fps = fps, .effects = (float)effects,
        .turn = turns.each, .turns = turns.n, .traits = traits_path
    };
    struct scan_assets *assets = assets_path
        ? scan_open(assets_path, light_path, traits_path, &head, &err) : NULL;
    if (assets_path && !assets)
        die_error(&err);
    opt.assets = assets;
    synth_write_frames(&head, &opt);
    scan_close(assets);
    head_release(&head);
    stats_write();
    return 0;
}
