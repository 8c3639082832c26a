/* LPIPS (Zhang et al. 2018) on AlexNet's features, for weights that the
 * user brings: differences of unit-length features, weighted by channel,
 * averaged; and the gradient by one of the pictures. */
#include "lib/lab/eval/lpips.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

/* AlexNet's convolutions: where each lies in "features", its geometry, and
 * whether a 3x3 maximum of stride 2 goes before it. */
static const struct {
    int index, pool;
    size_t in, out, kernel, stride, pad;
} stage[LPIPS_STAGES] = {
    {0, 0, 3, 64, 11, 4, 2},   {3, 1, 64, 192, 5, 1, 2},
    {6, 1, 192, 384, 3, 1, 1}, {8, 0, 384, 256, 3, 1, 1},
    {10, 0, 256, 256, 3, 1, 1},
};

/* The network sees (2 rgb - 1 - shift) / scale. */
static const float lpips_shift[3] = {-0.030f, -0.088f, -0.188f};
static const float lpips_scale[3] = {0.458f, 0.448f, 0.450f};

/* The tensors that the file must hold, by torchvision's and LPIPS's names. */
static void lpips_declare(struct lpips *l)
{
    char name[40];

    params_init(&l->ps);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        size_t k = stage[i].kernel, c = stage[i].out;
        size_t w[4] = {c, stage[i].in, k, k}, lin[4] = {1, c, 1, 1};

        snprintf(name, sizeof name, "features.%d.weight", stage[i].index);
        params_add(&l->ps, name, 4, w, PARAM_ZERO, 1);
        snprintf(name, sizeof name, "features.%d.bias", stage[i].index);
        params_add(&l->ps, name, 1, &c, PARAM_ZERO, 1);
        snprintf(name, sizeof name, "lin%d.model.1.weight", i);
        l->lin[i] = params_add(&l->ps, name, 4, lin, PARAM_ZERO, 1);
    }
    for (size_t i = 0; i < l->ps.count; i++)
        l->ps.tensor[i].frozen = true;
}

int lpips_init(struct lpips *l, const char *path, struct error *err)
{
    memset(l, 0, sizeof *l);
    lpips_declare(l);
    if (params_open(&l->ps, path, err) == 0)
        return 0;
    lpips_release(l);
    return -1;
}

/* Forget what was planned for another picture size. */
static void lpips_drop_plan(struct lpips *l)
{
    if (!l->H)
        return;
    for (int i = 0; i < LPIPS_STAGES; i++)
        conv_release(&l->conv[i]);
    nn_plan_release(&l->plan);
    l->H = l->W = 0;
}

void lpips_release(struct lpips *l)
{
    lpips_drop_plan(l);
    params_release(&l->ps);
    memset(l, 0, sizeof *l);
}

/* Side of stage i's output for an input of n. */
static size_t lpips_conv_size(int i, size_t n)
{
    return (n + 2 * stage[i].pad - stage[i].kernel) / stage[i].stride + 1;
}

/* Side after a 3x3 maximum with stride 2, not padded. */
static size_t lpips_pool_size(size_t n)
{
    return (n - 3) / 2 + 1;
}

/* Stage i over an image of h x w: linear over patches of k*k*in numbers, the
 * weight tensor (out,in,k,k) read as (out, in*k*k). */
static void lpips_plan_stage(struct lpips *l, int i, size_t h, size_t w)
{
    struct conv *c = &l->conv[i];

    memset(c, 0, sizeof *c);
    c->ps = &l->ps;
    c->weight = 3 * (size_t)i;
    c->bias = 3 * (size_t)i + 1;
    c->in = stage[i].in * stage[i].kernel * stage[i].kernel;
    c->out = stage[i].out;
    c->kernel = c->stride = 1;
    c->act = ACT_RELU;
    linear_plan(c, &l->plan, h * w);
    for (int k = 0; k < 2; k++)
        l->out[k][i] = nn_plan_floats(&l->plan, h * w * stage[i].out);
}

/* All stages, and room for the largest of what they take and give. */
static int lpips_plan(struct lpips *l, size_t H, size_t W, struct error *err)
{
    struct nn_options opt = {l->learns ? NN_FROZEN : NN_INFER, NN_F32};
    size_t h = H, w = W, patches = 0, in = 3 * H * W, max = in;

    lpips_drop_plan(l);
    nn_plan_init(&l->plan, opt);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        size_t k2 = stage[i].kernel * stage[i].kernel;

        if (stage[i].pool) {
            h = lpips_pool_size(h);
            w = lpips_pool_size(w);
        }
        if (h * w * stage[i].in > in)
            in = h * w * stage[i].in;
        l->h[i] = h = lpips_conv_size(i, h);
        l->w[i] = w = lpips_conv_size(i, w);
        if (h * w * stage[i].out > max)
            max = h * w * stage[i].out;
        if (h * w * k2 * stage[i].in > patches)
            patches = h * w * k2 * stage[i].in;
        lpips_plan_stage(l, i, h, w);
    }
    l->patches = nn_plan_floats(&l->plan, patches);
    l->in = nn_plan_floats(&l->plan, in);
    l->dpatches = nn_plan_floats(&l->plan, l->learns ? patches : 1);
    l->din = nn_plan_floats(&l->plan, l->learns ? in : 1);
    l->dout = nn_plan_floats(&l->plan, l->learns ? max : 1);
    l->H = H;
    l->W = W;
    if (nn_plan_finish(&l->plan, err)) {
        lpips_drop_plan(l);
        return -1;
    }
    for (int i = 0; i < LPIPS_STAGES; i++)
        conv_update(&l->conv[i], NULL);
    return 0;
}

/* out (h,w,C) = maximum of 3x3, stride 2, of in (H,W,C). */
static void lpips_pool_forward(float *out, const float *in, size_t H, size_t W,
                               size_t C)
{
    size_t h = lpips_pool_size(H), w = lpips_pool_size(W);

    for (size_t i = 0; i < h * w; i++)
        for (size_t c = 0; c < C; c++) {
            float best = -INFINITY;

            for (size_t k = 0; k < 9; k++) {
                size_t y = 2 * (i / w) + k / 3, x = 2 * (i % w) + k % 3;

                best = fmaxf(best, in[(y * W + x) * C + c]);
            }
            out[i * C + c] = best;
        }
}

/* Patches (h*w, C*k*k), channel slowest as in the weights, zeros outside. */
static void lpips_im2col(float *out, const float *in, size_t H, size_t W,
                         int i, size_t h, size_t w)
{
    size_t k = stage[i].kernel, C = stage[i].in;

    for (size_t p = 0; p < h * w; p++) {
        long y0 = (long)(p / w * stage[i].stride) - (long)stage[i].pad;
        long x0 = (long)(p % w * stage[i].stride) - (long)stage[i].pad;
        float *o = out + p * C * k * k;

        for (size_t t = 0; t < k * k; t++) {
            long y = y0 + (long)(t / k), x = x0 + (long)(t % k);
            int inside = y >= 0 && x >= 0 && y < (long)H && x < (long)W;
            const float *s = inside ? in + ((size_t)y * W + (size_t)x) * C
                                    : NULL;

            for (size_t c = 0; c < C; c++)
                o[c * k * k + t] = s ? s[c] : 0;
        }
    }
}

/* The five feature maps of a picture into l->out[which]. */
static void lpips_features(struct lpips *l, int which, const float *rgb)
{
    size_t n = l->H * l->W, h = l->H, w = l->W;
    const float *x = l->in;

    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            l->in[3 * i + c] = (2 * rgb[c * n + i] - 1 - lpips_shift[c]) /
                               lpips_scale[c];
    for (int i = 0; i < LPIPS_STAGES; i++) {
        if (stage[i].pool) {
            lpips_pool_forward(l->in, x, h, w, stage[i].in);
            h = lpips_pool_size(h);
            w = lpips_pool_size(w);
            x = l->in;
        }
        lpips_im2col(l->patches, x, h, w, i, l->h[i], l->w[i]);
        conv_forward(l->out[which][i], l->patches, &l->conv[i]);
        h = l->h[i];
        w = l->w[i];
        x = l->out[which][i];
    }
}

/* One over the length of x (C), a pixel's features. */
static double lpips_stage_inverse_length(const float *x, size_t C)
{
    double sum = 0;

    for (size_t c = 0; c < C; c++)
        sum += (double)x[c] * x[c];
    return 1 / (sqrt(sum) + 1e-10);
}

/* Mean over places of sum_c w_c (a_c/|a| - b_c/|b|)^2. */
static double lpips_stage_distance(const float *a, const float *b,
                                   const float *w, size_t n, size_t C)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        double na = lpips_stage_inverse_length(a + i * C, C);
        double nb = lpips_stage_inverse_length(b + i * C, C);

        for (size_t c = 0; c < C; c++) {
            double d = a[i * C + c] * na - b[i * C + c] * nb;

            sum += w[c] * d * d;
        }
    }
    return sum / (double)n;
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
        *distance += lpips_stage_distance(l->out[0][i], l->out[1][i],
                                          param_w(&l->ps, l->lin[i]),
                                          l->h[i] * l->w[i], stage[i].out);
    return 0;
}

/* ---- the gradient ------------------------------------------------------- */

/* g += gradient of lpips_stage_distance by b.  With u = b/|b| and
 * e = 2 w (u - v):
 * (e - u (u . e)) / |b|, over n. */
static void lpips_stage_distance_backward(float *g, const float *a,
                                          const float *b, const float *w,
                                          size_t n, size_t C)
{
    for (size_t i = 0; i < n; i++) {
        double na = lpips_stage_inverse_length(a + i * C, C);
        double nb = lpips_stage_inverse_length(b + i * C, C), along = 0;

        for (size_t c = 0; c < C; c++) {
            double u = b[i * C + c] * nb;

            along += 2 * w[c] * (u - a[i * C + c] * na) * u;
        }
        for (size_t c = 0; c < C; c++) {
            double u = b[i * C + c] * nb;

            g[i * C + c] += (float)((2 * w[c] * (u - a[i * C + c] * na) -
                                     u * along) * nb / (double)n);
        }
    }
}

/* lpips_im2col in reverse: in (H,W,C) = the sum of what went to
 * patches. */
static void lpips_col2im(float *in, const float *patches, size_t H,
                         size_t W, int i, size_t h, size_t w)
{
    size_t k = stage[i].kernel, C = stage[i].in;

    memset(in, 0, H * W * C * sizeof *in);
    for (size_t p = 0; p < h * w; p++) {
        long y0 = (long)(p / w * stage[i].stride) - (long)stage[i].pad;
        long x0 = (long)(p % w * stage[i].stride) - (long)stage[i].pad;
        const float *o = patches + p * C * k * k;

        for (size_t t = 0; t < k * k; t++) {
            long y = y0 + (long)(t / k), x = x0 + (long)(t % k);

            if (y < 0 || x < 0 || y >= (long)H || x >= (long)W)
                continue;
            for (size_t c = 0; c < C; c++)
                in[((size_t)y * W + (size_t)x) * C + c] += o[c * k * k + t];
        }
    }
}

/* lpips_pool_forward in reverse: din (H,W,C) gets dout where `in` was largest,
 * the first of equals. */
static void lpips_pool_backward(float *din, const float *dout, const float *in,
                                size_t H, size_t W, size_t C)
{
    size_t h = lpips_pool_size(H), w = lpips_pool_size(W);

    memset(din, 0, H * W * C * sizeof *din);
    for (size_t i = 0; i < h * w; i++)
        for (size_t c = 0; c < C; c++) {
            size_t best = 0;

            for (size_t k = 0; k < 9; k++) {
                size_t y = 2 * (i / w) + k / 3, x = 2 * (i % w) + k % 3;
                size_t at = (y * W + x) * C + c;

                best = k == 0 || in[at] > in[best] ? at : best;
            }
            din[best] += dout[i * C + c];
        }
}

void lpips_backward(float *db, struct lpips *l)
{
    size_t n = l->H * l->W;

    for (int i = LPIPS_STAGES - 1; i >= 0; i--) {
        size_t h = l->h[i], w = l->w[i], C = stage[i].out;
        size_t H = i ? l->h[i - 1] : l->H, W = i ? l->w[i - 1] : l->W;

        if (i == LPIPS_STAGES - 1)
            memset(l->dout, 0, h * w * C * sizeof *l->dout);
        lpips_stage_distance_backward(l->dout, l->out[0][i], l->out[1][i],
                                      param_w(&l->ps, l->lin[i]), h * w, C);
        conv_backward(l->dpatches, l->dout, l->out[1][i], l->patches,
                      &l->conv[i]);
        if (!stage[i].pool) {
            lpips_col2im(l->dout, l->dpatches, H, W, i, h, w);
            continue;
        }
        lpips_col2im(l->din, l->dpatches, lpips_pool_size(H),
                     lpips_pool_size(W), i, h, w);
        lpips_pool_backward(l->dout, l->din, l->out[1][i - 1], H, W,
                            stage[i].in);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            db[c * n + i] = l->dout[3 * i + c] * 2 / lpips_scale[c];
}
