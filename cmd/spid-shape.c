/* spid-shape: a picture in, an identity out.  Phase A of the paper up to beta:
 * crop, E_beta (Eq. beta), the source's own motion by E_m, and the matte. */
#include <stdlib.h>
#include <string.h>

#include "cmd/options.h"
#include "formats/image.h"
#include "formats/mark.h"
#include "formats/module.h"
#include "lib/stream/stream.h"
#include "lib/track/conf.h"
#include "lib/track/encoders.h"
#include "lib/photo/overlay.h"
#include "lib/track/source.h"
#include "lib/track/views.h"

static struct track_options track_options;
static const char *head_path, *mask_path, *overlay_path;
static long picture_size;
static enum nn_type precision = OPTION_PRECISION_DEFAULT;

static const struct cli_option options[] = {
    OPTION_CROP(&track_options,
                "face crop: centre and side in pixels of the picture"),
    OPTION_FACE("face", &track_options.face, "the picture"),
    OPTION_WINDOW(&track_options, "portrait window (default: about the face)"),
    OPTION_INT("size", 0, &picture_size, 32, PERSON_MAX, "N",
               "for pictures of N by N pixels at most (default: of any size)"),
    OPTION_STRING("mask", 0, &mask_path, "FILE",
                  "matte: a picture of the same size, white where the "
                  "person is"),
    OPTION_OUTPUT("overlay", 0, &overlay_path, "FILE.png",
                  "write crop, matte, mesh and landmarks drawn on the "
                  "picture"),
    OPTION_HEAD(&head_path),
    OPTION_PRECISION(&precision, "networks"),
    {0}
};

static const struct cli_usage usage = {
    "spid-shape", "[OPTION ...] PICTURE [MORE...]",
    "make an identity from pictures of a person", options
};

struct program {
    struct head head;
    struct model model;
    struct encoders nets;
    struct image picture, mask;
    struct source source;
    struct views views;
};

/* Model and head. */
static void shape_open_model(struct program *p)
{
    struct error err = {0};

    if (option_model_open(&p->model, &err)
        || option_head_load(&p->head, head_path, &err)
        || encoders_open(&p->nets, &p->model, true, precision, &err))
        die_error(&err);
    track_options.size = (double)p->model.config.size;
    track_options.finest = picture_size ? source_finest((size_t)picture_size)
                                        : 0;
}

/* The picture and its mask. */
static void shape_read_pictures(struct program *p, const char *path)
{
    struct error err = {0};
    double begun = stats_begin();

    if (image_read(&p->picture, path, &err)
        || (mask_path && image_read(&p->mask, mask_path, &err)))
        die_error(&err);
    stats_end("decode", begun);
}

/* One more file of the person. */
static void shape_add_view(struct program *p, const char *path,
                           const char *first)
{
    struct views_report r;
    struct error err = {0};

    if (views_add(&p->views, &r, path, &err))
        die_error(&err);
    if (r.stranger)
        warn("%s: another person than in %s (likeness %.2f, expected %.2f at "
             "least): left out", path, first, r.likeness, VIEWS_SIMILAR);
    else if (!r.taken)
        notice("%s: no frame with the head turned another way", path);
    else
        notice("%s: %zu picture%s (likeness %.2f)", path, r.taken,
               plural(r.taken), r.likeness);
}

/* The lines that are this program. */
static void shape_make_identity(struct program *p, char **path, int paths)
{
    struct error err = {0};
    struct source *s = &p->source;
    struct image *mask = mask_path ? &p->mask : NULL;
    double now;

    if (source_find(s, &p->picture, mask, &p->head, &p->nets, &track_options,
                    &err)) {
        error_prefix(&err, "%s", path[0]);
        die_error(&err);
    }
    if (views_init(&p->views, s, &p->head, &p->nets, &track_options, &err))
        die_error(&err);
    for (int i = 1; i < paths; i++)
        shape_add_view(p, path[i], path[0]);
    if (views_join(&p->views, s, &p->picture, mask, &err)) {
        error_prefix(&err, "%s", path[0]);
        die_error(&err);
    }
    now = stats_begin();
    stats_end("detect", now - s->detect_s);
    stats_end("crop", now - s->crop_s);
    stats_end("motion", now - s->motion_s);
    stats_end("shape", now - s->shape_s);
    stats_end("matte", now - s->matte_s);
    option_source_tell(path[0], &s->notes);
}

/* CONF, SRCI, SHAP and MOTN. */
static void shape_write_identity(const struct program *p)
{
    struct error err = {0};
    double begun = stats_begin();
    struct stream_writer *out = cli_create_stream(cli.output);
    struct conf conf = {
        .producer = "spid-shape", .head = &p->head,
        .model = &p->model, .window = &p->source.window,
        .width = p->picture.width, .height = p->picture.height
    };

    if (conf_write(out, &conf, &err)
        || person_write(out, &p->source.person, p->head.nexp, &err))
        cli_abandon_stream(out, &err);
    if (stream_finish(out, &err))
        die_error(&err);
    stats_end("encode", begun);
}

/* Dim what the matte says is background, then draw the rest on top. */
static void shape_dim_background(uint8_t *rgb, const struct program *p)
{
    const size_t W = p->picture.width, H = p->picture.height;
    const size_t S = p->source.person.size;
    const double k = (double)S / p->source.window.size;

    memcpy(rgb, p->picture.rgb, 3 * W * H);
    for (size_t y = 0; y < H; y++)
        for (size_t x = 0; x < W; x++) {
            double u = ((double)x + 0.5 - p->source.window.x) * k + S / 2.0;
            double v = ((double)y + 0.5 - p->source.window.y) * k + S / 2.0;
            uint8_t *q = rgb + 3 * (y * W + x);
            int a = u >= 0 && v >= 0 && u < (double)S && v < (double)S
                ? p->source.person.matte[(size_t)v * S + (size_t)u] : 0;
            for (int c = 0; c < 3; c++)
                q[c] = (uint8_t)((q[c] * (64 + a * 3 / 4)) >> 8);
        }
}

/* The picture of --overlay. */
static void shape_write_overlay(const struct program *p)
{
    const size_t W = p->picture.width, H = p->picture.height;
    struct error err = {0};
    struct identity id;
    struct overlay o;
    uint8_t *dim = malloc(3 * W * H);
    const uint8_t *drawn = NULL;

    if (head_fold(&id, &p->head, p->source.person.shape,
                  p->source.person.nshape, &err)
        || overlay_init(&o, &id, &err))
        die_error(&err);
    if (dim) {
        shape_dim_background(dim, p);
        drawn = overlay_draw(&o, dim, W, H, &p->source.person.source, false,
                             p->source.window, track_options.size,
                             source_matte_name(p->source.notes.how));
    }
    if (!drawn)
        die(EX_OSERR, "no memory for the overlay");
    mark_off();                 /* it is the photograph, drawn upon */
    if (image_write_png(overlay_path, drawn, W, H, 3, &err))
        die_error(&err);
    overlay_release(&o);
    identity_release(&id);
    free(dim);
}

int main(int argc, char **argv)
{
    static struct program p;

    int first = cli_parse(&usage, argc, argv);
    if (argc == first)
        die(EX_USAGE, "no picture (expected one or more)");
    module_preload((const char *[]){argv[first]}, 1);
    shape_open_model(&p);
    shape_read_pictures(&p, argv[first]);
    shape_make_identity(&p, argv + first, argc - first);
    shape_write_identity(&p);
    if (overlay_path)
        shape_write_overlay(&p);
    stats_write();
    views_release(&p.views);
    source_release(&p.source);
    image_release(&p.picture);
    image_release(&p.mask);
    encoders_release(&p.nets);
    model_close(&p.model);
    head_release(&p.head);
    return 0;
}
