/* Differences of unit-length features (Zhang et al. 2018), averaged; and the
 * gradient by one of the pictures. */
#include "lib/lab/eval/lpips.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "lib/lab/eval/squeezenet.h"
#include "lib/lab/eval/tape_steps.h"

/* AlexNet's convolutions: where each lies in "features", its geometry, and
 * whether a 3x3 maximum of stride 2 goes before it.  All are padded by half
 * their kernel but the first, by BORDER. */
static const struct {
    int index, pool;
    size_t out, kernel, stride;
} stage[] = {
    {0, 0, 64, 11, 4}, {3, 1, 192, 5, 1}, {6, 1, 384, 3, 1},
    {8, 0, 256, 3, 1}, {10, 0, 256, 3, 1},
};
#define STAGES ((int)(sizeof stage / sizeof *stage))

/* Where LPIPS looks, with 1.0's fire modules. */
static const enum squeezenet_layer squeezenet[LPIPS_LAYERS] = {
    SQUEEZENET_RELU1, SQUEEZENET_FIRE3, SQUEEZENET_FIRE5, SQUEEZENET_FIRE6,
    SQUEEZENET_FIRE7, SQUEEZENET_FIRE8, SQUEEZENET_FIRE9
};

/* A network sees (gain rgb - offset - shift) / scale in zeros so far around. */
static const struct lpips_input {
    float gain, offset, shift[3], scale[3];
    size_t border;
} input[] = {
    [LPIPS_ALEXNET] = {2, 1, {-0.030f, -0.088f, -0.188f},
                       {0.458f, 0.448f, 0.450f}, 2},
    [LPIPS_SQUEEZENET] = {1, 0, {0}, {1, 1, 1}, 0}
};

static void lpips_declare_alexnet(struct lpips *l)
{
    struct tape *t = &l->tape;
    char name[40];
    int x = 0;

    l->layers = STAGES;
    for (int i = 0; i < STAGES; i++) {
        const size_t lin[4] = {1, stage[i].out, 1, 1};

        if (stage[i].pool)
            x = tape_pool(t, x, 0, false);
        snprintf(name, sizeof name, "features.%d", stage[i].index);
        x = l->map[i] = tape_conv(t, x, name, stage[i].out, stage[i].kernel,
                                  true);
        tape_layer(t, x)->stride = stage[i].stride;
        tape_layer(t, x)->pad = i ? CONV_HALF : CONV_NONE;
        tape_layer(t, x)->act = ACT_RELU;
        snprintf(name, sizeof name, "lin%d.model.1.weight", i);
        l->lin[i] = params_add(&l->ps, name, 4, lin, PARAM_ZERO, 1);
    }
}

void lpips_declare(struct lpips *l, enum lpips_net net)
{
    int layer[SQUEEZENET_LAYERS];

    memset(l, 0, sizeof *l);
    l->net = net;
    params_init(&l->ps);
    tape_init(&l->tape, &l->ps, 3, true);
    if (net == LPIPS_ALEXNET) {
        lpips_declare_alexnet(l);
    } else {
        squeezenet_declare(layer, &l->tape);
        for (; l->layers < LPIPS_LAYERS; l->layers++) {
            l->map[l->layers] = layer[squeezenet[l->layers]];
            l->lin[l->layers] = NN_NONE;
        }
    }
    for (int i = 0; i < l->layers; i++)
        tape_keep(&l->tape, l->map[i]);
}

int lpips_init(struct lpips *l, enum lpips_net net, const char *path,
               struct error *err)
{
    lpips_declare(l, net);
    if (params_open(&l->ps, path, err) == 0)
        return 0;
    lpips_release(l);
    return -1;
}

void lpips_release(struct lpips *l)
{
    tape_release(&l->tape);
    arena_release(&l->memory);
    params_release(&l->ps);
    memset(l, 0, sizeof *l);
}

/* Layer i of the picture that was looked at last: *n pixels, *C channels. */
static const float *lpips_layer(size_t *n, size_t *C, const struct lpips *l,
                                int i)
{
    size_t shape[4];
    const float *x = tape_map(shape, &l->tape, l->map[i]);

    *n = shape[1] * shape[2];
    *C = shape[3];
    return x;
}

int lpips_plan(struct lpips *l, size_t H, size_t W, struct error *err)
{
    const struct nn_options opt = {l->learns ? NN_FROZEN : NN_INFER, NN_F32};
    const size_t border = input[l->net].border;
    const size_t h = H + 2 * border, w = W + 2 * border;
    struct arena *a = &l->memory;
    size_t n, C;

    if (H < 64 || W < 64)
        return error_set(err, EX_DATAERR, "lpips of %zux%zu pixels (expected "
                         "sides of 64 or more)", W, H);
    l->H = l->W = 0;
    arena_release(a);
    if (tape_plan(&l->tape, 1, h, w, opt, err))
        return -1;
    l->in = arena_take(a, 3 * h * w, sizeof *l->in);
    l->din = arena_take(a, l->learns ? 3 * h * w : 0, sizeof *l->din);
    for (int i = 0; i < l->layers; i++) {
        lpips_layer(&n, &C, l, i);
        l->first[i] = arena_take(a, n * C, sizeof *l->first[i]);
        l->d[i] = arena_take(a, l->learns ? n * C : 0, sizeof *l->d[i]);
    }
    if (arena_check(a, "features", err))
        return -1;
    l->H = H;
    l->W = W;
    return 0;
}

/* Pixel i of a picture in l->in, which has a border. */
static size_t lpips_place(const struct lpips *l, size_t i)
{
    const size_t border = input[l->net].border;

    return 3 * ((i / l->W + border) * (l->W + 2 * border) + i % l->W + border);
}

/* Every layer of a picture. */
static void lpips_look(struct lpips *l, const float *rgb)
{
    const struct lpips_input *how = &input[l->net];
    const size_t n = l->H * l->W;

    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            l->in[lpips_place(l, i) + c] =
                (how->gain * rgb[c * n + i] - how->offset - how->shift[c]) /
                how->scale[c];
    tape_forward(NULL, l->in, &l->tape);
}

/* One over the length of x (C), a pixel's features. */
static double lpips_inverse_length(const float *x, size_t C)
{
    double sum = 0;

    for (size_t c = 0; c < C; c++)
        sum += (double)x[c] * x[c];
    return 1 / (sqrt(sum) + 1e-10);
}

/* Mean over n places of sum_c w_c (a_c/|a| - b_c/|b|)^2, their features a and b
 * (n,C); w (C) or NULL, all 1.  g (n,C), unless NULL, += the gradient by b: with
 * u = b/|b| and e = 2 w (u - a/|a|) it is (e - u (u . e)) / |b|, over n. */
static double lpips_feature_distance(float *g, const float *a, const float *b,
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

/* Of layer i; g (NULL: not wanted) += its gradient by the second picture. */
static double lpips_layer_distance(float *g, const struct lpips *l, int i)
{
    size_t n, C;
    const float *x = lpips_layer(&n, &C, l, i);

    return lpips_feature_distance(g, l->first[i], x,
                                  l->lin[i] == NN_NONE
                                      ? NULL : param_w(&l->ps, l->lin[i]),
                                  n, C);
}

void lpips_first(struct lpips *l, const float *rgb)
{
    size_t n, C;

    lpips_look(l, rgb);
    for (int i = 0; i < l->layers; i++) {
        const float *x = lpips_layer(&n, &C, l, i);

        memcpy(l->first[i], x, n * C * sizeof *x);
    }
}

double lpips_second(struct lpips *l, const float *rgb)
{
    double sum = 0;

    lpips_look(l, rgb);
    for (int i = 0; i < l->layers; i++)
        sum += lpips_layer_distance(NULL, l, i);
    return sum;
}

int lpips_distance(double *distance, struct lpips *l, const float *a,
                   const float *b, size_t H, size_t W, struct error *err)
{
    if ((H != l->H || W != l->W) && lpips_plan(l, H, W, err))
        return -1;
    lpips_first(l, a);
    *distance = lpips_second(l, b);
    return 0;
}

/* ---- the gradient ------------------------------------------------------- */

void lpips_backward(float *db, struct lpips *l)
{
    const struct lpips_input *how = &input[l->net];
    const size_t pixels = l->H * l->W;
    struct tape_seed seed[LPIPS_LAYERS];
    size_t n, C;

    for (int i = 0; i < l->layers; i++) {
        lpips_layer(&n, &C, l, i);
        memset(l->d[i], 0, n * C * sizeof *l->d[i]);
        lpips_layer_distance(l->d[i], l, i);
        seed[i] = (struct tape_seed){l->map[i], l->d[i]};
    }
    tape_backward(l->din, seed, (size_t)l->layers, &l->tape);
    for (size_t i = 0; i < pixels; i++)
        for (size_t c = 0; c < 3; c++)
            db[c * pixels + i] = l->din[lpips_place(l, i) + c] * how->gain /
                                 how->scale[c];
}
