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
    size_t out, kernel, stride;
} stage[LPIPS_STAGES] = {
    {0, 0, 64, 11, 4}, {3, 1, 192, 5, 1}, {6, 1, 384, 3, 1},
    {8, 0, 256, 3, 1}, {10, 0, 256, 3, 1},
};
#define BORDER 2

/* The network sees (2 rgb - 1 - shift) / scale. */
static const float lpips_shift[3] = {-0.030f, -0.088f, -0.188f};
static const float lpips_scale[3] = {0.458f, 0.448f, 0.450f};

void lpips_declare(struct lpips *l)
{
    struct tape *t = &l->tape;
    char name[40];
    int x = 0;

    memset(l, 0, sizeof *l);
    params_init(&l->ps);
    tape_init(t, &l->ps, 3);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        const size_t lin[4] = {1, stage[i].out, 1, 1};

        if (stage[i].pool)
            x = tape_pool(t, x, false);
        snprintf(name, sizeof name, "features.%d", stage[i].index);
        x = l->map[i] = tape_conv(t, x, name, stage[i].out, stage[i].kernel,
                                  true);
        tape_layer(t, x)->stride = stage[i].stride;
        tape_layer(t, x)->pad = i ? CONV_HALF : CONV_NONE;
        tape_layer(t, x)->act = ACT_RELU;
        snprintf(name, sizeof name, "lin%d.model.1.weight", i);
        l->lin[i] = params_add(&l->ps, name, 4, lin, PARAM_ZERO, 1);
        l->ps.tensor[l->lin[i]].frozen = true;
    }
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
    tape_release(&l->tape);
    arena_release(&l->memory);
    params_release(&l->ps);
    memset(l, 0, sizeof *l);
}

/* Stage i of the picture that was looked at last: its numbers, *n of them. */
static const float *lpips_stage(size_t *n, const struct lpips *l, int i)
{
    size_t shape[4];
    const float *x = tape_map(shape, &l->tape, l->map[i]);

    *n = shape[1] * shape[2] * shape[3];
    return x;
}

/* All stages for pictures of a size. */
static int lpips_plan(struct lpips *l, size_t H, size_t W, struct error *err)
{
    const struct nn_options opt = {l->learns ? NN_FROZEN : NN_INFER, NN_F32};
    const size_t h = H + 2 * BORDER, w = W + 2 * BORDER;
    struct arena *a = &l->memory;
    size_t n;

    l->H = l->W = 0;
    arena_release(a);
    if (tape_plan(&l->tape, h, w, opt, err))
        return -1;
    l->in = arena_take(a, 3 * h * w, sizeof *l->in);
    l->din = arena_take(a, l->learns ? 3 * h * w : 0, sizeof *l->din);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        lpips_stage(&n, l, i);
        l->first[i] = arena_take(a, n, sizeof *l->first[i]);
        l->d[i] = arena_take(a, l->learns ? n : 0, sizeof *l->d[i]);
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
    return 3 * ((i / l->W + BORDER) * (l->W + 2 * BORDER) + i % l->W + BORDER);
}

/* Every stage of a picture. */
static void lpips_look(struct lpips *l, const float *rgb)
{
    const size_t n = l->H * l->W;

    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            l->in[lpips_place(l, i) + c] =
                (2 * rgb[c * n + i] - 1 - lpips_shift[c]) / lpips_scale[c];
    tape_forward(l->in, &l->tape);
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
    size_t n;
    const float *x = lpips_stage(&n, l, i);

    return lpips_feature_distance(g, l->first[i], x,
                                  param_w(&l->ps, l->lin[i]),
                                  n / stage[i].out, stage[i].out);
}

int lpips_distance(double *distance, struct lpips *l, const float *a,
                   const float *b, size_t H, size_t W, struct error *err)
{
    size_t n;

    if (H < 64 || W < 64)
        return error_set(err, EX_DATAERR, "lpips of %zux%zu pixels (expected "
                         "sides of 64 or more)", W, H);
    if ((H != l->H || W != l->W) && lpips_plan(l, H, W, err))
        return -1;
    lpips_look(l, a);
    for (int i = 0; i < LPIPS_STAGES; i++) {
        const float *x = lpips_stage(&n, l, i);

        memcpy(l->first[i], x, n * sizeof *x);
    }
    lpips_look(l, b);
    *distance = 0;
    for (int i = 0; i < LPIPS_STAGES; i++)
        *distance += lpips_stage_distance(NULL, l, i);
    return 0;
}

/* ---- the gradient ------------------------------------------------------- */

void lpips_backward(float *db, struct lpips *l)
{
    const size_t n = l->H * l->W;
    struct tape_seed seed[LPIPS_STAGES];
    size_t count;

    for (int i = 0; i < LPIPS_STAGES; i++) {
        lpips_stage(&count, l, i);
        memset(l->d[i], 0, count * sizeof *l->d[i]);
        lpips_stage_distance(l->d[i], l, i);
        seed[i] = (struct tape_seed){l->map[i], l->d[i]};
    }
    tape_backward(l->din, seed, LPIPS_STAGES, &l->tape);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++)
            db[c * n + i] = l->din[lpips_place(l, i) + c] * 2 / lpips_scale[c];
}
