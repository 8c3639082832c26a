/* The distance between pictures in a network's features, and its gradient. */
#include "lib/lab/train/perceptual.h"

#include <math.h>
#include <string.h>

#include "formats/safetensors.h"

/* Where LPIPS looks, with 1.0's fire modules. */
static const enum squeezenet_layer perceptual_layers[PERCEPTUAL_LAYERS] = {
    SQUEEZENET_RELU1, SQUEEZENET_FIRE3, SQUEEZENET_FIRE5, SQUEEZENET_FIRE6,
    SQUEEZENET_FIRE7, SQUEEZENET_FIRE8, SQUEEZENET_FIRE9
};

/* Layer k of the last picture; pixels and channels. */
static const float *perceptual_layer(size_t *pixels, size_t *channels,
                                     const struct perceptual *p, size_t k)
{
    size_t s[4];
    const float *x = squeezenet_layer(s, &p->net, perceptual_layers[k]);

    *pixels = s[1] * s[2];
    *channels = s[3];
    return x;
}

/* LPIPS's weights, planned for boxes of p->side. */
static int perceptual_open_lpips(struct perceptual *p, const char *path,
                                 struct error *err)
{
    size_t n = 3 * p->side * p->side;
    double none;

    p->weighed = true;
    for (int k = 0; k < 3; k++)
        p->planar[k] = nn_plan_floats(&p->plan, n);
    p->crop = nn_plan_floats(&p->plan, n);
    p->dcrop = nn_plan_floats(&p->plan, n);
    if (lpips_init(&p->lpips, path, err))
        return -1;
    p->lpips.learns = true;
    if (nn_plan_finish(&p->plan, err))
        return -1;
    memset(p->planar[0], 0, n * sizeof *p->planar[0]);
    return lpips_distance(&none, &p->lpips, p->planar[0], p->planar[0],
                          p->side, p->side, err);
}

int perceptual_open(struct perceptual *p, const char *path, size_t side,
                    struct error *err)
{
    const struct nn_options opt = { NN_FROZEN, NN_F32 };
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    memset(p, 0, sizeof *p);
    params_init(&p->ps);
    nn_plan_init(&p->plan, opt);
    p->side = side;
    if (st && st_find(st, "lin0.model.1.weight")) {
        rc = perceptual_open_lpips(p, path, err);
        goto out;
    }
    squeezenet_init(&p->net, &p->ps);
    if (!st || params_allocate(&p->ps, err) ||
        params_load(&p->ps, st, "", err) ||
        squeezenet_plan(&p->net, side, side, opt, err))
        goto out;
    p->crop = nn_plan_floats(&p->plan, side * side * 3);
    p->dcrop = nn_plan_floats(&p->plan, side * side * 3);
    for (size_t k = 0; k < PERCEPTUAL_LAYERS; k++) {
        size_t n, C;

        perceptual_layer(&n, &C, p, k);
        p->target[k] = nn_plan_floats(&p->plan, n * C);
        p->grad[k] = nn_plan_floats(&p->plan, n * C);
    }
    rc = nn_plan_finish(&p->plan, err);
out:
    st_close(st);
    if (rc)
        perceptual_release(p);
    return rc;
}

void perceptual_release(struct perceptual *p)
{
    squeezenet_release(&p->net);
    lpips_release(&p->lpips);
    nn_plan_release(&p->plan);
    params_release(&p->ps);
    memset(p, 0, sizeof *p);
}

/* ---- the crop ----------------------------------------------------------- */

/* Output pixel i of `side` along an axis lies at pixel *at of [from, to), and
 * *share of the way to the next. */
static void perceptual_place(size_t *at, double *share, size_t i, size_t side,
                             size_t from, size_t to)
{
    double n = (double)(to - from);
    double x = ((double)i + 0.5) * n / (double)side - 0.5;

    x = fmin(fmax(x, 0), n - 1);
    *at = (size_t)x;
    *at = *at + 2 > to - from && *at > 0 ? *at - 1 : *at;
    *share = x - (double)*at;
    *at += from;
}

/* The box of a picture, bilinear, to p->crop; or back: p->dcrop is added to
 * the picture's gradient, times weight. */
static void perceptual_crop(struct perceptual *p, const float *from,
                            float *back, size_t W, const struct box *box,
                            float weight)
{
    size_t side = p->side;

    for (size_t i = 0; i < side * side; i++) {
        size_t x, y;
        double fx, fy;

        perceptual_place(&y, &fy, i / side, side, box->y0, box->y1);
        perceptual_place(&x, &fx, i % side, side, box->x0, box->x1);
        size_t right = x + 1 < box->x1 ? 3 : 0;
        size_t down = y + 1 < box->y1 ? 3 * W : 0;
        const size_t at[4] = { 3 * (y * W + x), 3 * (y * W + x) + right,
                               3 * (y * W + x) + down,
                               3 * (y * W + x) + down + right };
        const float w[4] = { (float)((1 - fy) * (1 - fx)),
                             (float)((1 - fy) * fx), (float)(fy * (1 - fx)),
                             (float)(fy * fx) };
        for (size_t c = 0; c < 3; c++) {
            float sum = 0;

            for (int k = 0; k < 4 && from; k++)
                sum += w[k] * from[at[k] + c];
            for (int k = 0; k < 4 && back; k++)
                back[at[k] + c] += weight * w[k] * p->dcrop[3 * i + c];
            if (from)
                p->crop[3 * i + c] = sum;
        }
    }
}

/* ---- LPIPS -------------------------------------------------------------- */

/* The crop, channel by channel. */
static void perceptual_planar(float *planar, const struct perceptual *p)
{
    size_t n = p->side * p->side;

    for (size_t i = 0; i < 3 * n; i++)
        planar[i % 3 * n + i / 3] = p->crop[i];
}

/* The distance of crop and target; with grad, p->dcrop is its gradient. */
static double perceptual_lpips(struct perceptual *p, bool grad)
{
    size_t n = p->side * p->side;
    struct error none = {0};        /* it is planned: nothing can fail */
    double sum = 0;

    perceptual_planar(p->planar[1], p);
    lpips_distance(&sum, &p->lpips, p->planar[0], p->planar[1], p->side,
                   p->side, &none);
    if (!grad)
        return sum;
    lpips_backward(p->planar[2], &p->lpips);
    for (size_t i = 0; i < 3 * n; i++)
        p->dcrop[i] = p->planar[2][i % 3 * n + i / 3];
    return sum;
}

/* ---- SqueezeNet --------------------------------------------------------- */

void perceptual_target(struct perceptual *p, const float *a, size_t H,
                       size_t W, const struct box *box)
{
    const struct box all = { 0, 0, W, H };
    size_t n, C;

    box = box ? box : &all;
    if (box_is_empty(*box))
        return;
    perceptual_crop(p, a, NULL, W, box, 0);
    if (p->weighed) {
        perceptual_planar(p->planar[0], p);
        return;
    }
    squeezenet_forward(p->crop, &p->net);
    for (size_t k = 0; k < PERCEPTUAL_LAYERS; k++) {
        const float *x = perceptual_layer(&n, &C, p, k);

        memcpy(p->target[k], x, n * C * sizeof *x);
    }
}

double perceptual_loss(float *db, const float *b, size_t H, size_t W,
                       const struct box *box, double weight,
                       struct perceptual *p)
{
    const struct box all = { 0, 0, W, H };
    const float *dlayer[SQUEEZENET_LAYERS] = { NULL };
    double sum = 0;
    size_t n, C;

    box = box ? box : &all;
    if (box_is_empty(*box))
        return 0;
    perceptual_crop(p, b, NULL, W, box, 0);
    if (p->weighed) {
        sum = perceptual_lpips(p, db != NULL);
        if (db)
            perceptual_crop(p, NULL, db, W, box, (float)weight);
        return weight * sum;
    }
    squeezenet_forward(p->crop, &p->net);
    for (size_t k = 0; k < PERCEPTUAL_LAYERS; k++) {
        const float *x = perceptual_layer(&n, &C, p, k);

        memset(p->grad[k], 0, n * C * sizeof *x);
        sum += lpips_feature_distance(p->grad[k], p->target[k], x, NULL, n, C);
        dlayer[perceptual_layers[k]] = p->grad[k];
    }
    if (db) {
        squeezenet_backward(p->dcrop, dlayer, &p->net);
        perceptual_crop(p, NULL, db, W, box,
                        (float)(weight / PERCEPTUAL_LAYERS));
    }
    return weight * sum / PERCEPTUAL_LAYERS;
}
