/* spid-refine: splatted features in, finished pictures out.  Eq. SR. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/framesink.h"
#include "lib/refine/refine.h"
#include "lib/stream/ahead.h"
#include "lib/record/person.h"
#include "lib/texture/texture.h"
#include "lib/texture/zoom.h"

static enum nn_type precision = OPTION_PRECISION_DEFAULT;
static struct framesink_options sink_options;
static struct background background;
static const char *background_text, *identity_path;
static double fps;
static bool roi;
static long size;

static const struct cli_option options[] = {
    OPTION_PRECISION_REFINE(&precision, "network"),
    {"roi", 0, CLI_FLAG, &roi, 0, 0, NULL,
     "refine only the part of the picture where the head is", NULL},
    {"size", 0, CLI_INT, &size, 1, PERSON_LARGEST, "N",
     "pictures of N by N pixels (default FEAT's size)", NULL},
    {"format", 0, CLI_CALL, &sink_options.format, 0, 0, "FORMAT",
     "stream, y4m, png, pam, exr or mp4 (default by the output's name)",
     framesink_parse_format},
    {"background", 0, CLI_STRING, &background_text, 0, 0, "WHAT",
     "R,G,B, #RRGGBB, a name, a picture, or source (default black)", NULL},
    {"identity", 'i', CLI_STRING, &identity_path, 0, 0, "FILE",
     "identity whose picture --background source means", NULL},
    {"alpha", 0, CLI_FLAG, &sink_options.alpha, 0, 0, NULL,
     "keep transparency: straight RGBA (png, pam, exr, stream)", NULL},
    {"fps", 0, CLI_FLOAT, &fps, 0.001, 100000, "RATE",
     "frames a second of y4m and mp4 (default CONF's, else 25)", NULL},
    {"bt601", 0, CLI_FLAG, &sink_options.bt601, 0, 0, NULL,
     "write Y4M in BT.601 (default BT.709)", NULL},
    {0}
};

static const struct cli_usage usage = {
    "spid-refine", "[--precision TYPE] [--roi] [--size N] [--format FORMAT] "
    "[--background WHAT] [-i FILE] [--alpha] [--fps RATE] [--bt601] "
    "[-o FILE] [-j N] [-m MODEL] [-q] [--stats FILE] [STREAM]",
    "refine splatted feature images into pictures", options
};

struct program {
    struct model model;
    struct refine refine;
    struct stream_reader *in;
    struct ahead *ahead;
    struct framesink *out;
    float *rgb, *alpha;
    size_t room;                /* pixels in rgb and alpha */
    struct person person;       /* whose photograph, from SRCI */
    struct texture texture;     /* no levels: none */
    struct zoom zoom;           /* to --size */
    bool compared;
};

/* The model's refiner. */
static void open_model(struct program *p)
{
    struct error err = {0};

    if (option_model_open(&p->model, &err)
        || refine_open(&p->refine, &p->model, precision, roi, &err))
        die_error(&err);
}

/* What is put behind the head. */
static void open_background(void)
{
    struct error err = {0};
    int rc = 0;

    if (!background_text)
        return;
    if (strcmp(background_text, "source") != 0) {
        rc = background_parse(background_text, &background, &err);
    } else if (!identity_path) {
        die(EX_USAGE, "--background=source: whose picture (expected "
            "-i FILE)");
    } else {
        rc = background_from_identity(&background, identity_path, &err);
    }
    if (rc) {
        error_prefix(&err, "--background=%s", background_text);
        die_error(&err);
    }
}

/* Input read ahead, and the output. */
static void open_streams(struct program *p, const char *input)
{
    struct error err = {0};

    p->in = stream_open(input, &(struct stream_options){.pair = true}, &err);
    if (!p->in)
        die_error(&err);
    sink_options.path = cli.output;
    sink_options.background = &background;
    if (fps > 0) {
        sink_options.rate_num = (int)lrint(fps * 1000);
        sink_options.rate_den = 1000;
    }
    p->out = framesink_open(&sink_options, &err);
    if (!p->out)
        die_error(&err);
    p->ahead = ahead_open(p->in, &err);
    if (!p->ahead)
        die_error(&err);
}

/* Features that came without the pixels that nothing covers are taken as the
 * whole picture they stand for. */
static int check_size(const struct array *feat, const struct array *alpha,
                      struct error *err)
{
    const size_t n = array_count(alpha);
    const size_t bytes = feat->dim[1] * dtype_size(feat->dtype);

    if (n > SIZE_MAX / (bytes + 1) || n * bytes > stream_limit())
        return error_set(err, EX_DATAERR, "FEAT feat of %zu x %zu pixels is "
                         "larger than --max-bytes", alpha->dim[1],
                         alpha->dim[0]);
    return 0;
}

/* Where the photograph is looked up. */
static int take_places(struct refine_input *in, const struct record *rec,
                       const struct array *alpha, struct error *err)
{
    const size_t numbers[1] = {6};
    const float *map = record_get(rec, "map", DTYPE_F32, 1, numbers, err);

    if (!map || !alpha ||
        !(in->place = record_get(rec, "place", DTYPE_F32, 3,
                                 (size_t[]){alpha->dim[0], alpha->dim[1],
                                            PLACE_CHANNELS}, err)))
        return -1;
    memcpy(in->view.A, map, sizeof in->view.A);
    memcpy(in->view.b, map + 4, sizeof in->view.b);
    return 0;
}

/* The arrays of a FEAT record. */
static int take_features(struct refine_input *in, const struct record *rec,
                         struct error *err)
{
    const struct array *a = record_find(rec, "feat");
    const struct array *alpha = record_find(rec, "alpha");
    const enum dtype type = a && a->dtype == DTYPE_F16 ? DTYPE_F16
                                                       : DTYPE_F32;
    const bool packed = a && a->ndim == 2 && alpha;
    const size_t any[3] = {0, 0, 0}, turns[1] = {RELATIVE_POSE_SIZE};
    const void *feat = record_get(rec, "feat", type, packed ? 2 : 3, any, err);

    memset(in, 0, sizeof *in);
    if (!feat
        || (alpha && !(in->alpha = record_get(rec, "alpha", DTYPE_F32, 2,
                                              packed ? any : a->dim, err)))
        || record_check_finite(rec, err)
        || (packed && check_size(a, alpha, err)))
        return -1;
    if (record_find(rec, "turn")
        && !(in->turn = record_get(rec, "turn", DTYPE_F32, 1, turns, err)))
        return -1;
    if (record_find(rec, "photo") && !alpha)
        return error_set(err, EX_DATAERR, "FEAT has photo without alpha");
    if (record_find(rec, "photo")
        && !(in->photo = record_get(rec, "photo", DTYPE_F32, packed ? 2 : 3,
                                    (size_t[]){packed ? a->dim[0]
                                                      : alpha->dim[0],
                                               packed ? TEXTURE_PHOTO
                                                      : alpha->dim[1],
                                               TEXTURE_PHOTO}, err)))
        return -1;
    if (record_find(rec, "place") && take_places(in, rec, alpha, err))
        return -1;
    in->f16 = type == DTYPE_F16 ? feat : NULL;
    in->f32 = type == DTYPE_F32 ? feat : NULL;
    in->height = packed ? alpha->dim[0] : a->dim[0];
    in->width = packed ? alpha->dim[1] : a->dim[1];
    in->channels = a->dim[a->ndim - 1];
    in->packed = packed;
    in->pixels = packed ? a->dim[0] : 0;
    return 0;
}

/* What --precision and --roi cost, on the first frame. */
static void compare_precision(const struct program *p,
                              const struct refine_input *in)
{
    const size_t n = in->height * in->width * 3;
    struct error err = {0};
    struct refine full;
    float *want = malloc(n * sizeof *want);
    double most = 0, square = 0;

    if (!want || refine_open(&full, &p->model, NN_F32, false, &err)
        || refine_frame(want, &full, in, &err)) {
        free(want);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        double a = fmin(1, fmax(0, want[i])), b = fmin(1, fmax(0, p->rgb[i]));
        most = fmax(most, fabs(a - b));
        square += (a - b) * (a - b);
    }
    square /= (double)n;
    if (!cli.quiet)
        fprintf(stderr, "%s: %s%s, %zu x %zu of %zu x %zu pixels refined: "
                "largest error %.2g, %.1f dB against all of it in f32 (first "
                "frame)\n", cli.program, nn_type_name(precision),
                roi ? ", --roi" : "", p->refine.plan.width,
                p->refine.plan.height, in->width, in->height, most,
                square > 0 ? -10 * log10(square) : INFINITY);
    refine_release(&full);
    free(want);
}

/* What is refined, enlarged, with the photograph. */
static int enlarge(struct framesink_frame *f, struct program *p,
                   const struct refine_input *in, struct error *err)
{
    struct zoom *z = &p->zoom;
    const bool photo = in->place && p->texture.levels;

    if (in->height != in->width || in->height > (size_t)size || !in->alpha)
        return error_set(err, EX_DATAERR, "FEAT of %zu x %zu pixels%s "
                         "(expected a square of at most --size=%ld, with "
                         "alpha)", in->width, in->height,
                         in->alpha ? "" : " without alpha", size);
    if (z->from != in->width) {
        zoom_release(z);
        if (zoom_init(z, in->width, (size_t)size, true, err))
            return -1;
    }
    texture_hold(p->rgb, 3, in->alpha, in->height * in->width);
    zoom_picture(z, p->rgb, in->alpha, photo ? in->place : NULL, &in->view,
                 &p->texture);
    f->height = f->width = z->to;
    f->color = z->color;
    f->alpha = z->alpha;
    return 0;
}

/* The photograph over what was refined, at the picture's size. */
static int show_photo(struct framesink_frame *f, struct program *p,
                      const struct refine_input *in, struct error *err)
{
    if (size && (size_t)size != in->width)
        return enlarge(f, p, in, err);
    if (in->alpha) {
        memcpy(p->alpha, in->alpha,
               in->height * in->width * sizeof *p->alpha);
        if (refine_photo(p->rgb, p->alpha, &p->refine, in, err))
            return -1;
    }
    f->height = in->height;
    f->width = in->width;
    f->color = p->rgb;
    f->alpha = in->alpha ? p->alpha : NULL;
    return 0;
}

/* The photograph that places are places of. */
static int take_photo(struct program *p, const struct record *rec,
                      struct error *err)
{
    if (person_take(&p->person, rec, 0, err) < 0)
        return -1;
    texture_release(&p->texture);
    return p->person.back
         ? texture_init(&p->texture, p->person.rgb, p->person.matte,
                        p->person.back, p->person.size, err) : 0;
}

/* The line that is this program: I' = SR(F). */
static int write_picture(struct program *p, const struct record *rec,
                         struct error *err)
{
    struct refine_input in;
    struct framesink_frame f = {
        .channels = 3, .frame = rec->frame, .time = rec->time
    };
    double begun;

    if (take_features(&in, rec, err))
        return -1;
    if (in.height * in.width > p->room) {
        free(p->rgb);
        free(p->alpha);
        p->room = in.height * in.width;
        p->rgb = malloc(3 * p->room * sizeof *p->rgb);
        p->alpha = malloc(p->room * sizeof *p->alpha);
        if (!p->rgb || !p->alpha)
            return error_set(err, EX_OSERR, "no memory for %zu x %zu pixels",
                             in.width, in.height);
    }
    begun = stats_begin();
    if (refine_frame(p->rgb, &p->refine, &in, err))
        return -1;
    stats_end("refine", begun);
    if (!p->compared && (roi || precision == NN_BF16
                         || precision == NN_INT8))
        compare_precision(p, &in);
    p->compared = true;
    if (show_photo(&f, p, &in, err))
        return -1;
    begun = stats_begin();
    if (framesink_write(p->out, &f, err))
        return -1;
    stats_end("encode", begun);
    progress("frames", rec->frame + 1, 0, NULL);
    return 0;
}

/* FEAT becomes a picture, CONF tells the rate, the rest passes. */
static int pass_record(struct program *p, const struct record *rec,
                       struct error *err)
{
    struct stream_writer *out = framesink_stream(p->out);

    if (record_is(rec, "FEAT"))
        return write_picture(p, rec, err);
    if (record_is(rec, "SRCI") && size && take_photo(p, rec, err))
        return -1;
    if (record_is(rec, "CONF"))
        framesink_take_conf(p->out, rec);
    return out ? stream_copy(out, rec, err) : 0;
}

int main(int argc, char **argv)
{
    static struct program p;
    struct error err = {0};
    const struct record *rec;
    double begun;
    int rc;

    int first = cli_parse_stage(&usage, argc, argv, true);
    if (argc - first > 1)
        die(EX_USAGE, "%s: one stream at a time (expected at most one "
            "operand)", argv[first + 1]);
    open_model(&p);
    open_background();
    open_streams(&p, first < argc ? argv[first] : "-");
    while (begun = stats_begin(), (rc = ahead_read(p.ahead, &rec, &err)) > 0) {
        stats_end("decode", begun);
        if (pass_record(&p, rec, &err)) {
            error_prefix(&err, "%s: frame %llu", stream_name(p.in),
                         (unsigned long long)rec->frame);
            rc = -1;
            break;
        }
    }
    progress_end();
    if (rc < 0) {               /* a stream gets no END */
        framesink_abandon(p.out);
        die_error(&err);
    }
    if (framesink_finish(p.out, &err))
        die_error(&err);
    stats_write();
    ahead_close(p.ahead);
    stream_close(p.in);
    refine_release(&p.refine);
    model_close(&p.model);
    background_release(&background);
    zoom_release(&p.zoom);
    texture_release(&p.texture);
    person_release(&p.person);
    free(p.rgb);
    free(p.alpha);
    return 0;
}
