/* LPIPS (Zhang et al. 2018) on AlexNet's features, for weights that the
 * user brings: differences of unit-length features, weighted by channel,
 * averaged; and the gradient by one of the pictures. */
#include "lib/lab/eval/lpips.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

/* AlexNet's convolutions: where each lies in "features", its geometry, and
 * whether a 3x3 maximum of stride 2 goes before it.  All are padded by half
 * their kernel but the first, by BORDER. */
static const struct {
    int index, pool;
    size_t in, out, kernel, stride;
} stage[LPIPS_STAGES] = {
    {0, 0, 3, 64, 11, 4},   {3, 1, 64, 192, 5, 1},
    {6, 1, 192, 384, 3, 1}, {8, 0, 384, 256, 3, 1},
    {10, 0, 256, 256, 3, 1},
};
#define BORDER 2

/* The network sees (2 rgb - 1 - shift) / scale. */
static const float lpips_shift[3] = {-0.030f, -0.088f, -0.188f};
static const float lpips_scale[3] = {0.458f, 0.448f, 0.450f};

void lpips_declare(struct lpips *l)
{
    char name[40];

    memset(l, 0, sizeof *l);
    params_init(&l->ps);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        const size_t lin[4] = {1, stage[i].out, 1, 1};

        snprintf(name, sizeof name, "features.%d", stage[i].index);
        conv_init(&l->conv[i], &l->ps, name, stage[i].in, stage[i].out,
                  stage[i].kernel, stage[i].stride, true);
        l->conv[i].pad = i ? CONV_HALF : CONV_NONE;
        l->conv[i].act = ACT_RELU;
        snprintf(name, sizeof name, "lin%d.model.1.weight", i);
        l->lin[i] = params_add(&l->ps, name, 4, lin, PARAM_ZERO, 1);
    }
    for (size_t i = 0; i < l->ps.count; i++)
        l->ps.tensor[i].frozen = true;
}

int lpips_init(struct lpips *l, const char *path, struct error *err)
{
    lpips_declare(l);
    if (params_open(&l->ps, path, err) == 0)
        return 0;
    lpips_release(l);
    return -1;
}

void lpips_release(struct lpips *l)
{
    nn_plan_release(&l->plan);
    params_release(&l->ps);
    memset(l, 0, sizeof *l);
}

/* All stages for pictures of a size, and room for the largest gradient. */
static int lpips_plan(struct lpips *l, size_t H, size_t W, struct error *err)
{
    struct nn_options opt = {l->learns ? NN_FROZEN : NN_INFER, NN_F32};
    size_t h = H + 2 * BORDER, w = W + 2 * BORDER, max = 3 * h * w;

    nn_plan_release(&l->plan);
    nn_plan_init(&l->plan, opt);
    l->H = l->W = 0;
    l->in = nn_plan_floats(&l->plan, max);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        struct conv *c = &l->conv[i];

        if (stage[i].pool) {
            max_pool_plan(&l->pool[i], &l->plan, 1, h, w, c->in, false);
            h = l->pool[i].oh;
            w = l->pool[i].ow;
            l->pooled[i] = nn_plan_floats(&l->plan, h * w * c->in);
        }
        conv_plan(c, &l->plan, 1, h, w);
        h = c->oh;
        w = c->ow;
        for (int k = 0; k < 2; k++)
            l->out[k][i] = nn_plan_floats(&l->plan, h * w * c->out);
        max = h * w * c->out > max ? h * w * c->out : max;
    }
    for (int k = 0; k < 2; k++)
        l->d[k] = nn_plan_floats(&l->plan, l->learns ? max : 1);
    if (nn_plan_finish(&l->plan, err))
        return -1;
    l->H = H;
    l->W = W;
    return 0;
}

/* Pixel i of a picture in l->in, which has a border. */
static size_t lpips_place(const struct lpips *l, size_t i)
{
    return 3 * ((i / l->W + BORDER) * (l->W + 2 * BORDER) + i % l->W + BORDER);
}

/* What stage i takes, of the picture that was looked at last. */
static const float *lpips_stage_input(const struct lpips *l, int which, int i)
{
    return stage[i].pool ? l->pooled[i] : i ? l->out[which][i - 1] : l->in;
}

/* The five feature maps of a picture into l->out[which]. */
static void lpips_features(struct lpips *l, int which, const float *rgb)
{
    const size_t n = l->H * l->W;

    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            l->in[lpips_place(l, i) + c] =
                (2 * rgb[c * n + i] - 1 - lpips_shift[c]) / lpips_scale[c];
    for (int i = 0; i < LPIPS_STAGES; i++) {
        if (stage[i].pool)
            max_pool_forward(l->pooled[i], l->out[which][i - 1], &l->pool[i]);
        conv_forward(l->out[which][i], lpips_stage_input(l, which, i),
                     &l->conv[i]);
    }
}

/* One over the length of x (C), a pixel's features. */
static double lpips_inverse_length(const float *x, size_t C)
{
    double sum = 0;

    for (size_t c = 0; c < C; c++)
        sum += (double)x[c] * x[c];
    return 1 / (sqrt(sum) + 1e-10);
}

/* With u = b/|b| and e = 2 w (u - a/|a|) the gradient is (e - u (u . e)) / |b|,
 * over n. */
double lpips_feature_distance(float *g, const float *a, const float *b,
                              const float *w, size_t n, size_t C)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++, a += C, b += C) {
        const double na = lpips_inverse_length(a, C);
        const double nb = lpips_inverse_length(b, C);
        double along = 0;

        for (size_t c = 0; c < C; c++) {
            const double off = b[c] * nb - a[c] * na;
            const double e = (w ? w[c] : 1) * off;

            sum += e * off;
            along += 2 * e * b[c] * nb;
        }
        for (size_t c = 0; g && c < C; c++) {
            const double u = b[c] * nb;
            const double e = 2 * (w ? w[c] : 1) * (u - a[c] * na);

            g[i * C + c] += (float)((e - u * along) * nb / (double)n);
        }
    }
    return sum / (double)n;
}

/* Of stage i; g (NULL: not wanted) += its gradient by the second picture. */
static double lpips_stage_distance(float *g, const struct lpips *l, int i)
{
    return lpips_feature_distance(g, l->out[0][i], l->out[1][i],
                                  param_w(&l->ps, l->lin[i]),
                                  l->conv[i].oh * l->conv[i].ow, stage[i].out);
}

int lpips_distance(double *distance, struct lpips *l, const float *a,
                   const float *b, size_t H, size_t W, struct error *err)
{
    if (H < 64 || W < 64)
        return error_set(err, EX_DATAERR, "lpips of %zux%zu pixels (expected "
                         "sides of 64 or more)", W, H);
    if ((H != l->H || W != l->W) && lpips_plan(l, H, W, err))
        return -1;
    lpips_features(l, 0, a);
    lpips_features(l, 1, b);
    *distance = 0;
    for (int i = 0; i < LPIPS_STAGES; i++)
        *distance += lpips_stage_distance(NULL, l, i);
    return 0;
}

/* ---- the gradient ------------------------------------------------------- */

void lpips_backward(float *db, struct lpips *l)
{
    const struct conv *last = &l->conv[LPIPS_STAGES - 1];
    float *d = l->d[0], *din = l->d[1];
    const size_t n = l->H * l->W;

    memset(d, 0, last->oh * last->ow * last->out * sizeof *d);
    for (int i = LPIPS_STAGES - 1; i >= 0; i--) {
        struct conv *c = &l->conv[i];

        lpips_stage_distance(d, l, i);
        conv_backward(din, d, l->out[1][i], lpips_stage_input(l, 1, i), c);
        if (stage[i].pool) {
            max_pool_backward(d, din, &l->pool[i]);
        } else {
            float *swap = d;

            d = din;
            din = swap;
        }
    }
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            db[c * n + i] = d[lpips_place(l, i) + c] * 2 / lpips_scale[c];
}
