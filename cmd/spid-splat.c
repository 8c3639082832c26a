/* spid-splat: Gaussians in, pictures out.  Eqs. C and G of the paper. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "cmd/options.h"
#include "lib/animate/render.h"
#include "lib/splat/splat.h"
#include "lib/stream/stream.h"

/* --camera: overrides what the stream says. */
struct view_option {
    bool given;
    float rt[12];
};

static struct view_option view;
static long size = 512, channels = 3;
static double focal = 12;
static unsigned branches;
static enum splat_rules rules = SPLAT_GSPLAT;
static bool no_photo, places;
static bool exact, with_depth, covered, imag;
static struct background background;
static bool straight;
static enum framesink_format format = FRAMESINK_AUTO;

/* Twelve numbers, row by row, separated by commas or blanks. */
static int splat_parse_camera(const char *value, void *dest, struct error *err)
{
    struct view_option *v = dest;
    const char *at = value;
    int n = 0;

    while (n < 12) {
        char *end;

        v->rt[n] = strtof(at, &end);
        if (end == at || !isfinite(v->rt[n]))
            break;
        n++;
        at = end + strspn(end, ", \t\n");
    }
    if (n < 12 || *at)
        return error_set(err, EX_USAGE, "%d numbers understood (expected 12: "
                         "the rows of [R|t])", n);
    v->given = true;
    return 0;
}

/* A bit for each branch named. */
static int splat_parse_branches(const char *value, void *dest,
                                struct error *err)
{
    static const char *const names[] = {"dynamic", "static", "mouth", NULL};

    return option_words(dest, value, names, err);
}

static int splat_parse_rules(const char *value, void *dest, struct error *err)
{
    if (!strcmp(value, "gsplat"))
        *(enum splat_rules *)dest = SPLAT_GSPLAT;
    else if (!strcmp(value, "dgr"))
        *(enum splat_rules *)dest = SPLAT_DGR;
    else
        return error_set(err, EX_USAGE, "no such rules (expected gsplat or "
                         "dgr)");
    return 0;
}

static const struct cli_option options[] = {
    OPTION_INT("size", 's', &size, 1, SPLAT_MAX_SIZE, "N",
               "draw N x N pixels (512)"),
    OPTION_INT("channels", 'c', &channels, 1, SPLAT_MAX_CHANNELS, "N",
               "draw the first N colour channels (3)"),
    OPTION_CALL("camera", 0, &view, "LIST", splat_parse_camera,
                "12 numbers, the rows of [R|t], instead of the stream's"),
    OPTION_FLOAT("focal", 0, &focal, 1e-3, 1e6, "F",
                 "focal length in half pictures (12)"),
    OPTION_CALL("branch", 0, &branches, "LIST", splat_parse_branches,
                "only these: dynamic,static,mouth"),
    OPTION_CALL("format", 'f', &format, "NAME", framesink_parse_format,
                FRAMESINK_FORMATS " (by the name)"),
    OPTION_CALL("background", 'b', &background, "R,G,B|FILE", background_parse,
                "behind the pictures (black)"),
    OPTION_FLAG("alpha", 0, &straight,
                "pictures with straight alpha, no background"),
    OPTION_FLAG("depth", 0, &with_depth, "write depth too (stream and exr)"),
    OPTION_FLAG("covered", 0, &covered,
                "FEAT without the pixels that nothing covers"),
    OPTION_FLAG("imag", 0, &imag,
                "stream: finished IMAG records instead of FEAT"),
    OPTION_FLAG("exact", 0, &exact,
                "double precision without cut-offs: slow, the truth"),
    OPTION_CALL("rules", 0, &rules, "NAME", splat_parse_rules,
                "gsplat, or dgr: as the public CUDA rasteriser"),
    OPTION_FLAG("no-photo", 0, &no_photo,
                "baked colours alone, no photograph as texture"),
    OPTION_FLAG("places", 0, &places,
                "FEAT with blended places, for spid-refine --size"),
    {0}
};

static const struct cli_usage usage = {
    "spid-splat", "[OPTION ...] [STREAM]",
    "draw Gaussians", options
};

/* Features for a refiner travel as they are multiplied, in 16 bits; the truth
 * stays float. */
static bool splat_half_features(void)
{
    return channels > SPLAT_COLORS && !exact;
}

/* Where frames go; pictures need their colours. */
static struct framesink *splat_open_sink(void)
{
    struct error err = {0};
    struct framesink *sink = framesink_open(&(struct framesink_options){
        .path = cli.output, .format = format, .alpha = straight,
        .covered = covered, .background = &background,
        .record = imag ? FRAMESINK_IMAG
                       : splat_half_features() ? FRAMESINK_FEAT_F16
                                               : FRAMESINK_FEAT_F32
    }, &err);

    if (!sink)
        die_error(&err);
    if (channels < 3 && (imag || !framesink_stream(sink)))
        die(EX_USAGE, "--channels=%ld: a picture has colours (expected 3 or "
            "more)", channels);
    return sink;
}

static void splat_open_renderer(struct render *r, struct framesink *sink)
{
    struct render_options o = {
        .splat = splat_defaults((int)size, (int)size, (int)channels),
        .focal = (float)focal, .camera = view.given ? view.rt : NULL,
        .exact = exact, .features = framesink_stream(sink) && !imag,
        .half = splat_half_features(), .places = places, .begin = stats_begin,
        .end = stats_end};
    struct error err = {0};

    o.splat.rules = rules;
    o.splat.depth = with_depth;
    o.splat.covered = covered && o.features;
    o.splat.branches = branches;
    o.splat.place = !exact && !no_photo;
    if (render_init(r, &o, sink, &err))
        die_error(&err);
}

/* One record of the input. */
static int splat_take(const struct record *rec, void *render,
                      struct error *err)
{
    return render_record(render, rec, err);
}

int main(int argc, char **argv)
{
    struct render r;
    struct error err = {0};
    int rc, first = cli_parse_stage(&usage, argc, argv, false);

    struct stream_reader *in =
        stream_open(cli_stream_operand(first, argc, argv), NULL, &err);

    if (!in)
        die_error(&err);
    struct framesink *sink = splat_open_sink();

    splat_open_renderer(&r, sink);
    rc = stream_each(in, splat_take, &r, &err);
    if (rc == 0)
        rc = render_finish(&r, &err);
    if (rc < 0) {               /* no END: the next program knows */
        struct error late;

        /* but it gets what was drawn before */
        async_write_wait(&r.writing, &late);
        framesink_abandon(sink);
        die_error(&err);
    }
    option_sound_tell(sink);
    if (framesink_finish(sink, &err))
        die_error(&err);
    stats_write();
    stream_close(in);
    render_release(&r);
    background_release(&background);
    return 0;
}
