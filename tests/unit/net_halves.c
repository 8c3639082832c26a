/* Networks that learn in bfloat16 against themselves in float: what comes out,
 * the input's gradient and every tensor's.  A product loses 2^-9 of each
 * factor, and a unit whose sum is about 0 may be on the other side of its kink;
 * of gradients that are noise in every pixel this takes up to a tenth (norm of
 * the difference over the norm), at random: along float's own gradient there
 * must be between 98 and 102 % of it (93 and 107 of a few numbers), so that no
 * term is missing. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/net/backbone.h"
#include "lib/net/conv_decoder.h"
#include "lib/net/plane_init.h"
#include "tests/check.h"

#define SIDE 37
#define PIXELS ((size_t)SIDE * SIDE)
#define COLORS 8
#define RAW (COLORS + 9)            /* numbers of a Gaussian, at most */
#define WIDTH 32
#define INPUTS 38

enum network { PLANE, INIT, BACKBONE, NETWORKS };
static const char *const network_name[NETWORKS] = {
    "conv_decoder", "plane_init", "backbone"};

/* What a network gives of fixed noise. */
struct halves_result {
    struct params ps;
    float out[PIXELS * (RAW > INPUTS ? RAW : INPUTS)];
    float din[PIXELS * INPUTS], ddir[3];
    size_t outs, ins;
};

static const float dir[3] = {0.2f, -0.3f, 0.93f};

static void halves_noise(float *x, size_t n, const char *what)
{
    struct random r;

    random_init(&r, 5, what);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)random_normal(&r);
}

/* The attributes of all Gaussians, one after another in memory. */
static struct gaussian_out halves_views(float *at)
{
    return (struct gaussian_out){
        at, at + COLORS * PIXELS, at + (COLORS + 1) * PIXELS,
        at + (COLORS + 4) * PIXELS, at + (COLORS + 8) * PIXELS};
}

/* Tensors that start as zeros would hide what lies before them. */
static void halves_weights(struct params *ps)
{
    struct error err = {0};
    struct random r;

    if (params_allocate(ps, &err) || params_allocate_gradients(ps, &err))
        exit(1);
    params_randomise(ps, 3);
    random_init(&r, 4, "bias");
    for (size_t i = 0; i < ps->total; i++)
        ps->w[i] += ps->w[i] == 0 ? 0.05f * (float)random_normal(&r) : 0;
}

static void halves_plane(struct halves_result *r, struct nn_options opt,
                         const float *in, const float *dout)
{
    struct gaussian_head head = {.colors = COLORS,
                                 .position = GAUSSIAN_POSITION_DEPTH};
    struct conv_decoder d;
    struct error err = {0};
    struct gaussian_out out = halves_views(r->out);
    static float copy[PIXELS * RAW];

    memcpy(copy, dout, sizeof copy);
    struct gaussian_out back = halves_views(copy);
    r->outs = PIXELS * RAW;
    r->ins = PIXELS * INPUTS;
    conv_decoder_init(&d, &r->ps, "", INPUTS, WIDTH, head);
    halves_weights(&r->ps);
    if (conv_decoder_plan(&d, 1, SIDE, SIDE, opt, &err))
        exit(1);
    conv_decoder_forward(&out, in, dir, NULL, &d);
    conv_decoder_backward(r->din, r->ddir, NULL, &back, dir, NULL, &d);
    conv_decoder_release(&d);
}

static void halves_init(struct halves_result *r, struct nn_options opt,
                        const float *in, const float *dout)
{
    struct plane_init d;
    struct error err = {0};

    r->outs = PIXELS * 2;
    r->ins = PIXELS * 33;
    plane_init_init(&d, &r->ps, "", 33, 16);
    halves_weights(&r->ps);
    if (plane_init_plan(&d, SIDE, SIDE, opt, &err))
        exit(1);
    plane_init_forward(r->out, in, &d);
    plane_init_backward(r->din, dout, &d);
    plane_init_release(&d);
}

static void halves_backbone(struct halves_result *r, struct nn_options opt,
                            const float *in, const float *dout)
{
    const struct backbone_config c = {.type = BACKBONE_SMALL, .width = 16,
                                      .features = 32, .size = SIDE};
    struct backbone d;
    struct error err = {0};

    r->outs = PIXELS * 32;
    if (backbone_init(&d, &r->ps, "", &c, &err))
        exit(1);
    halves_weights(&r->ps);
    if (backbone_plan(&d, 1, SIDE, opt, &err))
        exit(1);
    backbone_forward(r->out, in, &d);
    backbone_backward(dout, &d);
    backbone_release(&d);
}

/* |a - b| / |b|. */
static double halves_distance(const float *a, const float *b, size_t n)
{
    double far = 0, all = 1e-30;

    for (size_t i = 0; i < n; i++) {
        const double d = (double)a[i] - (double)b[i];

        far += d * d;
        all += (double)b[i] * (double)b[i];
    }
    return sqrt(far / all);
}

/* a.b / b.b. */
static double halves_along(const float *a, const float *b, size_t n)
{
    double dot = 0, all = 1e-30;

    for (size_t i = 0; i < n; i++) {
        dot += (double)a[i] * (double)b[i];
        all += (double)b[i] * (double)b[i];
    }
    return dot / all;
}

/* One gradient; returns its distance. */
static double halves_check(enum network k, const char *what, const float *a,
                           const float *b, size_t n)
{
    const double far = halves_distance(a, b, n), along = halves_along(a, b, n);

    CHECK(far <= 0.12, "%s: gradient of %s differs by %.3g", network_name[k],
          what, far);
    CHECK(fabs(along - 1) <= (n < 1000 ? 0.07 : 0.02), "%s: %.4g of the gradient of %s",
          network_name[k], along, what);
    return far;
}

static void halves_compare(enum network k, const struct halves_result *half,
                           const struct halves_result *full)
{
    const struct params *ps = &full->ps;
    double out = halves_distance(half->out, full->out, full->outs), max = 0;

    CHECK(out <= 0.01, "%s: output differs by %.3g", network_name[k], out);
    if (full->ins)
        max = halves_check(k, "the input", half->din, full->din, full->ins);
    if (k == PLANE)
        halves_check(k, "the direction", half->ddir, full->ddir, 3);
    for (size_t t = 0; t < ps->count; t++)
        max = fmax(max, halves_check(k, ps->tensor[t].name,
                                       param_g(&half->ps, t), param_g(ps, t),
                                       ps->tensor[t].count));
    printf("%s: output %.2g, gradients %.2g at most\n", network_name[k], out,
           max);
}

int main(void)
{
    static void (*const run[NETWORKS])(
        struct halves_result *, struct nn_options, const float *,
        const float *) = {
        halves_plane, halves_init, halves_backbone};
    static const enum nn_type type[2] = {NN_BF16, NN_F32};
    static float in[PIXELS * INPUTS], dout[PIXELS * INPUTS];
    static struct halves_result r[2];

    halves_noise(in, PIXELS * INPUTS, "in");
    halves_noise(dout, PIXELS * INPUTS, "dout");
    for (int k = 0; k < NETWORKS; k++) {
        for (int i = 0; i < 2; i++) {
            memset(&r[i], 0, sizeof r[i]);
            params_init(&r[i].ps);
            run[k](&r[i], (struct nn_options){NN_TRAIN, type[i]}, in, dout);
        }
        halves_compare((enum network)k, &r[0], &r[1]);
        for (int i = 0; i < 2; i++)
            params_release(&r[i].ps);
    }
    return check_status();
}
