#include "lib/splat/backward.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

int backward_init(struct splat *s)
{
    size_t pixels = (size_t)s->opt.width * (size_t)s->opt.height;
    struct splat_gradient_state *b = calloc(1, sizeof *b);

    s->state->gradient = b;
    if (!b)
        return -1;
    b->stride = (MOMENTS + s->opt.channels + 15) / 16 * 16;
    b->T = malloc(pixels * sizeof *b->T);
    b->image = malloc(pixels * (size_t)s->opt.channels * sizeof *b->image);
    return b->T && b->image ? 0 : -1;
}

void backward_release(struct splat *s)
{
    struct splat_gradient_state *b = s->state->gradient;

    if (!b)
        return;
    free(b->pair);
    free(b->seen);
    free(b->base);
    free(b->inverse_length);
    free(b->rt);
    free(b->T);
    free(b->image);
    free(b);
}

int backward_load(struct splat *s, const struct gaussians *g,
                  struct error *err)
{
    struct splat_gradient_state *b = s->state->gradient;
    size_t n = (g->n + 15) / 16 * 16 + 16;

    if (b->n != n) {
        free(b->base);
        free(b->inverse_length);
        free(b->rt);
        b->n = n;
        b->base = malloc((n + 1) * sizeof *b->base);
        b->inverse_length = malloc(n * sizeof *b->inverse_length);
        b->rt = malloc((n / GRADIENT_BATCH + 1) * 12 * sizeof *b->rt);
        if (!b->base || !b->inverse_length || !b->rt) {
            b->n = 0;
            return error_set(err, EX_OSERR, "%zu Gaussians: out of memory",
                             g->n);
        }
    }
    for (size_t i = 0; i < n; i++)
        b->inverse_length[i] = 1;
    for (size_t i = 0; !s->state->view.dgr && i < g->n; i++) {
        const float *q = g->quat + 4 * i;
        double l2 = 0;

        for (int k = 0; k < 4; k++)
            l2 += (double)q[k] * q[k];
        b->inverse_length[i] = (float)(1 / fmax(sqrt(l2), 1e-12));
    }
    b->drawn = false;
    return 0;
}

void backward_keep(struct splat *s, struct target *out)
{
    struct splat_gradient_state *b = s->state->gradient;

    out->final_T = b->T;
    out->bare = b->image;
    b->drawn = true;
    memset(b->background, 0, sizeof b->background);
    if (out->background)
        memcpy(b->background, out->background,
               (size_t)s->opt.channels * sizeof *b->background);
}

/* Number the pairs Gaussian by Gaussian. */
static int number_pairs(struct splat *s, struct error *err)
{
    struct splat_state *st = s->state;
    struct splat_gradient_state *b = st->gradient;
    size_t sum = 0;

    for (size_t i = 0; i < s->n; i++) {
        const struct rect *r = &st->rect[i];

        b->base[i] = (uint32_t)sum;
        if (st->key[i] != HIDDEN)
            sum += (size_t)(r->x1 - r->x0) * (size_t)(r->y1 - r->y0);
    }
    for (size_t i = s->n; i <= b->n; i++)
        b->base[i] = (uint32_t)sum;
    if (sum > b->room) {
        free(b->pair);
        free(b->seen);
        b->room = sum + sum / 8;
        b->pair = aligned_alloc(64, b->room * (size_t)b->stride *
                                        sizeof *b->pair);
        b->seen = malloc(b->room);
        if (!b->pair || !b->seen) {
            b->room = 0;
            return error_set(err, EX_OSERR, "gradients of %zu (tile, "
                             "Gaussian) pairs: out of memory", sum);
        }
    }
    if (sum)
        memset(b->seen, 0, sum);
    return 0;
}

static void sum_camera(float *rt, const double *part, size_t batches)
{
    for (int k = 0; k < 12; k++) {
        double sum = 0;

        for (size_t i = 0; i < batches; i++)
            sum += part[12 * i + (size_t)k];
        rt[k] += (float)sum;
    }
}

int splat_backward(struct splat *s, const struct splat_gradients *g,
                   const float *d_image, const float *d_alpha,
                   struct error *err)
{
    struct splat_state *st = s->state;
    struct splat_gradient_state *b = st->gradient;
    const struct splat_kernels *k = splat_kernels(st->level);
    uint32_t tiles = (uint32_t)(st->view.tx * st->view.ty);
    size_t batches = (s->n + GRADIENT_BATCH - 1) / GRADIENT_BATCH;

    if (!b || !b->drawn || !st->projected)
        return error_set(err, EX_SOFTWARE, "no picture to differentiate "
                         "(expected splat_forward with opt.gradients)");
    if (number_pairs(s, err))
        return -1;
#pragma omp parallel num_threads(st->threads)
    {
        struct splat_work *w = (struct splat_work *)
            ((char *)st->work +
             (size_t)omp_get_thread_num() * splat_work_size());

#pragma omp for schedule(dynamic, 1)
        for (uint32_t i = 0; i < tiles; i++)
            k->tile_backward(s, w, st->zorder[i], d_image, d_alpha);
#pragma omp for schedule(static)
        for (size_t i = 0; i < batches; i++) {
            size_t first = i * GRADIENT_BATCH, last = first + GRADIENT_BATCH;

            k->gaussian_backward(s, first, last < s->n ? last : s->n, g,
                                 b->rt + 12 * i);
        }
    }
    if (g->rt)
        sum_camera(g->rt, b->rt, batches);
    return 0;
}
