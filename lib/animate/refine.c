/* The refiner (Eq. SR) on a picture or on the part with the head.  The
 * network is planned for one size; a part that does not fit is planned anew,
 * never smaller than before, so that a moving head does not plan at every
 * frame. */
#include "lib/animate/refine.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/covered.h"
#include "lib/base/half.h"
#include "lib/base/parallel.h"
#include "lib/nn/kernels.h"
#include "lib/photo/texture.h"

#define TILE 4          /* places of the field across, 16 pixels */
/* A picture of which no tile's colours are further from those that the network
 * saw last, root mean square, gets what was said of that one.  Of two people
 * who talk (GRID's lbax4n and lbbc2a) that is three frames in four, 67 dB from
 * asking at every frame. */
#define CHANGED 0.16

int refine_open(struct refine *r, const struct model *m, enum nn_type type,
                bool roi, struct error *err)
{
    memset(r, 0, sizeof *r);
    if (!m->config.has_refiner)
        return error_set(err, EX_CONFIG, "%s: the model has no refiner "
                         "(spid-splat -o FILE writes its pictures without "
                         "one)", model_path(m));
    r->model = m;
    r->type = type == NN_FAST && m->config.refiner.type == REFINER_NARROW
                  ? NN_BF16 : type;
    r->roi = roi;
    return 0;
}

/* The network and its weights. */
static void refine_plan_release(struct refine_plan *p)
{
    refiner_release(&p->net);
    params_release(&p->ps);
    memset(p, 0, sizeof *p);
}

void refine_release(struct refine *r)
{
    refine_plan_release(&r->plan);
    free(r->part);
    free(r->out);
    free(r->seen);
    free(r->start);
    free(r->all);
    free(r->photo);
    free(r->photo_part);
    memset(r, 0, sizeof *r);
}

/* A network of this size, with the model's weights; *p stays where it is, for
 * its convolutions point to its weights. */
static int refine_plan_make(struct refine_plan *p, const struct refine *r,
                            size_t height, size_t width, struct error *err)
{
    const struct nn_options opt = {NN_INFER, r->type};

    memset(p, 0, sizeof *p);
    params_init(&p->ps);
    const char *prefix = avatar_config_refiner(&r->model->config);
    if (refiner_init(&p->net, &p->ps, prefix, &r->model->config.refiner,
                     err) ||
        params_allocate(&p->ps, err) ||
        model_load(&p->ps, r->model, prefix, err) ||
        refiner_plan(&p->net, 1, height, width, opt, err)) {
        refine_plan_release(p);
        return -1;
    }
    p->height = height;
    p->width = width;
    return 0;
}

/* ---- which part ------------------------------------------------------- */

struct part {
    size_t top, left, height, width;
};

/* To the next multiple of the step. */
static size_t refine_round_up(size_t n)
{
    return (n + REFINE_STEP - 1) / REFINE_STEP * REFINE_STEP;
}

size_t refine_places(size_t n)
{
    return refine_round_up(n) / TEXTURE_FIELD_STEP;
}

/* Rows or columns from lo to hi (end) with margin, as a multiple of the step
 * inside n (itself rounded up). */
static void refine_grow_span(size_t *start, size_t *size, size_t lo, size_t hi,
                             size_t n)
{
    size_t a = lo > REFINE_MARGIN ? lo - REFINE_MARGIN : 0;
    size_t b = hi + REFINE_MARGIN;

    a = a / REFINE_STEP * REFINE_STEP;
    b = refine_round_up(b) < refine_round_up(n) ? refine_round_up(b)
                                                : refine_round_up(n);
    *start = a;
    *size = b - a;
}

/* The box of alpha above one level; the whole picture without alpha. */
static struct part refine_find_part(const struct refine *r,
                                    const struct feat *in)
{
    const bool style = r->model->config.refiner.type == REFINER_STYLE_UNET;
    struct part p = {0, 0, in->height, in->width};
    size_t x0 = in->width, x1 = 0, y0 = in->height, y1 = 0;

    if (!style) {
        p.height = refine_round_up(p.height);
        p.width = refine_round_up(p.width);
    }
    if (!r->roi || !in->alpha || style)
        return p;
    for (size_t y = 0; y < in->height; y++) {
        const float *a = in->alpha + y * in->width;
        size_t x = 0, e = in->width;
        while (x < e && !(a[x] > 1.0f / 255))
            x++;
        if (x == e)
            continue;
        while (!(a[e - 1] > 1.0f / 255))
            e--;
        x0 = x < x0 ? x : x0;
        x1 = e > x1 ? e : x1;
        y0 = y < y0 ? y : y0;
        y1 = y + 1;
    }
    if (x0 >= x1)
        x0 = y0 = 0, x1 = y1 = 1;      /* nothing to see */
    refine_grow_span(&p.left, &p.width, x0, x1, in->width);
    refine_grow_span(&p.top, &p.height, y0, y1, in->height);
    return p;
}

/* Use the planned size if the part fits into it, placed so that it covers the
 * part; otherwise plan one that fits this and the last. */
static int refine_fit(struct refine *r, const struct feat *in,
                      struct error *err)
{
    struct part p = refine_find_part(r, in);
    size_t h = p.height, w = p.width;
    const bool fits = r->plan.height >= h && r->plan.width >= w
        && (r->roi || (r->plan.height == h && r->plan.width == w));

    if (!fits) {
        if (r->roi && r->plan.height > h &&
            r->plan.height <= refine_round_up(in->height))
            h = r->plan.height;
        if (r->roi && r->plan.width > w &&
            r->plan.width <= refine_round_up(in->width))
            w = r->plan.width;
        refine_plan_release(&r->plan);
        r->has_seen = false;
        if (refine_plan_make(&r->plan, r, h, w, err) != 0)
            return -1;
        r->plans++;
    }
    h = refine_round_up(in->height);
    w = refine_round_up(in->width);
    r->top = p.top;
    r->left = p.left;
    if (r->top + r->plan.height > h)
        r->top = h > r->plan.height ? h - r->plan.height : 0;
    if (r->left + r->plan.width > w)
        r->left = w > r->plan.width ? w - r->plan.width : 0;
    return 0;
}

/* ---- one frame -------------------------------------------------------- */

/* p, or more room in its place, for n values of so many bytes each; NULL and
 * *err when there is none. */
static void *refine_make_room(void *p, size_t *room, size_t n, size_t bytes,
                              struct error *err)
{
    if (n <= *room)
        return p;
    free(p);
    p = aligned_alloc(64, (n * bytes + 63) / 64 * 64);
    *room = p ? n : 0;
    if (!p)
        error_set(err, EX_OSERR, "no memory for a part of %zu numbers", n);
    return p;
}

/* One row. */
PARALLEL(refine_copy_part_part, y, struct refine *, r,
         const struct feat *, in, size_t, w, size_t, C, size_t, cols)
{
    float *to = r->part + y * w * C;
    size_t from = ((y + r->top) * in->width + r->left) * C;
    if (y + r->top >= in->height) {
        memset(to, 0, w * C * sizeof *to);
        return;
    }
    if (in->f32)
        memcpy(to, in->f32 + from, cols * C * sizeof *to);
    else
        nn_kernels()->widen(to, in->f16 + from, cols * C);
    memset(to + cols * C, 0, (w - cols) * C * sizeof *to);
}

/* The part's features as floats, zero outside the picture. */
static void refine_copy_part(struct refine *r, const struct feat *in)
{
    const size_t C = in->channels, h = r->plan.height, w = r->plan.width;
    const size_t cols = r->left + w <= in->width ? w : in->width - r->left;

    parallel_each(refine_copy_part_part, h, 1, r, in, w, C, cols);
}

/* First three channels of what lies outside the part. */
static void refine_copy_coarse(float *rgb, const struct refine *r,
                               const struct feat *in)
{
    const size_t C = in->channels;

    for (size_t y = 0; y < in->height; y++) {
        const bool row = y >= r->top && y < r->top + r->plan.height;
        for (size_t x = 0; x < in->width; x++) {
            size_t i = y * in->width + x;
            if (row && x >= r->left && x < r->left + r->plan.width)
                continue;
            for (size_t k = 0; k < 3; k++)
                rgb[3 * i + k] = in->f32 ? in->f32[i * C + k]
                                         : half_to_float(in->f16[i * C + k]);
        }
    }
}

/* The part's colours into the picture. */
static void refine_copy_back(float *rgb, const struct refine *r,
                             const struct feat *in)
{
    const size_t w = r->plan.width;
    const size_t cols = r->left + w <= in->width ? w : in->width - r->left;

    for (size_t y = 0; y < r->plan.height && y + r->top < in->height; y++)
        memcpy(rgb + ((y + r->top) * in->width + r->left) * 3,
               r->out + y * w * 3, cols * 3 * sizeof *rgb);
}

/* Channels and size. */
static int refine_check_input(const struct refine *r,
                              const struct feat *in, struct error *err)
{
    if (in->channels != r->model->config.refiner.channels)
        return error_set(err, EX_DATAERR, "FEAT has %zu channels (expected "
                         "%zu, the refiner's; spid-splat --channels %zu)",
                         in->channels, r->model->config.refiner.channels,
                         r->model->config.refiner.channels);
    if (in->height == 0 || in->width == 0)
        return error_set(err, EX_DATAERR, "FEAT of %zu x %zu pixels (expected"
                         " at least one)", in->width, in->height);
    return 0;
}

/* Where the rows of packed features begin. */
static int refine_find_rows(struct refine *r, const struct feat *in,
                            struct error *err)
{
    r->start = refine_make_room(r->start, &r->start_room, in->height,
                                sizeof *r->start, err);
    if (!r->start)
        return -1;
    if (covered_rows(r->start, in->alpha, in->height, in->width)
        != in->pixels)
        return error_set(err, EX_DATAERR, "FEAT feat has %zu pixels (expected"
                         " as many as alpha covers)", in->pixels);
    return 0;
}

/* *whole: all pixels of packed features. */
static int refine_unpack(struct feat *whole, struct refine *r,
                         const struct feat *in, struct error *err)
{
    const size_t n = in->height * in->width;
    const size_t bytes = in->channels * (in->f32 ? sizeof *in->f32
                                                 : sizeof *in->f16);

    r->all = refine_make_room(r->all, &r->all_room, n * bytes, 1, err);
    if (!r->all)
        return -1;
    covered_unpack(r->all, in->f32 ? (const void *)in->f32 : in->f16,
                   in->pixels, in->alpha, n, bytes);
    *whole = *in;
    whole->packed = false;
    whole->f32 = in->f32 ? r->all : NULL;
    whole->f16 = in->f32 ? NULL : r->all;
    return 0;
}

/* r->shown, unpacked if need be. */
static int refine_unpack_photo(struct refine *r, const struct feat *in,
                               struct error *err)
{
    const size_t n = in->height * in->width, bytes = TEXTURE_PHOTO *
                                                     sizeof *r->photo;

    r->shown = in->photo;
    if (!in->photo || !in->packed)
        return 0;
    r->photo = refine_make_room(r->photo, &r->photo_room, TEXTURE_PHOTO * n,
                                sizeof *r->photo, err);
    if (!r->photo)
        return -1;
    covered_unpack(r->photo, in->photo, in->pixels, in->alpha, n, bytes);
    r->shown = r->photo;
    return 0;
}

/* Give the network the planned part of the photograph, zeros where there is
 * none. */
static int refine_show_photo(struct refine *r, const struct feat *in,
                             struct error *err)
{
    const size_t h = r->plan.height, w = r->plan.width, C = TEXTURE_PHOTO;
    const size_t cols = r->left + w <= in->width ? w : in->width - r->left;

    if (!r->model->config.refiner.photo)
        return 0;
    if (r->shown && h == in->height && w == in->width) {
        refiner_photo(&r->plan.net, r->shown);
        return 0;
    }
    r->photo_part = refine_make_room(r->photo_part, &r->photo_part_room,
                                     h * w * C, sizeof *r->photo_part, err);
    if (!r->photo_part)
        return -1;
    memset(r->photo_part, 0, h * w * C * sizeof *r->photo_part);
    for (size_t y = 0; r->shown && y < h && y + r->top < in->height; y++)
        memcpy(r->photo_part + y * w * C,
               r->shown + ((y + r->top) * in->width + r->left) * C,
               cols * C * sizeof *r->photo_part);
    refiner_photo(&r->plan.net, r->photo_part);
    return 0;
}

/* How far apart two tiles of coarse colours are, root mean square: rows of
 * TILE places, `line` numbers apart. */
static double refine_tile_change(const float *a, const float *b, size_t line)
{
    double sum = 0;

    for (size_t y = 0; y < TILE; y++, a += line, b += line)
        for (size_t i = 0; i < 3 * TILE; i++)
            sum += ((double)a[i] - (double)b[i]) * ((double)a[i] - (double)b[i]);
    return sqrt(sum / (3 * TILE * TILE));
}

/* Whether the planned part's coarse colours rgb are nearly those that the
 * network saw last; they are put behind these in r->seen. */
static bool refine_is_seen(struct refine *r, const float *rgb)
{
    const size_t h = r->plan.height / TEXTURE_FIELD_STEP;
    const size_t w = r->plan.width / TEXTURE_FIELD_STEP, line = 3 * w;
    float *now = r->seen + h * line;
    bool same = r->has_seen && r->seen_top == r->top &&
                r->seen_left == r->left && r->seen_photo == !!r->shown;

    for (size_t y = 0; y < h; y++)
        for (size_t x = 0; x < w; x++)
            memcpy(now + y * line + 3 * x,
                   rgb + 3 * TEXTURE_FIELD_STEP *
                             (y * TEXTURE_FIELD_STEP * w + x), 3 * sizeof *now);
    for (size_t y = 0; y < h && same; y += TILE)
        for (size_t x = 0; x < w && same; x += TILE)
            same = refine_tile_change(r->seen + y * line + 3 * x,
                                      now + y * line + 3 * x, line) < CHANGED;
    return same;
}

/* What was said of the picture that the network saw last, over this one, out:
 * 1; 0 when it has changed, and is the last that the network sees now; -1. */
static int refine_repeat(float *out, struct refine *r,
                         const struct feature_view *view, struct error *err)
{
    const size_t n = 3 * (r->plan.height / TEXTURE_FIELD_STEP) *
                     (r->plan.width / TEXTURE_FIELD_STEP);

    if (!refiner_repeats(&r->plan.net))
        return 0;
    r->seen = refine_make_room(r->seen, &r->seen_room, 2 * n, sizeof *r->seen,
                               err);
    if (!r->seen)
        return -1;
    refiner_pick(out, view, &r->plan.net);
    if (refine_is_seen(r, out) && refiner_repeat(out, view, &r->plan.net))
        return 1;
    memcpy(r->seen, r->seen + n, n * sizeof *r->seen);
    r->has_seen = true;
    r->seen_top = r->top;
    r->seen_left = r->left;
    r->seen_photo = r->shown;
    return 0;
}

/* The network on the planned part; out is its rgb. */
static int refine_forward(float *out, struct refine *r,
                          const struct feat *in, struct error *err)
{
    static const float straight[RELATIVE_POSE_SIZE] = {0};
    const bool inside = r->top + r->plan.height <= in->height
        && r->left + r->plan.width <= in->width;
    const bool views = refiner_views(&r->plan.net) && inside;
    const size_t at = (r->top * in->width + r->left) * in->channels;
    const struct feature_view view = {
        .f32 = in->f32 ? in->f32 + at : NULL,
        .f16 = in->f32 ? NULL : in->f16 + at,
        .stride = in->width * in->channels,
        .alpha = in->alpha ? in->alpha + r->top * in->width + r->left : NULL,
        .start = in->packed ? r->start : NULL
    };

    if (views) {
        const int rc = refine_repeat(out, r, &view, err);

        if (rc)
            return rc < 0 ? -1 : 0;
    }
    r->has_seen = r->has_seen && views;
    refiner_turn(&r->plan.net, in->turn ? in->turn : straight);
    if (views) {
        refiner_forward_view(out, &view, &r->plan.net);
        return 0;
    }
    if (out != r->out && in->f32) {         /* all of it */
        refiner_forward(out, in->f32, &r->plan.net);
        return 0;
    }
    r->part = refine_make_room(r->part, &r->part_room,
                               r->plan.height * r->plan.width * in->channels,
                               sizeof *r->part, err);
    if (!r->part)
        return -1;
    refine_copy_part(r, in);
    refiner_forward(out, r->part, &r->plan.net);
    return 0;
}

int refine_frame(float *rgb, struct refine *r, const struct feat *in,
                 struct error *err)
{
    struct feat unpacked;

    if (refine_check_input(r, in, err) ||
        (in->packed && refine_find_rows(r, in, err)) ||
        refine_unpack_photo(r, in, err) || refine_fit(r, in, err) ||
        refine_show_photo(r, in, err))
        return -1;
    const bool whole = r->plan.height == in->height
        && r->plan.width == in->width;
    if (in->packed && !(whole && refiner_views(&r->plan.net))) {
        if (refine_unpack(&unpacked, r, in, err))
            return -1;
        in = &unpacked;
    }
    if (whole)
        return refine_forward(rgb, r, in, err);
    r->out = refine_make_room(r->out, &r->out_room,
                              r->plan.height * r->plan.width * 3,
                              sizeof *r->out, err);
    if (!r->out || refine_forward(r->out, r, in, err))
        return -1;
    refine_copy_coarse(rgb, r, in);
    refine_copy_back(rgb, r, in);
    return 0;
}

struct texture_field refine_field(float *said, const struct refine *r,
                                  const struct feat *in)
{
    const float *from = r->shown ? refiner_field(&r->plan.net) : NULL;
    const size_t step = TEXTURE_FIELD_STEP, w = r->plan.width / step;
    const struct texture_field f = {from ? said : NULL,
                                    refine_places(in->height),
                                    refine_places(in->width)};

    if (!from)
        return f;
    memset(said, 0, TEXTURE_FIELD * f.height * f.width * sizeof *said);
    for (size_t y = 0; y < r->plan.height / step; y++)
        memcpy(said + TEXTURE_FIELD * ((y + r->top / step) * f.width +
                                       r->left / step),
               from + TEXTURE_FIELD * y * w, TEXTURE_FIELD * w * sizeof *said);
    return f;
}
