/* spid-refine: splatted features in, finished pictures out.  Eq. SR. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/framesink.h"
#include "lib/base/relative_pose.h"
#include "lib/head/person.h"
#include "lib/animate/refine_picture.h"
#include "lib/photo/backdrop.h"
#include "lib/photo/place.h"
#include "lib/stream/ahead.h"
#include "lib/stream/records.h"

static enum nn_type precision = OPTION_PRECISION_DEFAULT;
static struct framesink_options sink_options;
static struct background background;
static const char *background_text, *identity_path;
static double fps;
static bool roi;
static long size;

static const struct cli_option options[] = {
    OPTION_PRECISION_REFINE(&precision, "network"),
    OPTION_FLAG("roi", 0, &roi,
                "refine only the part of the picture where the head is"),
    OPTION_INT("size", 0, &size, 1, PERSON_MAX, "N",
               "pictures of N by N pixels (default FEAT's size)"),
    OPTION_CALL("format", 0, &sink_options.format, "FORMAT",
                framesink_parse_format,
                FRAMESINK_FORMATS " (default by the output's "
                "name)"),
    OPTION_STRING("background", 0, &background_text, "WHAT",
                  "R,G,B, #RRGGBB, a name, a picture, or source (default "
                  "black)"),
    OPTION_STRING("identity", 'i', &identity_path, "FILE",
                  "identity whose picture --background source means"),
    OPTION_FLAG("alpha", 0, &sink_options.alpha,
                "keep transparency: straight RGBA (not y4m and mp4)"),
    OPTION_FLOAT("fps", 0, &fps, 0.001, 100000, "RATE",
                 "frames a second of y4m and mp4 (default CONF's, else 25)"),
    OPTION_FLAG("bt601", 0, &sink_options.bt601,
                "write Y4M in BT.601 (default BT.709)"),
    {0}
};

static const struct cli_usage usage = {
    "spid-refine", "[OPTION ...] [STREAM]",
    "refine splatted feature images into pictures", options
};

struct program {
    struct model model;
    struct refine refine;
    struct stream_reader *in;
    struct ahead *ahead;
    struct framesink *out;
    struct refine_picture picture;
    struct texture texture;     /* the photograph of SRCI, and */
    uint8_t *grain;             /* (grain_size,grain_size) the last FEAT's that
                                 * had one */
    size_t grain_size;
    bool compared;
};

/* The model's refiner. */
static void refine_open_model(struct program *p)
{
    struct error err = {0};

    option_precision_settle(&precision);
    if (option_model_open(&p->model, &err)
        || refine_open(&p->refine, &p->model, precision, roi, &err))
        die_error(&err);
}

/* What is put behind the head. */
static void refine_open_background(void)
{
    struct error err = {0};
    struct person source;
    int rc = 0;

    if (!background_text)
        return;
    if (strcmp(background_text, "source") != 0) {
        rc = background_parse(background_text, &background, &err);
    } else if (!identity_path) {
        die(EX_USAGE, "--background=source: whose picture (expected "
            "-i FILE)");
    } else {
        rc = person_load_picture(&source, identity_path, &err) ||
             backdrop_of_person(&background, &source, &err);
        person_release(&source);
    }
    if (rc) {
        error_prefix(&err, "--background=%s", background_text);
        die_error(&err);
    }
}

/* Input read ahead, and the output. */
static void refine_open_streams(struct program *p, const char *input)
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

/* What --precision and --roi cost, on the first frame. */
static void refine_report_precision(const struct program *p,
                                    const struct feat *in)
{
    struct error err = {0};
    double max, db;

    if (cli.quiet || refine_picture_compare(&max, &db, &p->picture,
                                            &p->refine, in, &err))
        return;
    notice("%s%s, %zu x %zu of %zu x %zu pixels refined: largest error %.2g, "
           "%.1f dB against all of it in f32 (first frame)",
           nn_type_name(precision), roi ? ", --roi" : "",
           p->refine.plan.width, p->refine.plan.height, in->width, in->height,
           max, db);
}

_Static_assert(FEAT_PHOTO == TEXTURE_PHOTO &&
               FEAT_PLACE == SPLAT_PLACE_CHANNELS &&
               FEAT_TURN == RELATIVE_POSE_SIZE,
               "FEAT holds what the texture and the refiner take");

/* The grain of FEAT in place of the last one. */
static int refine_take_grain(struct program *p, const struct feat *f,
                             struct error *err)
{
    const size_t bytes = f->grain_size * f->grain_size;
    uint8_t *grain = malloc(bytes + 1);

    if (!grain)
        return error_set(err, EX_OSERR, "no memory for a grain of %zu pixels",
                         f->grain_size);
    memcpy(grain, f->grain, bytes);
    free(p->grain);
    p->grain = grain;
    p->grain_size = f->grain_size;
    return 0;
}

/* A FEAT record that can be refined; *in points into rec. */
static int refine_read_record(struct feat *in, struct program *p,
                              const struct record *rec, struct error *err)
{
    if (feat_read(in, rec, err))
        return -1;
    if (in->gain && in->height != in->width)
        return error_set(err, EX_DATAERR, "FEAT of %zu x %zu pixels has gain "
                         "(expected a square)", in->height, in->width);
    return in->grain ? refine_take_grain(p, in, err) : 0;
}

/* The lines that are this program: I' = SR(F). */
static int refine_write_picture(struct program *p, const struct record *rec,
                                struct error *err)
{
    struct refine_picture *made = &p->picture;
    struct feat in;
    double begun;

    if (refine_read_record(&in, p, rec, err))
        return -1;
    p->texture.grain = p->grain;
    p->texture.grain_size = p->grain_size;
    made->texture = p->texture.levels ? &p->texture : NULL;
    begun = stats_begin();
    if (refine_picture_refine(made, &p->refine, &in, err))
        return -1;
    stats_end("refine", begun);
    if (!p->compared && (roi || precision == NN_BF16
                         || precision == NN_INT8))
        refine_report_precision(p, &in);
    p->compared = true;
    if (refine_picture_finish(made, &in, err))
        return -1;
    begun = stats_begin();
    if (framesink_write(p->out, &(struct framesink_frame){
            .channels = 3, .frame = rec->frame, .time = rec->time,
            .height = made->height, .width = made->width,
            .color = made->color, .alpha = made->coverage}, err))
        return -1;
    stats_end("encode", begun);
    progress("frames", rec->frame + 1, 0, NULL);
    return 0;
}

/* FEAT becomes a picture, CONF tells the rate, the rest passes. */
static int refine_pass_record(struct program *p, const struct record *rec,
                              struct error *err)
{
    struct stream_writer *out = framesink_stream(p->out);

    if (record_is(rec, RECORD_FEAT))
        return refine_write_picture(p, rec, err);
    if (record_is(rec, RECORD_SRCI) && size &&
        texture_read_record(&p->texture, rec, err))
        return -1;
    if (record_is(rec, RECORD_CONF))
        framesink_read_conf(p->out, rec);
    return out ? stream_copy(out, rec, err) : 0;
}

/* Every record of the input in turn; -1 and *err naming the frame. */
static int refine_pass_stream(struct program *p, struct error *err)
{
    const struct record *rec;
    double begun;
    int rc;

    while (begun = stats_begin(), (rc = ahead_read(p->ahead, &rec, err)) > 0) {
        stats_end("decode", begun);
        if (refine_pass_record(p, rec, err))
            return stream_blame(p->in, rec, err);
    }
    return rc;
}

/* In the order in which one may still use the other. */
static void refine_close_all(struct program *p)
{
    ahead_close(p->ahead);
    stream_close(p->in);
    refine_release(&p->refine);
    model_close(&p->model);
    background_release(&background);
    refine_picture_release(&p->picture);
    texture_release(&p->texture);
    free(p->grain);
}

int main(int argc, char **argv)
{
    static struct program p;
    struct error err = {0};
    int first = cli_parse_stage(&usage, argc, argv, true);
    const char *input = cli_stream_operand(first, argc, argv);

    p.picture.size = (size_t)size;
    refine_open_model(&p);
    refine_open_background();
    refine_open_streams(&p, input);
    if (refine_pass_stream(&p, &err) < 0) {    /* a stream gets no END */
        progress_end();
        framesink_abandon(p.out);
        die_error(&err);
    }
    progress_end();
    option_sound_tell(p.out);
    if (framesink_finish(p.out, &err))
        die_error(&err);
    stats_write();
    refine_close_all(&p);
    return 0;
}
