/* ArcFace's IResNet (Deng et al. 2019) for comparing identities in evaluation:
 * inference only, its sizes read from the file. */
#include "lib/lab/eval/iresnet.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"

#define EPS 1e-5f
#define STAGES 4

/* ---- sizes, from the file ----------------------------------------------- */

/* As iresnet_declare wants it. */
static size_t iresnet_rows(const void *file, const char *name)
{
    const struct st_tensor *t = st_find(file, name);

    return t && t->ndim ? t->dim[0] : 0;
}

/* Declare layerL.B, whose input has `in` channels. */
static void iresnet_declare_block(struct iresnet *n, const char *name,
                                  size_t in, size_t out, bool down,
                                  size_t side)
{
    struct iresnet_block *b = &n->block[n->blocks++];
    char buf[120];

    b->side = side;
    b->stride = down ? 2 : 1;
    b->has_down = down;
    batch_norm_init(&b->bn1, &n->ps, nn_name(buf, "%s.bn1", name), in, EPS);
    conv_init(&b->conv1, &n->ps, nn_name(buf, "%s.conv1", name), in, out, 3,
              1, false);
    batch_norm_init(&b->bn2, &n->ps, nn_name(buf, "%s.bn2", name), out, EPS);
    b->prelu = params_add(&n->ps, nn_name(buf, "%s.prelu.weight", name), 1,
                          &out, PARAM_ZERO, 0);
    conv_init(&b->conv2, &n->ps, nn_name(buf, "%s.conv2", name), out, out, 3,
              b->stride, false);
    b->conv1.norm = &b->bn2;
    b->conv2.norm = &b->bn3;
    b->conv2.add = true;
    batch_norm_init(&b->bn3, &n->ps, nn_name(buf, "%s.bn3", name), out, EPS);
    if (!down)
        return;
    conv_init(&b->down, &n->ps, nn_name(buf, "%s.downsample.0", name), in,
              out, 1, b->stride, false);
    batch_norm_init(&b->bn_down, &n->ps, nn_name(buf, "%s.downsample.1", name),
                    out, EPS);
    b->down.norm = &b->bn_down;
}

int iresnet_declare(struct iresnet *n,
                    size_t rows(const void *file, const char *name),
                    const void *file, const char *path, struct error *err)
{
    size_t channels = rows(file, "conv1.weight"), side = IRESNET_SIDE;
    size_t code = rows(file, "fc.weight");
    char name[64], weight[80];

    memset(n, 0, sizeof *n);
    params_init(&n->ps);
    if (!channels || !code)
        return error_set(err, EX_DATAERR, "%s: no conv1.weight or fc.weight "
                         "(expected an iresnet)", path);
    conv_init(&n->stem, &n->ps, "conv1", 3, channels, 3, 1, false);
    batch_norm_init(&n->bn_stem, &n->ps, "bn1", channels, EPS);
    n->stem.norm = &n->bn_stem;
    n->prelu = params_add(&n->ps, "prelu.weight", 1, &channels, PARAM_ZERO, 0);
    for (int stage = 1; stage <= STAGES; stage++)
        for (int i = 0;; i++) {
            snprintf(name, sizeof name, "layer%d.%d", stage, i);
            snprintf(weight, sizeof weight, "%s.conv1.weight", name);
            size_t out = rows(file, weight);

            if (!out && i)
                break;
            if (!out || n->blocks == IRESNET_MAX_BLOCKS)
                return error_set(err, EX_DATAERR, "%s: no %s, or too many "
                                 "blocks", path, weight);
            iresnet_declare_block(n, name, channels, out, i == 0, side);
            channels = out;
            side = i == 0 ? side / 2 : side;
        }
    batch_norm_init(&n->bn_last, &n->ps, "bn2", channels, EPS);
    linear_init(&n->fc, &n->ps, "fc", channels * side * side, code);
    batch_norm_init(&n->bn_feature, &n->ps, "features", code, EPS);
    return 0;
}

/* ---- planning ----------------------------------------------------------- */

/* The larger of two sizes. */
static size_t iresnet_larger(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* One picture, inference in float; weights from n->ps. */
static int iresnet_plan(struct iresnet *n, struct error *err)
{
    const struct nn_options opt = {NN_INFER, NN_F32};
    size_t max = (size_t)IRESNET_SIDE * IRESNET_SIDE * n->stem.out;

    nn_plan_init(&n->plan, opt);
    conv_plan(&n->stem, &n->plan, 1, IRESNET_SIDE, IRESNET_SIDE);
    for (size_t i = 0; i < n->blocks; i++) {
        struct iresnet_block *b = &n->block[i];
        size_t side = b->side / b->stride;

        conv_plan(&b->conv1, &n->plan, 1, b->side, b->side);
        conv_plan(&b->conv2, &n->plan, 1, b->side, b->side);
        if (b->has_down)
            conv_plan(&b->down, &n->plan, 1, b->side, b->side);
        max = iresnet_larger(max,
                             b->side * b->side * iresnet_larger(b->conv1.in,
                                 b->conv1.out));
        max = iresnet_larger(max, side * side * b->conv2.out);
    }
    linear_plan(&n->fc, &n->plan, 1);
    n->x = nn_plan_floats(&n->plan, max);
    n->y = nn_plan_floats(&n->plan, max);
    n->t = nn_plan_floats(&n->plan, max);
    n->code = nn_plan_floats(&n->plan, n->fc.out);
    return nn_plan_finish(&n->plan, err);
}

int iresnet_open(struct iresnet *n, const char *path, struct error *err)
{
    struct safetensors *st = st_open(path, err);
    int rc = -1;

    memset(n, 0, sizeof *n);
    if (!st)
        return -1;
    if (!iresnet_declare(n, iresnet_rows, st, path, err) &&
        !params_allocate(&n->ps, err) && !params_load(&n->ps, st, "", err) &&
        !iresnet_plan(n, err))
        rc = 0;
    st_close(st);
    if (rc)
        iresnet_release(n);
    return rc;
}

void iresnet_release(struct iresnet *n)
{
    nn_plan_release(&n->plan);
    params_release(&n->ps);
    memset(n, 0, sizeof *n);
}

size_t iresnet_size(const struct iresnet *n)
{
    return n->fc.out;
}

/* ---- forward ------------------------------------------------------------ */

/* One row. */
PARALLEL(iresnet_normalise_part, r, float *, y, const float *, x,
         const float *, m, const float *, w, const float *, v, const float *, o,
         size_t, C)
{
    for (size_t c = 0; c < C; c++)
        y[r * C + c] =
            (x[r * C + c] - m[c]) * (w[c] / sqrtf(v[c] + EPS)) + o[c];
}

/* y (rows,C) = batch norm of x with the running statistics.  Before a padded
 * convolution it cannot be folded: the padding is 0 after it, not before. */
static void iresnet_normalise(float *y, const float *x,
                              const struct batch_norm *b, size_t rows)
{
    const size_t C = b->channels;
    const float *w = param_w(b->ps, b->weight), *o = param_w(b->ps, b->bias);
    const float *m = param_w(b->ps, b->mean), *v = param_w(b->ps, b->var);

    parallel_each(iresnet_normalise_part, rows, 1, y, x, m, w, v, o, C);
}

/* One row. */
PARALLEL(iresnet_prelu_part, r, float *, x, const float *, slope, size_t, C)
{
    for (size_t c = 0; c < C; c++)
        if (x[r * C + c] < 0)
            x[r * C + c] *= slope[c];
}

/* x < 0 is multiplied by its channel's slope, in place. */
static void iresnet_prelu(float *x, const float *slope, size_t rows, size_t C)
{
    parallel_each(iresnet_prelu_part, rows, 1, x, slope, C);
}

/* n->x -> n->x */
static void iresnet_block_forward(struct iresnet *n, struct iresnet_block *b)
{
    const size_t rows = b->side * b->side, out = b->conv1.out;
    float *swap = n->x;

    iresnet_normalise(n->t, n->x, &b->bn1, rows);
    conv_forward(n->y, n->t, &b->conv1);
    iresnet_prelu(n->y, param_w(&n->ps, b->prelu), rows, out);
    if (b->has_down) {
        conv_forward(n->t, n->x, &b->down);
        n->x = n->t;
        n->t = swap;
    }
    conv_forward(n->x, n->y, &b->conv2);       /* adds */
}

void iresnet_forward(float *embedding, const float *rgb, struct iresnet *n)
{
    const size_t C = n->bn_last.channels, size = n->fc.out;
    const size_t places = n->fc.in / C;
    double sum = 0;

    conv_forward(n->x, rgb, &n->stem);
    iresnet_prelu(n->x, param_w(&n->ps, n->prelu),
                  (size_t)IRESNET_SIDE * IRESNET_SIDE, n->stem.out);
    for (size_t i = 0; i < n->blocks; i++)
        iresnet_block_forward(n, &n->block[i]);
    iresnet_normalise(n->t, n->x, &n->bn_last, places);
    for (size_t p = 0; p < places; p++)        /* channels slowest, as the */
        for (size_t c = 0; c < C; c++)         /* layer's weights have it */
            n->y[c * places + p] = n->t[p * C + c];
    conv_forward(n->code, n->y, &n->fc);
    iresnet_normalise(embedding, n->code, &n->bn_feature, 1);
    for (size_t i = 0; i < size; i++)
        sum += (double)embedding[i] * embedding[i];
    for (size_t i = 0; i < size; i++)
        embedding[i] = (float)(embedding[i] / fmax(sqrt(sum), 1e-30));
}
