#include "lib/track/looks.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/head/mirror.h"

#define N SHAPE_ENCODER_SIZE

/* Where the crop is moved to and how much larger it is made, of its side:
 * what a tracker's crops differ by, the same to the left and to the right. */
static const struct square view[] = {
    {0.02, 0.01, 1}, {-0.02, 0.01, 1}, {0, -0.02, 1.03}, {0, 0, 0.97}};
#define VIEWS (sizeof view / sizeof *view)

int looks_init(struct looks *l, struct shape_encoder *net,
               const struct head *h, struct error *err)
{
    memset(l, 0, sizeof *l);
    l->net = net;
    l->rgb = malloc(3 * N * N * sizeof *l->rgb);
    if (!l->rgb)
        return error_set(err, EX_OSERR, "no memory for a face crop");
    if (h->nshape > SHAPE_ENCODER_OUT)
        return 0;
    l->mirror = head_mirror(l->sign, h, err);
    return l->mirror < 0 ? -1 : 0;
}

void looks_release(struct looks *l)
{
    free(l->rgb);
    l->rgb = NULL;
}

void looks_mirror(float *rgb, size_t n)
{
    for (size_t y = 0; y < n; y++)
        for (size_t x = 0; x < n / 2; x++) {
            float *a = rgb + 3 * (y * n + x), t[3];
            float *b = rgb + 3 * (y * n + n - 1 - x);

            memcpy(t, a, sizeof t);
            memcpy(a, b, sizeof t);
            memcpy(b, t, sizeof t);
        }
}

/* sum += what the network says of l->rgb; of its mirror image when sign is
 * not NULL. */
static void add(float *sum, struct looks *l, const float *sign)
{
    float beta[SHAPE_ENCODER_OUT];

    shape_encoder_forward(beta, l->rgb, l->net);
    for (size_t k = 0; k < SHAPE_ENCODER_OUT; k++)
        sum[k] += sign ? sign[k] * beta[k] : beta[k];
}

int looks_shape(float *beta, struct looks *l, struct square q, look_fn *fn,
                void *ctx, struct error *err)
{
    memset(beta, 0, SHAPE_ENCODER_OUT * sizeof *beta);
    for (size_t i = 0; i < VIEWS; i++) {
        struct square moved = {q.x + view[i].x * q.size,
                               q.y + view[i].y * q.size,
                               view[i].size * q.size};

        if (fn(ctx, l->rgb, moved, err))
            return -1;
        add(beta, l, NULL);
        if (!l->mirror)
            continue;
        looks_mirror(l->rgb, N);
        add(beta, l, l->sign);
    }
    for (size_t k = 0; k < SHAPE_ENCODER_OUT; k++)
        beta[k] /= (float)(VIEWS * (l->mirror ? 2 : 1));
    return 0;
}
