/* spid-splat: Gaussians in, pictures out.  Eqs. C and G of the paper. */
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "cmd/cli.h"
#include "formats/framesink.h"
#include "lib/geom/relative_pose.h"
#include "lib/splat/reference.h"
#include "lib/splat/scene.h"
#include "lib/stream/stream.h"
#include "lib/record/person.h"
#include "lib/texture/texture.h"

/* --camera: overrides what the stream says. */
struct view_option {
    bool given;
    float rt[12];
};

static struct view_option view;
static long size = 512, channels = 3, exp_degree = 3;
static double focal = 12, alpha_cut = 1.0 / 255, t_cut = 1e-4, prune;
static unsigned branches;
static enum splat_rules rules = SPLAT_GSPLAT;
static bool no_photo;
static bool exact, f32_products, with_depth, f16, covered, imag, bt601;
static struct background background;
static bool straight;
static enum framesink_format format = FRAMESINK_AUTO;

/* Twelve numbers, row by row, separated by commas or blanks. */
static int parse_camera(const char *value, void *dest, struct error *err)
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

static int parse_branches(const char *value, void *dest, struct error *err)
{
    static const char *const name[] = {"dynamic", "static", "mouth"};
    unsigned *bits = dest;

    *bits = 0;
    while (*value) {
        size_t n = strcspn(value, ",");
        unsigned k = 0;

        while (k < 3 && (strlen(name[k]) != n || strncmp(value, name[k], n)))
            k++;
        if (k == 3)
            return error_set(err, EX_USAGE, "no such branch (expected "
                             "dynamic, static, mouth, or several with commas)");
        *bits |= 1u << k;
        value += n + (value[n] == ',');
    }
    return *bits ? 0 : error_set(err, EX_USAGE, "no branch named");
}

static int parse_rules(const char *value, void *dest, struct error *err)
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
    {"size", 's', CLI_INT, &size, 1, SPLAT_MAX_SIZE, "N",
     "draw N x N pixels (512)", NULL},
    {"channels", 'c', CLI_INT, &channels, 1, SPLAT_MAX_CHANNELS, "N",
     "draw the first N colour channels (3)", NULL},
    {"camera", 0, CLI_CALL, &view, 0, 0, "LIST",
     "12 numbers, the rows of [R|t], instead of the stream's", parse_camera},
    {"focal", 0, CLI_FLOAT, &focal, 1e-3, 1e6, "F",
     "focal length in half pictures (12)", NULL},
    {"branch", 0, CLI_CALL, &branches, 0, 0, "LIST",
     "only these: dynamic,static,mouth", parse_branches},
    {"format", 'f', CLI_CALL, &format, 0, 0, "NAME",
     "stream, y4m, png, pam, exr or mp4 (by the name)",
     framesink_parse_format},
    {"background", 'b', CLI_CALL, &background, 0, 0, "R,G,B|FILE",
     "behind the pictures (black)", background_parse},
    {"alpha", 0, CLI_FLAG, &straight, 0, 0, NULL,
     "pictures with straight alpha, no background", NULL},
    {"depth", 0, CLI_FLAG, &with_depth, 0, 0, NULL,
     "write depth too (stream and exr)", NULL},
    {"f16", 0, CLI_FLAG, &f16, 0, 0, NULL,
     "FEAT in half precision also with 4 channels or less", NULL},
    {"covered", 0, CLI_FLAG, &covered, 0, 0, NULL,
     "FEAT without the pixels that nothing covers", NULL},
    {"imag", 0, CLI_FLAG, &imag, 0, 0, NULL,
     "stream: finished IMAG records instead of FEAT", NULL},
    {"bt601", 0, CLI_FLAG, &bt601, 0, 0, NULL,
     "y4m: BT.601 matrix instead of BT.709", NULL},
    {"exact", 0, CLI_FLAG, &exact, 0, 0, NULL,
     "double precision without cut-offs: slow, the truth", NULL},
    {"rules", 0, CLI_CALL, &rules, 0, 0, "NAME",
     "gsplat, or dgr: as the public CUDA rasteriser", parse_rules},
    {"alpha-cut", 0, CLI_FLOAT, &alpha_cut, 1e-7, 0.9, "A",
     "leave out alphas below A (1/255)", NULL},
    {"t-cut", 0, CLI_FLOAT, &t_cut, 0, 0.9, "T",
     "stop at this transmittance (1e-4)", NULL},
    {"exp-degree", 0, CLI_INT, &exp_degree, 2, 5, "N",
     "of the exponential's polynomial (3; 5 is exact in float)", NULL},
    {"f32", 0, CLI_FLAG, &f32_products, 0, 0, NULL,
     "over 4 channels: float products and FEAT, not 16-bit ones", NULL},
    {"prune", 0, CLI_FLOAT, &prune, 0, 1, "O",
     "leave out Gaussians of opacity below O (0)", NULL},
    {"no-photo", 0, CLI_FLAG, &no_photo, 0, 0, NULL,
     "baked colours alone, no photograph as texture", NULL},
    {0}
};

static const struct cli_usage usage = {
    "spid-splat", "[-s N] [-c N] [--camera LIST] [--focal F] [--branch LIST] "
    "[-f NAME] [-b R,G,B|FILE] [--alpha] [--depth] [--f16] [--covered] "
    "[--imag] [--bt601] [--exact] [--rules NAME] [--alpha-cut A] [--t-cut T] "
    "[--exp-degree N] [--f32] [--prune O] [--no-photo] [--max-bytes SIZE] "
    "[-o FILE] [-j N] [-m MODEL] [-q] [--stats FILE] [STREAM]",
    "draw Gaussians", options
};

/* What is drawn into. */
struct canvas {
    float *image, *alpha, *depth;
    float *photo;               /* (N,N,5) looked up, for FEAT */
    uint16_t *half;             /* in place of image: FEAT in half precision */
};

/* FEAT records leave by a thread, so that the next picture is drawn while the
 * refiner takes this one: a pipe holds a small part of it. */
struct leaving {
    pthread_t thread;
    bool busy;
    struct framesink *sink;
    struct framesink_frame frame;
    int rc;
    struct error err;
};

struct drawing {
    struct scene scene;
    struct splat splat;
    struct framesink *sink;
    struct canvas canvas, other; /* drawn next; on its way out, if it can be */
    struct leaving leaving;
    double *wide;               /* a picture in double for --exact */
    struct person person;       /* whose photograph, from SRCI */
    struct texture texture;     /* no levels: none */
    float *place;               /* (N,N,3), with a texture */
    bool pending;               /* a GAUS without camera waits: drawn with
                                 * --camera unless GMOV records follow */
    uint64_t frame;             /* ... of this number and time */
    double time;
};

/* Features for a refiner travel as they are multiplied, in 16 bits; the truth
 * and what was asked for in float stay float. */
static bool half_features(void)
{
    return f16 || (channels > SPLAT_COLORS && !f32_products && !exact);
}

static bool writes_features(const struct drawing *d)
{
    return framesink_stream(d->sink) && !imag;
}

static void open_canvas(struct canvas *c, bool features)
{
    size_t pixels = (size_t)size * (size_t)size, C = (size_t)channels;

    if (features && half_features() && !exact)
        c->half = aligned_alloc(64, (pixels * C + 31) / 32 * 64);
    else
        c->image = malloc(pixels * C * sizeof *c->image);
    c->alpha = malloc(pixels * sizeof *c->alpha);
    c->depth = with_depth ? malloc(pixels * sizeof *c->depth) : NULL;
    if ((!c->image && !c->half) || !c->alpha || (with_depth && !c->depth))
        die(EX_OSERR, "no memory for %ld x %ld pixels", size, size);
}

static void close_canvas(struct canvas *c)
{
    free(c->image);
    free(c->half);
    free(c->alpha);
    free(c->depth);
    free(c->photo);
}

static void open_renderer(struct drawing *d)
{
    struct splat_options o =
        splat_defaults((int)size, (int)size, (int)channels);
    size_t pixels = (size_t)size * (size_t)size, C = (size_t)channels;
    struct error err = {0};

    o.rules = rules;
    o.threads = cli.threads;
    o.alpha_cut = (float)alpha_cut;
    o.t_cut = (float)t_cut;
    o.exp_degree = (int)exp_degree;
    o.fixed16 = o.fixed16 && !f32_products;
    o.depth = with_depth;
    o.covered = covered && writes_features(d);
    o.prune = (float)prune;
    o.branches = branches;
    o.place = !exact && !no_photo;
    if (splat_init(&d->splat, &o, &err))
        die_error(&err);
    d->wide = exact ? malloc(pixels * (C + 2) * sizeof *d->wide) : NULL;
    if (exact && !d->wide)
        die(EX_OSERR, "no memory for %ld x %ld pixels", size, size);
    open_canvas(&d->canvas, writes_features(d));
    if (writes_features(d))
        open_canvas(&d->other, true);
}

static void open_sink(struct drawing *d)
{
    struct error err = {0};
    struct framesink_options o = {
        .path = cli.output, .format = format, .alpha = straight,
        .covered = covered,
        .bt601 = bt601, .background = &background,
        .record = imag ? FRAMESINK_IMAG
                       : half_features() ? FRAMESINK_FEAT_F16
                                         : FRAMESINK_FEAT_F32};

    d->sink = framesink_open(&o, &err);
    if (!d->sink)
        die_error(&err);
    if (channels < 3 && (imag || !framesink_stream(d->sink)))
        die(EX_USAGE, "--channels=%ld: a picture has colours (expected 3 or "
            "more)", channels);
}

/* The truth: no cut-offs, in double. */
static int draw_exact(struct drawing *d, const struct splat_camera *cam,
                      struct error *err)
{
    size_t pixels = (size_t)size * (size_t)size, C = (size_t)channels;
    double *alpha = d->wide + pixels * C, *depth = alpha + pixels;
    struct reference t;

    if (d->scene.g.channels < channels)
        return error_set(err, EX_DATAERR, "color has %d channels (expected "
                         "at least %ld)", d->scene.g.channels, channels);
    if (reference_init(&t, &d->scene.g, cam, (int)size, (int)size,
                         (int)channels, SPLAT_EXACT, branches, err))
        return -1;
    int rc = reference_forward(d->wide, alpha, depth, NULL, &t, err);

    reference_release(&t);
    for (size_t i = 0; i < pixels * C; i++)
        d->canvas.image[i] = (float)d->wide[i];
    for (size_t p = 0; p < pixels; p++) {
        d->canvas.alpha[p] = (float)alpha[p];
        if (d->canvas.depth)
            d->canvas.depth[p] = (float)depth[p];
    }
    return rc;
}

/* Whether the pictures show the photograph. */
static bool shows_photo(const struct drawing *d)
{
    return d->texture.levels && d->scene.uv && !exact && !no_photo;
}

/* Memory for places and what is looked up there, once it is needed. */
static int open_photo(struct drawing *d, struct error *err)
{
    const size_t pixels = (size_t)size * (size_t)size;

    if (!d->place)
        d->place = malloc(PLACE_CHANNELS * pixels * sizeof *d->place);
    if (writes_features(d) && !d->canvas.photo)
        d->canvas.photo = malloc(TEXTURE_PHOTO * pixels *
                                 sizeof *d->canvas.photo);
    if (!d->place || (writes_features(d) && !d->canvas.photo))
        return error_set(err, EX_OSERR, "no memory for %ld x %ld pixels",
                         size, size);
    return 0;
}

/* Eq. C, and the photograph over it; for a refiner, beside it. */
static int draw_fast(struct drawing *d, const struct splat_camera *cam,
                     struct error *err)
{
    struct canvas *c = &d->canvas;
    const bool photo = shows_photo(d);
    struct splat_place_view v;

    if (photo && open_photo(d, err))
        return -1;
    place_view_make(&v, d->scene.view, cam->rt);
    if (splat_draw(&d->splat, &(struct splat_pictures){
            .image = c->image, .half = c->half, .alpha = c->alpha,
            .depth = c->depth, .place = photo ? d->place : NULL
        }, cam, &v, NULL, err))
        return -1;
    if (photo && writes_features(d))
        texture_lookup(c->photo, &d->texture, &v, d->place, c->alpha,
                       (size_t)size);
    else if (photo)
        texture_apply(c->image, (size_t)channels, c->alpha, &d->texture, &v,
                      d->place, (size_t)size);
    return 0;
}

/* The photograph that places are places of. */
static int take_photo(struct drawing *d, const struct record *rec,
                      struct error *err)
{
    if (person_take(&d->person, rec, 0, err) < 0)
        return -1;
    texture_release(&d->texture);
    return d->person.back
         ? texture_init(&d->texture, d->person.rgb, d->person.matte,
                        d->person.back, d->person.size, err) : 0;
}

static void *leave(void *arg)
{
    struct leaving *l = arg;

    l->rc = framesink_write(l->sink, &l->frame, &l->err);
    return NULL;
}

/* Wait until the last picture is out; 0, or -1 and why it is not. */
static int settle(struct drawing *d, struct error *err)
{
    struct leaving *l = &d->leaving;

    if (!l->busy)
        return 0;
    pthread_join(l->thread, NULL);
    l->busy = false;
    if (l->rc)
        *err = l->err;
    return l->rc;
}

/* Send a picture on its way, and draw into the other canvas from now on. */
static int dispatch(struct drawing *d, const struct framesink_frame *f,
                    struct error *err)
{
    struct leaving *l = &d->leaving;
    struct canvas drawn = d->canvas;

    if (settle(d, err))
        return -1;
    *l = (struct leaving){.sink = d->sink, .frame = *f};
    l->busy = writes_features(d) &&
              pthread_create(&l->thread, NULL, leave, l) == 0;
    if (!l->busy)
        return framesink_write(d->sink, f, err);
    d->canvas = d->other;
    d->other = drawn;
    return 0;
}

/* The line that is this program: Eq. C. */
static int draw(struct drawing *d, uint64_t frame, double time,
                struct error *err)
{
    const float *rt = view.given ? view.rt : d->scene.cam;
    struct splat_camera cam =
        splat_camera_square(rt, (int)size, (float)focal);
    struct framesink_frame f = {
        .width = (size_t)size, .height = (size_t)size,
        .channels = (int)channels, .color = d->canvas.image,
        .half = d->canvas.half, .alpha = d->canvas.alpha,
        .depth = d->canvas.depth, .frame = frame, .time = time};

    if (writes_features(d) && shows_photo(d)) {
        if (open_photo(d, err))
            return -1;
        f.photo = d->canvas.photo;
    }

    d->pending = false;
    if (!view.given && !d->scene.has_cam)
        return error_set(err, EX_DATAERR, "no camera so far (expected cam in "
                         "GAUS or GMOV, or --camera)");
    /* of the stream's camera: --camera goes round head and light */
    f.turned = d->scene.has_source && d->scene.has_cam;
    if (f.turned)
        relative_pose(f.turn, d->scene.source, d->scene.light, d->scene.cam);
    double begun = stats_begin();
    int rc = exact ? draw_exact(d, &cam, err) : draw_fast(d, &cam, err);

    stats_end("splat", begun);
    return rc ? rc : dispatch(d, &f, err);
}

static int flush(struct drawing *d, struct error *err)
{
    return d->pending && view.given ? draw(d, d->frame, d->time, err) : 0;
}

static int pass_record(struct drawing *d, const struct record *rec,
                       struct error *err)
{
    struct stream_writer *out = framesink_stream(d->sink);

    if (record_is(rec, "GAUS") && flush(d, err))
        return -1;
    int change = scene_apply(&d->scene, rec, err);

    if (change < 0 || scene_to_splat(&d->splat, &d->scene,
                                     (enum scene_change)change, err))
        return -1;
    if (change == SCENE_LOADED && !record_find(rec, "cam")) {
        d->pending = true;
        d->frame = rec->frame;
        d->time = rec->time;
        return 0;
    }
    if (change != SCENE_NONE)
        return draw(d, rec->frame, rec->time, err);
    if (settle(d, err))         /* from here on the sink is ours alone */
        return -1;
    if (record_is(rec, "SRCI") && !no_photo && take_photo(d, rec, err))
        return -1;
    if (record_is(rec, "CONF"))
        framesink_take_conf(d->sink, rec);
    return out ? stream_copy(out, rec, err) : 0;
}

static void close_drawing(struct drawing *d)
{
    scene_release(&d->scene);
    splat_release(&d->splat);
    background_release(&background);
    close_canvas(&d->canvas);
    close_canvas(&d->other);
    free(d->wide);
    free(d->place);
    texture_release(&d->texture);
    person_release(&d->person);
}

int main(int argc, char **argv)
{
    struct drawing d = {0};
    struct error err = {0};
    struct record rec;
    int rc, first = cli_parse_stage(&usage, argc, argv, false);

    if (argc - first > 1)
        die(EX_USAGE, "%s: one stream at a time (expected at most one "
            "operand)", argv[first + 1]);
    struct stream_reader *in =
        stream_open(first < argc ? argv[first] : "-", NULL, &err);

    if (!in)
        die_error(&err);
    open_sink(&d);
    open_renderer(&d);
    while ((rc = stream_read(in, &rec, &err)) > 0)
        if (pass_record(&d, &rec, &err)) {
            error_prefix(&err, "%s: frame %llu", stream_name(in),
                         (unsigned long long)rec.frame);
            rc = -1;
            break;
        }
    if (rc == 0 && (flush(&d, &err) || settle(&d, &err)))
        rc = -1;
    if (rc < 0) {               /* no END: the next program knows */
        struct error late;

        settle(&d, &late);      /* but it gets what was drawn before */
        framesink_abandon(d.sink);
        die_error(&err);
    }
    if (framesink_finish(d.sink, &err))
        die_error(&err);
    stats_write();
    stream_close(in);
    close_drawing(&d);
    return 0;
}
