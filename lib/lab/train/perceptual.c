/* The distance between pictures in a network's features, and its gradient. */
#include "lib/lab/train/perceptual.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/safetensors.h"

int perceptual_open(struct perceptual *p, const char *path, size_t side,
                    struct error *err)
{
    const size_t n = 3 * side * side;
    struct safetensors *st = st_open(path, err);

    memset(p, 0, sizeof *p);
    if (!st)
        return -1;
    const enum lpips_net net = st_find(st, "lin0.model.1.weight")
                                   ? LPIPS_ALEXNET : LPIPS_SQUEEZENET;

    st_close(st);
    if (lpips_init(&p->net, net, path, err))
        return -1;
    p->side = side;
    p->net.learns = true;
    p->crop = malloc(2 * n * sizeof *p->crop);
    if (!p->crop || lpips_plan(&p->net, side, side, err)) {
        if (!p->crop)
            error_set(err, EX_OSERR, "no memory for a crop");
        perceptual_release(p);
        return -1;
    }
    p->dcrop = p->crop + n;
    return 0;
}

void perceptual_release(struct perceptual *p)
{
    lpips_release(&p->net);
    free(p->crop);
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
                back[at[k] + c] += weight * w[k] * p->dcrop[c * side * side + i];
            if (from)
                p->crop[c * side * side + i] = sum;
        }
    }
}

/* ---- the distance ------------------------------------------------------- */

void perceptual_target(struct perceptual *p, const float *a, size_t H,
                       size_t W, const struct box *box)
{
    const struct box all = { 0, 0, W, H };

    box = box ? box : &all;
    if (box_is_empty(*box))
        return;
    perceptual_crop(p, a, NULL, W, box, 0);
    lpips_first(&p->net, p->crop);
}

double perceptual_loss(float *db, const float *b, size_t H, size_t W,
                       const struct box *box, double weight,
                       struct perceptual *p)
{
    const struct box all = { 0, 0, W, H };
    const double share = p->net.net == LPIPS_ALEXNET ? 1 : p->net.layers;

    box = box ? box : &all;
    if (box_is_empty(*box))
        return 0;
    perceptual_crop(p, b, NULL, W, box, 0);
    const double sum = lpips_second(&p->net, p->crop);

    if (db) {
        lpips_backward(p->dcrop, &p->net);
        perceptual_crop(p, NULL, db, W, box, (float)(weight / share));
    }
    return weight * sum / share;
}
