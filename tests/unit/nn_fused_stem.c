/* The narrow refiner's first layer against plain loops in double (relative to
 * the largest value 1e-5); half floats against the same values as floats, a
 * part of a wider image against its copy, packed pixels against the picture
 * they stand for, and 1, 2 and 7 threads against each other: the same bits;
 * and the refiner's inference against its training forward (1e-4: other sums'
 * order, values near 1). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/half.h"
#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/net/narrow_refiner.h"
#include "lib/nn/fused_stem.h"
#include "lib/base/covered.h"
#include "tests/check.h"

static const struct shape {
    size_t B, h, w, C, O;
} shapes[] = {
    { 1, 4, 140, 32, 16 }, { 2, 6, 34, 12, 16 }, { 1, 2, 2, 3, 16 },
    { 1, 8, 70, 32, 48 }, { 1, 66, 98, 32, 16 }
};

static struct error err;
static void stem_must(int rc)
{
    if (rc) {
        printf("%s\n", err.text);
        exit(1);
    }
}

static void check_same(bool ok, const char *what, const struct shape *s)
{
    CHECK(ok, "%zux%zu, %zu -> %zu: %s differs", s->w, s->h, s->C, s->O, what);
}

/* out (B,h/2,w/2,O), plainly; the largest value. */
static double stem_plain(double *out, const float *in, const struct conv *c,
                         const struct shape *s)
{
    const float *w = param_w(c->ps, c->weight), *b = param_w(c->ps, c->bias);
    size_t oh = s->h / 2, ow = s->w / 2;
    double max = 0;

    for (size_t i = 0; i < s->B * oh * ow * s->O; i++) {
        size_t o = i % s->O, x = i / s->O % ow, y = i / s->O / ow;
        double sum = (double)b[o];

        for (size_t k = 0; k < 4 * s->C; k++) {
            size_t ch = k / 4, dy = k % 4 / 2, dx = k % 2;

            sum += (double)in[((2 * y + dy) * s->w + 2 * x + dx) * s->C + ch] *
                   (double)w[(o * s->C + ch) * 4 + dy * 2 + dx];
        }
        out[i] = sum > 0 ? sum : (double)ACT_SLOPE * sum;
        max = fmax(max, fabs(out[i]));
    }
    return max;
}

/* Values that half floats hold, among them zero and the tiny ones. */
static void stem_values(uint16_t *half, float *in, size_t n)
{
    struct random r;

    random_init(&r, 5, "fold");
    for (size_t i = 0; i < n; i++) {
        half[i] = i % 97 == 5 ? (uint16_t)(i % 1024)
                              : float_to_half((float)random_normal(&r));
        in[i] = half_to_float(half[i]);
    }
}

static float *stem_floats(size_t n)
{
    return malloc(n * sizeof(float));
}

/* Features with holes, some of them whole pieces: packed, in halves and in
 * floats, they give the bits of the picture with zeros there. */
static void run_packed(const struct fused_stem *f, float *in, uint16_t *half,
                       const struct shape *s)
{
    size_t C = s->C, rows = s->B * s->h, pixels = rows * s->w;
    size_t outs = pixels / 4 * s->O;
    float *alpha = stem_floats(pixels), *few = stem_floats(pixels * C);
    float *out[2] = { stem_floats(outs), stem_floats(outs) };
    float *rgb[2] = { stem_floats(3 * pixels), stem_floats(3 * pixels) };
    size_t *start = malloc(rows * sizeof *start), count = 0;

    for (size_t i = 0; i < pixels; i++) {
        size_t x = i % s->w, y = i / s->w;

        alpha[i] = (x / 3 + y) % 5 && x < 70 && y % 7 < 4 ? 0.5f : 0;
        if (alpha[i] != 0) {
            memmove(half + count * C, half + i * C, C * sizeof *half);
            memcpy(few + count * C, in + i * C, C * sizeof *few);
            count++;
        } else {
            memset(in + i * C, 0, C * sizeof *in);
        }
    }
    check_same(covered_rows(start, alpha, rows, s->w) == count, "a count", s);
    struct feature_view whole = { .f32 = in, .stride = s->w * C };
    struct feature_view views[] = {
        { NULL, half, s->w * C, alpha, start },
        { few, NULL, s->w * C, alpha, start }
    };
    fused_stem_forward(out[0], rgb[0], &whole, f);
    for (int k = 0; k < 4; k++) {
        parallel_set_width(1 + k / 2);
        memset(out[1], 0xff, outs * sizeof(float));
        memset(rgb[1], 0xff, 3 * pixels * sizeof(float));
        fused_stem_forward(out[1], rgb[1], &views[k % 2], f);
        check_same(!memcmp(out[0], out[1], outs * sizeof(float)) &&
                       !memcmp(rgb[0], rgb[1], 3 * pixels * sizeof(float)),
                   "what came packed", s);
    }
    for (int k = 0; k < 2; k++) {
        free(out[k]);
        free(rgb[k]);
    }
    free(alpha);
    free(few);
    free(start);
}

static void stem_run(const struct shape *s)
{
    struct params ps;
    struct conv c;
    struct fused_stem f;
    struct nn_plan p;
    size_t rows = s->B * s->h, row = s->w * s->C, n = rows * row;
    size_t outs = rows / 2 * (s->w / 2) * s->O, pixels = rows * s->w;
    size_t wide = row + 3 * s->C;
    float *in = stem_floats(n), *part = stem_floats(rows * wide);
    float *out = stem_floats(outs), *rgb = stem_floats(3 * pixels);
    float *out2 = stem_floats(outs), *rgb2 = stem_floats(3 * pixels);
    uint16_t *half = malloc(n * sizeof *half);
    double *truth = malloc(outs * sizeof *truth), worst = 0;

    params_init(&ps);
    conv_init(&c, &ps, "c", s->C, s->O, 2, 2, true);
    c.pad = CONV_NONE;
    c.act = ACT_LRELU;
    stem_must(params_allocate(&ps, &err));
    params_randomise(&ps, 2);
    for (size_t o = 0; o < s->O; o++)
        param_w(&ps, c.bias)[o] = 0.01f * (float)o;
    parallel_set_width(7);
    nn_plan_init(&p, (struct nn_options){ NN_INFER, NN_F32 });
    check_same(fused_stem_possible(&c), "whether it is possible", s);
    fused_stem_plan(&f, &c, &p, s->B, s->h, s->w);
    stem_must(nn_plan_finish(&p, &err));
    stem_values(half, in, n);
    for (size_t y = 0; y < rows; y++)
        memcpy(part + y * wide, in + y * row, row * sizeof *in);
    double max = stem_plain(truth, in, &c, s);
    fused_stem_forward(out, rgb,
                       &(struct feature_view){ .f32 = in, .stride = row }, &f);
    for (size_t i = 0; i < outs; i++)
        worst = fmax(worst, fabs((double)out[i] - truth[i]));
    printf("%zux%zu, %zu -> %zu: error %.1e of the largest value\n", s->w,
           s->h, s->C, s->O, worst / max);
    check_same(worst < 1e-5 * max, "the sum", s);
    for (size_t i = 0; i < 3 * pixels; i++)
        check_same(rgb[i] == in[i / 3 * s->C + i % 3], "the coarse picture", s);
    const struct feature_view views[] = {
        { .f16 = half, .stride = row }, { .f32 = part, .stride = wide }
    };
    for (int k = 0; k < 4; k++) {
        parallel_set_width(1 + k / 2);
        fused_stem_forward(out2, rgb2, &views[k % 2], &f);
        check_same(!memcmp(out, out2, outs * sizeof *out) &&
                       !memcmp(rgb, rgb2, 3 * pixels * sizeof *rgb),
                   k % 2 ? "a part" : "half floats", s);
    }
    run_packed(&f, in, half, s);
    nn_plan_release(&p);
    params_release(&ps);
    free(in);
    free(part);
    free(out);
    free(rgb);
    free(out2);
    free(rgb2);
    free(half);
    free(truth);
}

/* rgb of the planned mode */
static void stem_refine(float *rgb, const float *feat, struct params *ps,
                        enum nn_mode mode)
{
    struct narrow_refiner r;
    struct params declared;

    params_init(&declared);
    narrow_refiner_init(&r, &declared, "r.", 32, 32, false, false);
    stem_must(params_allocate(&declared, &err));
    stem_must(params_allocate_gradients(&declared, &err));
    memcpy(declared.w, ps->w, ps->total * sizeof *ps->w);
    stem_must(narrow_refiner_plan(&r, 1, 64, 96,
                                  (struct nn_options){mode, NN_F32}, &err));
    narrow_refiner_forward(rgb, feat, &r);
    narrow_refiner_release(&r);
    params_release(&declared);
}

static void stem_whole(void)
{
    static float feat[64 * 96 * 32], a[64 * 96 * 3], b[64 * 96 * 3];
    struct narrow_refiner r;
    struct params ps;
    struct random rnd;
    double worst = 0;

    params_init(&ps);
    narrow_refiner_init(&r, &ps, "r.", 32, 32, false, false);
    stem_must(params_allocate(&ps, &err));
    params_randomise(&ps, 4);
    random_init(&rnd, 6, "fold whole");
    float *w = param_w(&ps, params_find(&ps, "r.rgb.weight"));
    for (size_t i = 0; i < 48 * 32 * 9; i++)
        w[i] = (float)random_range(&rnd, -0.05, 0.05);
    for (size_t i = 0; i < 64 * 96 * 32; i++)
        feat[i] = (float)random_uniform(&rnd);
    stem_refine(a, feat, &ps, NN_INFER);
    stem_refine(b, feat, &ps, NN_FROZEN);
    for (size_t i = 0; i < 64 * 96 * 3; i++)
        worst = fmax(worst, fabs((double)a[i] - (double)b[i]));
    check("the refiner's inference against its training", worst, 1e-4);
    narrow_refiner_release(&r);
    params_release(&ps);
}

int main(void)
{
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++)
        stem_run(&shapes[i]);
    stem_whole();
    return check_status();
}
