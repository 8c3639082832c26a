/* Winograd convolution F(4x4,3x3) (Lavin and Gray 2016): weights transformed
 * once, then tiles in groups: transform, 36 matrix products, transform
 * back. */
#include "lib/nn/winograd.h"

#include <string.h>

#include "lib/base/parallel.h"
#include "lib/nn/conv.h"
#include "lib/nn/kernels.h"

#define PIECE 64         /* terms of one chain of a float's sum */
#define PANEL WINOGRAD_PANEL

/* As many tiles as keep a thread's share of the second-level cache, but enough
 * for the weights to be worth their way from memory. */
static size_t winograd_tile_count(size_t in, size_t out)
{
    size_t n = 262144 / (36 * (in + out)) / 12 * 12;

    return n < 48 ? 48 : n > 120 ? 120 : n;
}

/* n floats rounded up to an odd number of 64-byte lines */
static size_t winograd_odd_lines(size_t n)
{
    return ((n + 15) / 16 | 1) * 16;
}

void winograd_plan(struct winograd *g, const struct conv *c, struct nn_plan *p)
{
    *g = (struct winograd){ .batch = c->batch, .h = c->h, .w = c->w,
                            .in = c->in_data, .out = c->out, .act = c->act,
                            .add = c->add, .plan = p };
    g->tiles = winograd_tile_count(g->in, g->out);
    /* against rounding; beside bfloat16's own it would not be seen */
    g->piece = nn_plan_type(p) == NN_BF16 || g->in < PIECE ? g->in : PIECE;
    g->u_size = g->in * ((g->out + PANEL - 1) / PANEL * PANEL);
    g->u = nn_plan_floats(p, 36 * g->u_size);
    g->bias = nn_plan_floats(p, g->out);
    g->v_size = winograd_odd_lines(g->tiles * g->in);
    g->m_size = winograd_odd_lines(g->tiles * g->out);
    g->work = 36 * (g->v_size + g->m_size);
    nn_plan_scratch(p, g->work * sizeof(float) *
                           (size_t)parallel_width());
}

/* Panel p, piece by piece, as gemm_pack lays it out. */
PARALLEL(winograd_update_part, p, const float *, w, struct winograd *, g)
{
    const size_t in = g->in, rest = g->out - p * PANEL;
    const size_t wide = (g->out + PANEL - 1) / PANEL * PANEL;

    for (size_t i = 0; i < in; i++) {
        const size_t first = i / g->piece * g->piece;
        const size_t terms = in - first < g->piece ? in - first : g->piece;
        const size_t at = first * wide + (p * terms + i - first) * PANEL;

        nn_kernels()->winograd_weights(g->u + at, g->u_size,
                                       w + (p * PANEL * in + i) * 9, in * 9,
                                       rest < PANEL ? rest : PANEL);
    }
}

void winograd_update(struct winograd *g, const float *w, const float *bias)
{
    memcpy(g->bias, bias, g->out * sizeof *bias);
    parallel_each(winograd_update_part, (g->out + PANEL - 1) / PANEL, 1, w, g);
}

/* The number of tile i of those that are wanted. */
static size_t winograd_tile(const struct winograd *g, size_t i)
{
    return g->list ? g->list[i] : i;
}

/* Tiles [t0, t0 + n) of those that are wanted. */
static void winograd_group(float *out, const float *in,
                           const struct winograd *g, float *v, size_t t0,
                           size_t n)
{
    const struct nn_kernels *k = nn_kernels();
    size_t across = (g->w + 3) / 4, image = across * ((g->h + 3) / 4);
    float *m = v + 36 * g->v_size;

    for (size_t i = 0; i < n; i++) {
        size_t b = winograd_tile(g, t0 + i) / image;
        size_t t = winograd_tile(g, t0 + i) % image;

        k->winograd_input(v, in + b * g->h * g->w * g->in, g, i,
                          (ptrdiff_t)(t / across * 4) - 1,
                          (ptrdiff_t)(t % across * 4) - 1);
    }
    for (size_t j = 0; j < 36; j++)
        for (size_t i = 0; i < g->in; i += g->piece) {
            float *to = m + j * g->m_size;

            k->gemm(to, g->out, v + j * g->v_size + i, g->in, 1,
                    g->u + j * g->u_size + i * (g->u_size / g->in), n, g->out,
                    g->in - i < g->piece ? g->in - i : g->piece,
                    i > 0 ? to : NULL, g->out);
        }
    for (size_t i = 0; i < n; i++) {
        size_t b = winograd_tile(g, t0 + i) / image;
        size_t t = winograd_tile(g, t0 + i) % image;

        k->winograd_output(out + b * g->h * g->w * g->out, m, g, i,
                           t / across * 4, t % across * 4);
    }
}

/* One chunk. */
PARALLEL(winograd_forward_part, k, struct winograd *, g, float *, out,
         const float *, in, size_t, all)
{
    size_t t = k * g->tiles;
    float *v = (float *)(void *)g->plan->scratch + parallel_slot() * g->work;

    winograd_group(out, in, g, v, t, all - t < g->tiles ? all - t : g->tiles);
}

void winograd_forward(float *out, const float *in, struct winograd *g)
{
    size_t all = g->list ? g->listed
                         : g->batch * ((g->w + 3) / 4) * ((g->h + 3) / 4);

    parallel_each(winograd_forward_part, (all + g->tiles - 1) / g->tiles, 1, g,
                  out, in, all);
}
