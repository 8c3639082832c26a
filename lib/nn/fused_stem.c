/* The narrow refiner's first layer in one pass over the feature image: half
 * floats widened, packed rows spread, the coarse picture picked out. */
#include "lib/nn/fused_stem.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/act.h"
#include "lib/nn/kernels.h"
#include "lib/base/covered.h"

#define PIECE 32

bool fused_stem_possible(const struct conv *c)
{
    return c->kernel == 2 && c->stride == 2 && c->pad == CONV_NONE &&
           c->act == ACT_LRELU && c->out % 16 == 0 && c->bias != NN_NONE &&
           c->in >= 3;
}

/* The weights as the kernels read them. */
static void fused_stem_update(void *layer)
{
    struct fused_stem *f = layer;
    const struct conv *c = f->c;
    const float *w = param_w(c->ps, c->weight);      /* (out,in,2,2) */

    memcpy(f->bias, param_w(c->ps, c->bias), c->out * sizeof *f->bias);
    for (size_t o = 0; o < c->out; o++) {
        float sum = f->bias[o] + 0.0f;      /* no -0, as the sum's */

        f->empty[o] = sum > ACT_SLOPE * sum ? sum : ACT_SLOPE * sum;
    }
    for (size_t o = 0; o < c->out; o++)
        for (size_t i = 0; i < c->in; i++)
            for (size_t k = 0; k < 4; k++)
                f->weight[((o / 16 * 4 + k) * c->in + i) * 16 + o % 16] =
                    w[(o * c->in + i) * 4 + k];
}

void fused_stem_plan(struct fused_stem *f, const struct conv *c,
                     struct nn_plan *p, size_t batch, size_t h, size_t w)
{
    *f = (struct fused_stem){ .c = c, .batch = batch, .h = h, .w = w };
    nn_plan_layer(p, (struct nn_layer){f, fused_stem_update, NULL});
    f->line = 4 * PIECE * c->in;
    f->weight = nn_plan_floats(p, c->out * 4 * c->in);
    f->bias = nn_plan_floats(p, c->out);
    f->empty = nn_plan_floats(p, c->out);
    f->wide = nn_plan_floats(p, f->line * (size_t)parallel_width());
}

/* n pixels of a packed row into wide, zeros where none is; how many there
 * were.  at: the first one's place. */
static size_t fused_stem_unpack(float *wide, const struct feature_view *in,
                                const float *alpha, size_t at, size_t n,
                                size_t C)
{
    size_t first = at;

    for (size_t x = 0, end; x < n; x = end) {
        end = covered_run(alpha, x, n);
        if (alpha[x] == 0) {
            memset(wide + x * C, 0, (end - x) * C * sizeof *wide);
            continue;
        }
        if (in->f32)
            memcpy(wide + x * C, in->f32 + at * C,
                   (end - x) * C * sizeof *wide);
        else
            nn_kernels()->widen(wide + x * C, in->f16 + at * C,
                                (end - x) * C);
        at += end - x;
    }
    return at - first;
}

/* Whether one of n pixels of a row is covered. */
static bool fused_stem_covered(const float *alpha, size_t n)
{
    uint32_t bits = 0;

    for (size_t x = 0; x < n; x++) {
        uint32_t one;

        memcpy(&one, alpha + x, sizeof one);
        bits |= one;
    }
    return bits << 1 != 0;
}

/* What the kernel reads of the next 2 n pixels from x on in rows 2 r and
 * 2 r + 1, and what will follow it; false when all of it is zeros.  at: of
 * packed rows, the places. */
static bool fused_stem_gather(struct fused_stem_rows *rows, float *wide,
                              size_t at[2], const struct feature_view *in,
                              const struct fused_stem *f, size_t r, size_t x,
                              size_t n)
{
    size_t C = f->c->in, from = 2 * r * in->stride + 2 * x * C, some = 0;
    size_t ahead = from + 2 * PIECE * C;

    if (in->alpha && !in->start &&
        !fused_stem_covered(in->alpha + from / C, 2 * n) &&
        !fused_stem_covered(in->alpha + (from + in->stride) / C, 2 * n))
        return false;
    for (size_t y = 0; y < 2; y++, from += in->stride, ahead += in->stride) {
        float *to = wide + y * 2 * n * C;

        rows->row[y] = to;
        rows->step = 16 * (in->f32 ? sizeof *in->f32 : sizeof *in->f16);
        if (in->start) {
            size_t took = fused_stem_unpack(to, in, in->alpha + from / C,
                                            at[y], 2 * n, C);

            some += took;
            at[y] += took;
            ahead = at[y] * C;
        } else if (in->f32) {
            rows->row[y] = in->f32 + from;
        } else {                 /* widened into the nearest cache */
            nn_kernels()->widen(to, in->f16 + from, 2 * n * C);
        }
        rows->next[y] = in->f32 ? (const char *)(in->f32 + ahead)
                                : (const char *)(in->f16 + ahead);
    }
    return some || !in->start;
}

/* Row r of the output, PIECE pixels at a time. */
PARALLEL(fused_stem_line, r, float *, out, float *, rgb,
         const struct feature_view *, in, const struct fused_stem *, f)
{
    const struct nn_kernels *k = nn_kernels();
    size_t C = f->c->in, O = f->c->out, half = f->w / 2;
    size_t at[2] = { in->start ? in->start[2 * r] : 0,
                     in->start ? in->start[2 * r + 1] : 0 };
    float *wide = f->wide + parallel_slot() * f->line;
    struct fused_stem_rows rows;

    for (size_t x = 0, n; x < half; x += n) {
        n = half - x < PIECE ? half - x : PIECE;
        float *to = out + (r * half + x) * O;
        float *picked = rgb + (2 * r * f->w + 2 * x) * 3;
        if (fused_stem_gather(&rows, wide, at, in, f, r, x, n)) {
            k->fused_stem_row(to, &rows, f->weight, f->bias, n, C, O);
            for (size_t y = 0; y < 2; y++)
                k->pick_rgb(picked + y * f->w * 3, rows.row[y], 2 * n, C);
            continue;
        }
        for (size_t i = 0; i < n; i++)
            memcpy(to + i * O, f->empty, O * sizeof *to);
        for (size_t y = 0; y < 2; y++)
            memset(picked + y * f->w * 3, 0, 2 * n * 3 * sizeof *picked);
    }
}

void fused_stem_forward(float *out, float *rgb, const struct feature_view *in,
                        const struct fused_stem *f)
{
    parallel_each(fused_stem_line, f->batch * (f->h / 2), 1, out, rgb, in, f);
}

/* Row y of the picture. */
PARALLEL(fused_stem_pick_line, y, float *, rgb, const struct feature_view *, in,
         const struct fused_stem *, f)
{
    const struct nn_kernels *k = nn_kernels();
    const size_t C = f->c->in, w = f->w;
    const float *alpha = in->alpha ? in->alpha + y * (in->stride / C) : NULL;
    size_t at = in->start ? in->start[y] * C : y * in->stride;

    rgb += 3 * y * w;
    for (size_t x = 0, end; x < w; x = end) {
        end = alpha ? covered_run(alpha, x, w) : w;
        const bool empty = alpha && alpha[x] == 0;

        if (empty)
            memset(rgb + 3 * x, 0, 3 * (end - x) * sizeof *rgb);
        else if (in->f32)
            k->pick_rgb(rgb + 3 * x, in->f32 + at, end - x, C);
        else
            k->pick_rgb_half(rgb + 3 * x, in->f16 + at, end - x, C);
        if (!empty || !in->start)
            at += (end - x) * C;
    }
}

void fused_stem_pick(float *rgb, const struct feature_view *in,
                     const struct fused_stem *f)
{
    parallel_each(fused_stem_pick_line, f->batch * f->h, 1, rgb, in, f);
}
