/* Gradients of a frame on all threads.  Every tile adds up, for each Gaussian
 * it touches, sums over its pixels (backward_tmpl.c) at a place of its own, so
 * that no two threads write to one; a second pass adds each Gaussian's places
 * in a fixed order and goes from the screen to its parameters
 * (gradient_tmpl.c). */
#include "lib/splat/backward.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/pages.h"
#include "lib/base/parallel.h"
#include "lib/base/slices.h"
#include "lib/splat/kernels.h"
#include "lib/splat/splat.h"

int backward_init(struct splat *s)
{
    size_t pixels = (size_t)s->opt.width * (size_t)s->opt.height;
    struct splat_gradient_state *b = calloc(1, sizeof *b);

    s->state->gradient = b;
    if (!b)
        return -1;
    b->stride = 16 + s->state->row;
    b->T = malloc(pixels * sizeof *b->T);
    b->image = malloc(pixels * (size_t)s->opt.channels * sizeof *b->image);
    if (s->opt.place)
        b->place = malloc(pixels * SPLAT_PLACE_CHANNELS * sizeof *b->place);
    return b->T && b->image && (b->place || !s->opt.place) ? 0 : -1;
}

void backward_release(struct splat *s)
{
    struct splat_gradient_state *b = s->state->gradient;

    if (!b)
        return;
    pages_free(b->pair, b->pair_bytes);
    free(b->seen);
    free(b->each);
    free(b->T);
    free(b->image);
    free(b->place);
    free(b);
}

/* Room per Gaussian, and what a given quaternion and opacity are divided by. */
int backward_load(struct splat *s, const struct gaussians *g,
                  struct error *err)
{
    struct splat_gradient_state *b = s->state->gradient;
    const size_t n = (g->n + 15) / 16 * 16 + 16;
    const struct slice each[] = {
        {&b->range, n * sizeof *b->range / sizeof(float), false},
        {&b->inverse_length, n, false}, {&b->inverse_opacity, n, false},
        {&b->rt, (n / GRADIENT_BATCH + 1) * 12 * sizeof *b->rt / sizeof(float),
         false}
    };

    if (b->n != n && slices_allocate(&b->each, each, sizeof each / sizeof *each,
                                     false, err)) {
        b->n = 0;
        return -1;
    }
    b->n = n;
    for (size_t i = 0; i < n; i++) {
        b->inverse_length[i] = 1;
        b->inverse_opacity[i] =
            i < g->n && g->opacity[i] > 0 ? 1 / g->opacity[i] : 0;
    }
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

/* T and the image without background go where splat_backward finds them. */
void backward_keep(struct splat *s, struct target *out)
{
    struct splat_gradient_state *b = s->state->gradient;

    out->final_T = b->T;
    out->background_free = b->image;
    out->kept_place = out->place ? b->place : NULL;
    b->placed = out->place != NULL;
    b->drawn = true;
    memset(b->background, 0, sizeof b->background);
    if (out->background)
        memcpy(b->background, out->background,
               (size_t)s->opt.channels * sizeof *b->background);
}

/* Room for the pairs of the last frame. */
static int backward_make_room(struct splat *s, struct error *err)
{
    struct splat_gradient_state *b = s->state->gradient;

    if (s->pairs <= b->room)
        return 0;
    pages_free(b->pair, b->pair_bytes);
    free(b->seen);
    b->room = s->pairs + s->pairs / 8;
    b->pair_bytes = b->room * (size_t)b->stride * sizeof *b->pair;
    b->pair = pages_alloc(b->pair_bytes);
    b->seen = malloc(b->room);
    if (b->pair && b->seen)
        return 0;
    b->room = 0;
    return error_set(err, EX_OSERR, "gradients of %zu (tile, Gaussian) pairs: "
                     "out of memory", s->pairs);
}

/* What the steps of a backward share. */
struct pulling {
    struct splat *s;
    const struct splat_kernels *k;
    const struct splat_gradients *g;
    const struct splat_picture_gradients *d;
    uint32_t part[SPLAT_MAX_THREADS];       /* pairs of each share */
};

/* Number the pairs of share t of the Gaussians, from 0 on. */
static void backward_number_pairs(void *ctx, size_t t)
{
    struct pulling *p = ctx;
    const struct splat *s = p->s;
    const struct splat_state *st = s->state;
    struct splat_gradient_state *b = st->gradient;
    size_t last = state_share(s->n, (int)t + 1, st->threads);
    uint32_t sum = 0;

    for (size_t i = state_share(s->n, (int)t, st->threads); i < last; i++) {
        struct rect r = st->rect[i];
        uint32_t across = (uint32_t)(r.x1 - r.x0);

        b->range[i] = (struct pair_range){sum - r.y0 * across - r.x0, across};
        if (st->key[i] != HIDDEN)
            sum += across * (uint32_t)(r.y1 - r.y0);
    }
    p->part[t] = sum;
}

/* A share begins where those before it end; and nothing is seen yet. */
static void backward_join_numbers(void *ctx, size_t t)
{
    const struct pulling *p = ctx;
    const struct splat *s = p->s;
    const int threads = s->state->threads;
    struct splat_gradient_state *b = s->state->gradient;
    size_t first = state_share(s->n, (int)t, threads);
    size_t last = state_share(s->n, (int)t + 1, threads);
    uint32_t at = 0;

    for (size_t k = 0; k < t; k++)
        at += p->part[k];
    for (size_t i = first; at && i < last; i++)
        b->range[i].origin += at;
    first = state_share(s->pairs, (int)t, threads);
    memset(b->seen + first, 0,
           state_share(s->pairs, (int)t + 1, threads) - first);
}

/* Tile i in Z order. */
static void backward_tile(void *ctx, size_t i)
{
    const struct pulling *p = ctx;
    const struct splat_state *st = p->s->state;

    p->k->tile_backward(p->s, state_work(st), st->zorder[i], p->d);
}

/* Batch i of Gaussians. */
static void backward_batch(void *ctx, size_t i)
{
    const struct pulling *p = ctx;
    size_t first = i * GRADIENT_BATCH, last = first + GRADIENT_BATCH;

    p->k->gaussian_backward(p->s, first, last < p->s->n ? last : p->s->n, p->g,
                            p->s->state->gradient->rt + 12 * i);
}

/* rt += the batches' sums, in double and in order. */
static void backward_sum_camera(float *rt, const double *part, size_t batches)
{
    for (int k = 0; k < 12; k++) {
        double sum = 0;

        for (size_t i = 0; i < batches; i++)
            sum += part[12 * i + (size_t)k];
        rt[k] += (float)sum;
    }
}

/* Number the pairs, sum up tile by tile, then Gaussian by Gaussian. */
int splat_backward(struct splat *s, const struct splat_gradients *g,
                   const struct splat_picture_gradients *d,
                   struct error *err)
{
    struct splat_state *st = s->state;
    struct splat_gradient_state *b = st->gradient;
    struct pulling p = {.s = s, .k = splat_kernels(st->level), .g = g, .d = d};
    const size_t shares = (size_t)st->threads;
    size_t batches = (s->n + GRADIENT_BATCH - 1) / GRADIENT_BATCH;

    if (!b || !b->drawn || !st->projected)
        return error_set(err, EX_SOFTWARE, "no picture to differentiate "
                         "(expected splat_draw with opt.gradients)");
    if (d->place && !b->placed)
        return error_set(err, EX_SOFTWARE, "no places to differentiate "
                         "(expected splat_draw with them)");
    if (backward_make_room(s, err))
        return -1;
    b->pulled = d->place != NULL;
    parallel_for(shares, 1, backward_number_pairs, &p);
    parallel_for(shares, 1, backward_join_numbers, &p);
    parallel_for((size_t)(st->view.tx * st->view.ty), 1, backward_tile, &p);
    parallel_for(batches, 1, backward_batch, &p);
    if (g->rt)
        backward_sum_camera(g->rt, b->rt, batches);
    return 0;
}
