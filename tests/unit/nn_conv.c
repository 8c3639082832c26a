/* Convolutions and depthwise convolutions of odd sizes against plain loops in
 * double: output, input gradient, weight and bias gradients; and the same bits
 * for 1, 2 and 7 threads.  Errors are relative to the largest value: 1e-5 for
 * sums in float, 6e-5 for Winograd, 1e-2 for bfloat16 and 8-bit values. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/random.h"
#include "lib/nn/depthwise.h"
#include "lib/nn/form.h"
#include "lib/nn/image.h"
#include "tests/check.h"
#include "tests/reference/act.h"

enum kind {
    FLOATS,
    HALVES,                     /* products of bfloat16, no bias */
    KEPT,                       /* and bfloat16 in memory, with a bias */
    DEPTHWISE
};

struct shape {
    size_t B, h, w, in, out, k, s;
    enum conv_pad pad;
    enum nn_act act;
    enum kind kind;
};

static const struct shape shapes[] = {
    { 1, 5, 7, 3, 8, 3, 2, CONV_HALF, ACT_RELU, FLOATS },
    { 2, 9, 6, 16, 24, 3, 1, CONV_HALF, ACT_LRELU, FLOATS },
    { 5, 4, 4, 8, 5, 1, 1, CONV_HALF, ACT_NONE, FLOATS },
    { 1, 33, 1, 27, 40, 1, 1, CONV_HALF, ACT_RELU, FLOATS },
    { 3, 11, 8, 3, 16, 3, 2, CONV_SAME, ACT_NONE, FLOATS },
    { 1, 16, 24, 12, 16, 2, 2, CONV_NONE, ACT_LRELU, FLOATS },
    { 1, 8, 8, 256, 32, 3, 1, CONV_HALF, ACT_LRELU, FLOATS },   /* in pieces */
    { 2, 37, 31, 272, 40, 3, 1, CONV_HALF, ACT_RELU, FLOATS },  /* two bands */
    { 1, 9, 14, 96, 24, 3, 2, CONV_HALF, ACT_NONE, FLOATS },
    { 1, 40, 1, 600, 33, 1, 1, CONV_HALF, ACT_LRELU, FLOATS },
    { 3, 1, 1, 517, 70, 1, 1, CONV_HALF, ACT_LRELU, FLOATS },   /* few rows */
    { 2, 9, 13, 24, 40, 1, 1, CONV_HALF, ACT_NONE, HALVES },
    { 1, 31, 26, 32, 24, 3, 1, CONV_HALF, ACT_NONE, HALVES },
    { 3, 18, 13, 16, 48, 3, 2, CONV_HALF, ACT_NONE, HALVES },
    { 1, 33, 16, 80, 33, 3, 1, CONV_SAME, ACT_NONE, HALVES },
    { 3, 15, 7, 54, 30, 1, 1, CONV_HALF, ACT_NONE, HALVES },
    { 1, 1, 1, 8, 72, 1, 1, CONV_HALF, ACT_NONE, HALVES },
    { 1, 331, 1, 27, 40, 1, 1, CONV_HALF, ACT_NONE, HALVES },   /* strips */
    { 2, 150, 1, 12, 9, 1, 1, CONV_HALF, ACT_NONE, HALVES },
    { 2, 46, 150, 33, 17, 3, 1, CONV_HALF, ACT_NONE, HALVES },  /* chunks */
    { 1, 34, 62, 12, 16, 2, 2, CONV_NONE, ACT_NONE, HALVES },
    { 1, 40, 41, 48, 50, 5, 2, CONV_SAME, ACT_NONE, HALVES },
    { 1, 29, 34, 32, 32, 3, 1, CONV_HALF, ACT_NONE, KEPT },
    { 2, 26, 21, 16, 2, 3, 1, CONV_HALF, ACT_NONE, KEPT },
    { 1, 300, 1, 32, 41, 1, 1, CONV_HALF, ACT_NONE, KEPT },
    { 1, 300, 1, 32, 48, 1, 1, CONV_HALF, ACT_NONE, KEPT },
    { 1, 600, 1, 32, 17, 1, 1, CONV_HALF, ACT_NONE, HALVES },
    { 2, 13, 10, 20, 20, 3, 1, CONV_HALF, ACT_NONE, DEPTHWISE },
    { 1, 15, 9, 24, 24, 5, 2, CONV_HALF, ACT_NONE, DEPTHWISE },
    { 4, 7, 7, 40, 40, 5, 1, CONV_SAME, ACT_NONE, DEPTHWISE },
    { 1, 12, 31, 16, 16, 3, 2, CONV_SAME, ACT_NONE, DEPTHWISE },
};

/* What one layer gives, as floats or doubles. */
struct result {
    size_t out_n, in_n, w_n, b_n;
    double *out, *din, *dw, *db;
};

static void conv_test_reserve(struct result *r)
{
    r->out = calloc(r->out_n, sizeof(double));
    r->din = calloc(r->in_n, sizeof(double));
    r->dw = calloc(r->w_n, sizeof(double));
    r->db = calloc(r->b_n + 1, sizeof(double));
}

static void conv_test_drop(struct result *r)
{
    free(r->out);
    free(r->din);
    free(r->dw);
    free(r->db);
}

static void conv_test_sides(const struct shape *s, size_t n, size_t *o,
                            long *before)
{
    if (s->pad == CONV_SAME) {
        *o = (n + s->s - 1) / s->s;
        long need = (long)((*o - 1) * s->s + s->k) - (long)n;
        *before = need > 0 ? need / 2 : 0;
    } else {
        *before = s->pad == CONV_HALF ? (long)s->k / 2 : 0;
        *o = (n + 2 * (size_t)*before - s->k) / s->s + 1;
    }
}

/* One tap: x in the input, w in the weight; -1 outside. */
static long conv_test_tap(const struct shape *s, long py, long px, size_t b,
                          size_t y, size_t x, size_t ky, size_t kx, size_t c)
{
    long yy = (long)(y * s->s + ky) - py, xx = (long)(x * s->s + kx) - px;

    if (yy < 0 || yy >= (long)s->h || xx < 0 || xx >= (long)s->w)
        return -1;
    return (long)(((b * s->h + (size_t)yy) * s->w + (size_t)xx) * s->in + c);
}

/* Plain loops: the forward when dout is NULL, else the backward. */
static void conv_test_reference(struct result *r, const float *in,
                                const float *w, const float *bias,
                                const float *dout, const struct shape *s,
                                size_t oh, size_t ow)
{
    size_t o_, group = s->kind == DEPTHWISE ? 1 : s->in;
    long py, px;

    conv_test_sides(s, s->h, &o_, &py);
    conv_test_sides(s, s->w, &o_, &px);
    for (size_t i = 0; i < r->out_n; i++) {
        size_t o = i % s->out, x = i / s->out % ow;
        size_t y = i / s->out / ow % oh, b = i / s->out / ow / oh;
        double sum = bias ? (double)bias[o] : 0, g = 0;

        if (dout)
            g = (double)dout[i] * act_slope(s->act, r->out[i]);
        for (size_t ci = 0; ci < group; ci++)
            for (size_t t = 0; t < s->k * s->k; t++) {
                size_t c = s->kind == DEPTHWISE ? o : ci;
                long at = conv_test_tap(s, py, px, b, y, x, t / s->k, t % s->k,
                                        c);
                size_t wi = (o * group + ci) * s->k * s->k + t;

                if (at < 0)
                    continue;
                sum += (double)in[at] * (double)w[wi];
                r->din[at] += g * (double)w[wi];
                r->dw[wi] += g * (double)in[at];
            }
        r->db[o] += g;
        if (!dout)
            r->out[i] = act_value(s->act, sum);
    }
}

static void conv_test_compare(const char *what, const struct shape *s,
                              const float *x, const double *truth, size_t n,
                              double tolerance)
{
    double worst = 0, max = 1e-30;

    for (size_t i = 0; i < n; i++) {
        worst = fmax(worst, fabs((double)x[i] - truth[i]));
        max = fmax(max, fabs(truth[i]));
    }
    CHECK(worst <= tolerance * max,
          "%s of %zux%zux%zux%zu -> %zu, kernel %zu, stride %zu: error %.2g "
          "of the largest", what, s->B, s->h, s->w, s->in, s->out, s->k, s->s,
          worst / max);
}

static uint64_t conv_test_bits(uint64_t sum, const float *x, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        uint32_t u;

        memcpy(&u, x + i, sizeof u);
        sum = random_mix(sum ^ u);
    }
    return sum;
}

static float *conv_test_noise(size_t n, uint64_t seed)
{
    struct random r;
    float *x = malloc(n * sizeof *x);

    random_init(&r, seed, "nn_conv");
    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_range(&r, -1, 1);
    return x;
}

/* n floats from bfloat16. */
static void conv_test_widen(float *y, const uint16_t *x, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const uint32_t u = (uint32_t)x[i] << 16;

        memcpy(y + i, &u, sizeof u);
    }
}

/* Forward and backward, through maps of bfloat16 where the layer has those; n
 * numbers come out. */
static void conv_test_layer(float *out, float *din, float *g, const float *in,
                            const struct shape *s, struct conv *c, size_t n)
{
    const size_t m = s->B * s->h * s->w * s->in;

    if (!c->half_in) {
        conv_forward(out, in, c);
        conv_backward(din, g, out, in, c);
        return;
    }
    uint16_t *half = malloc((2 * m + 2 * n) * sizeof *half);
    uint16_t *dhalf = half + m, *y = dhalf + m, *dy = y + n;

    image_to_bf16(half, in, m);
    image_to_bf16(dy, g, n);
    if (c->half_out) {
        conv_forward(y, half, c);
        conv_backward(dhalf, dy, y, half, c);
        conv_test_widen(out, y, n);
    } else {
        conv_forward(out, half, c);
        conv_backward(dhalf, g, out, half, c);
    }
    conv_test_widen(din, dhalf, m);
    free(half);
}

/* Run the layer; its gradients stay in ps->g.  Returns a hash of all bits. */
static uint64_t conv_test_run(float *out, float *din, struct params *ps,
                              const float *in, const float *dout,
                              const struct shape *s, size_t oh, size_t ow)
{
    struct conv c;
    struct depthwise d;
    struct nn_plan p;
    struct error err = { 0 };
    size_t n = s->B * oh * ow * s->out;
    float *g = malloc(n * sizeof *g);

    memcpy(g, dout, n * sizeof *g);
    const bool halves = s->kind == HALVES || s->kind == KEPT;
    enum nn_type type = halves ? NN_BF16 : NN_F32;
    nn_plan_init(&p, (struct nn_options){ NN_TRAIN, type });
    params_init(ps);
    if (s->kind == DEPTHWISE)
        depthwise_init(&d, ps, "c", s->in, s->k, s->s);
    else
        conv_init(&c, ps, "c", s->in, s->out, s->k, s->s, s->kind != HALVES);
    if (params_allocate(ps, &err) || params_allocate_gradients(ps, &err))
        exit(1);
    params_randomise(ps, 5);
    if (s->kind == DEPTHWISE) {
        d.pad = s->pad;
        depthwise_plan(&d, &p, s->B, s->h, s->w);
    } else {
        c.pad = s->pad;
        c.act = s->act;
        c.half_in = s->kind == KEPT && conv_halves(&p);
        c.half_out = c.half_in && (s->k > 1 || s->out % 16 == 0);
        conv_plan(&c, &p, s->B, s->h, s->w);
    }
    if (nn_plan_finish(&p, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    if (s->kind == DEPTHWISE) {
        depthwise_forward(out, in, &d);
        depthwise_backward(din, g, in, &d);
    } else {
        conv_test_layer(out, din, g, in, s, &c, n);
    }
    nn_plan_release(&p);
    free(g);
    uint64_t sum = conv_test_bits(conv_test_bits(0, out, n), din,
                                  s->B * s->h * s->w * s->in);
    return conv_test_bits(sum, ps->g, ps->total);
}

static void check_shape(const struct shape *s)
{
    size_t oh, ow;
    long unused;
    struct params ps;

    conv_test_sides(s, s->h, &oh, &unused);
    conv_test_sides(s, s->w, &ow, &unused);
    struct result r = { .out_n = s->B * oh * ow * s->out,
                        .in_n = s->B * s->h * s->w * s->in,
                        .w_n = s->out * s->k * s->k *
                               (s->kind == DEPTHWISE ? 1 : s->in),
                        .b_n = s->out };
    conv_test_reserve(&r);
    float *in = conv_test_noise(r.in_n, 1), *dout = conv_test_noise(r.out_n, 2);
    float *out = malloc(r.out_n * sizeof *out);
    float *din = malloc(r.in_n * sizeof *din);
    uint64_t first = 0;
    static const int threads[] = { 1, 2, 7 };
    for (int i = 0; i < 3; i++) {
        parallel_set_width(threads[i]);
        uint64_t hash = conv_test_run(out, din, &ps, in, dout, s, oh, ow);
        CHECK(!i || hash == first,
              "%zux%zux%zu -> %zu, kernel %zu: other bits with %d threads",
              s->h, s->w, s->in, s->out, s->k, threads[i]);
        first = i ? first : hash;
        if (i < 2)
            params_release(&ps);
    }
    const float *w = param_w(&ps, 0);
    const bool halves = s->kind == HALVES || s->kind == KEPT;
    const float *b = s->kind == FLOATS || s->kind == KEPT ? param_w(&ps, 1)
                                                          : NULL;
    double max = halves ? 1e-2 : 1e-5;
    conv_test_reference(&r, in, w, b, NULL, s, oh, ow);
    conv_test_compare("output", s, out, r.out, r.out_n, max);
    memset(r.din, 0, r.in_n * sizeof(double));
    memset(r.dw, 0, r.w_n * sizeof(double));
    conv_test_reference(&r, in, w, b, dout, s, oh, ow);
    conv_test_compare("input gradient", s, din, r.din, r.in_n, max);
    conv_test_compare("weight gradient", s, param_g(&ps, 0), r.dw, r.w_n, max);
    if (b)
        conv_test_compare("bias gradient", s, param_g(&ps, 1), r.db, r.b_n,
                          max);
    params_release(&ps);
    conv_test_drop(&r);
    free(in);
    free(dout);
    free(out);
    free(din);
}

/* Winograd against the direct convolution. */
static void check_winograd(size_t h, size_t w, size_t in, size_t out)
{
    struct shape s = { 2, h, w, in, out, 3, 1, CONV_HALF, ACT_LRELU, FLOATS };
    struct params ps;
    struct conv c;
    struct nn_plan p;
    struct error err = { 0 };
    struct result r = { 2 * h * w * out, 2 * h * w * in, 9 * in * out, out,
                        NULL, NULL, NULL, NULL };

    conv_test_reserve(&r);
    float *x = conv_test_noise(r.in_n, 3), *y = malloc(r.out_n * sizeof *y);
    params_init(&ps);
    conv_init(&c, &ps, "c", in, out, 3, 1, true);
    c.act = ACT_LRELU;
    if (params_allocate(&ps, &err))
        exit(1);
    params_randomise(&ps, 5);
    form_prefer(FORM_WINOGRAD);
    nn_plan_init(&p, (struct nn_options){ NN_INFER, NN_FAST });
    conv_plan(&c, &p, 2, h, w);
    if (nn_plan_finish(&p, &err))
        exit(1);
    conv_forward(y, x, &c);
    conv_test_reference(&r, x, param_w(&ps, 0), param_w(&ps, 1), NULL, &s, h,
                        w);
    conv_test_compare("Winograd", &s, y, r.out, r.out_n, 6e-5);
    form_prefer(FORM_FLOAT);
    nn_plan_release(&p);
    params_release(&ps);
    conv_test_drop(&r);
    free(x);
    free(y);
}

/* 8-bit values: every kind of padding, sums with what is there, and the same
 * bits for any number of threads. */
static void check_int8(const struct shape *s, bool add)
{
    size_t oh, ow;
    long unused;
    struct params ps;
    struct conv c;
    struct nn_plan p;
    struct error err = { 0 };

    conv_test_sides(s, s->h, &oh, &unused);
    conv_test_sides(s, s->w, &ow, &unused);
    struct result r = { .out_n = s->B * oh * ow * s->out,
                        .in_n = s->B * s->h * s->w * s->in,
                        .w_n = s->out * s->in * s->k * s->k, .b_n = s->out };
    conv_test_reserve(&r);
    float *x = conv_test_noise(r.in_n, 4), *y = malloc(r.out_n * sizeof *y);
    params_init(&ps);
    conv_init(&c, &ps, "c", s->in, s->out, s->k, s->s, true);
    c.pad = s->pad;
    c.act = s->act;
    c.add = add;
    if (params_allocate(&ps, &err))
        exit(1);
    params_randomise(&ps, 6);
    for (size_t o = 0; o < s->out; o++)
        param_w(&ps, 1)[o] = 0.5f - (float)(o % 3) / 2;
    for (size_t i = 0; i < r.in_n; i++)
        x[i] += 0.7f;              /* the zero point is not in the middle */
    parallel_set_width(3);
    nn_plan_init(&p, (struct nn_options){ NN_INFER, NN_INT8 });
    form_prefer(FORM_INT8);
    conv_plan(&c, &p, s->B, s->h, s->w);
    form_prefer(FORM_FLOAT);
    if (nn_plan_finish(&p, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    uint64_t first = 0;
    for (int threads = 1; threads <= 3; threads++) {
        parallel_set_width(threads);
        for (size_t i = 0; i < r.out_n; i++)
            y[i] = 0.25f;          /* added to, or overwritten */
        conv_forward(y, x, &c);
        uint64_t hash = conv_test_bits(0, y, r.out_n);
        CHECK(threads == 1 || hash == first, "8 bits: other bits with %d "
              "threads", threads);
        first = hash;
    }
    for (size_t o = 0; o < s->out && add; o++)
        param_w(&ps, 1)[o] += 0.25f;
    conv_test_reference(&r, x, param_w(&ps, 0), param_w(&ps, 1), NULL, s, oh,
                        ow);
    /* in float where there are no instructions for bytes */
    bool native = nn_type_native(NN_INT8);
    conv_test_compare("8 bits", s, y, r.out, r.out_n, native ? 1e-2 : 6e-5);
    double off = 0;
    for (size_t i = 0; i < r.out_n; i++)
        off = fmax(off, fabs((double)y[i] - r.out[i]));
    CHECK(!native || off >= 1e-4,
          "8 bits are as exact as float: they were not used");
    nn_plan_release(&p);
    params_release(&ps);
    conv_test_drop(&r);
    free(x);
    free(y);
}

int main(void)
{
    static const struct shape bytes[] = {
        { 1, 19, 23, 32, 48, 3, 1, CONV_HALF, ACT_LRELU, FLOATS },
        { 1, 40, 37, 16, 32, 3, 2, CONV_HALF, ACT_RELU, FLOATS },
        { 2, 33, 36, 32, 16, 3, 2, CONV_SAME, ACT_NONE, FLOATS },
        { 1, 38, 44, 16, 16, 2, 2, CONV_NONE, ACT_LRELU, FLOATS },
        { 3, 17, 19, 64, 32, 1, 1, CONV_HALF, ACT_NONE, FLOATS },
        { 1, 34, 35, 32, 32, 1, 2, CONV_HALF, ACT_NONE, FLOATS },
    };

    for (size_t i = 0; i < sizeof bytes / sizeof *bytes; i++)
        for (int add = 0; add < 2; add++)
            check_int8(&bytes[i], add);
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++)
        check_shape(&shapes[i]);
    check_winograd(9, 14, 32, 48);
    check_winograd(4, 3, 16, 16);
    printf("%zu convolutions against plain loops, %d differences\n",
           sizeof shapes / sizeof *shapes, check_failures);
    return check_status();
}
