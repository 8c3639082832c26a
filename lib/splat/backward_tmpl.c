/* Gradients of a tile's pixels: the forward walk again, front to back, with
 * what is behind each Gaussian as the whole minus what has passed. */
#include <string.h>

#include "lib/base/isa.h"
#include "lib/splat/backward.h"
#include "lib/splat/chunk.h"

#define LN2 0.693147181f

void ISA(splat_tile_backward)(const struct splat *s, struct splat_work *w,
                              uint32_t t, const float *d_image,
                              const float *d_alpha);

/* Load dL/dcolor of the tile, and rest = what all the light is worth:
 * sum_i w_i c_i.g + T (background.g - dL/dalpha). */
static void load_pixels(struct splat_work *w, const struct splat *s,
                        const float *d_image, const float *d_alpha, int x0,
                        int y0)
{
    const struct splat_gradient_state *b = s->state->gradient;
    int C = s->opt.channels;

    memset(w->g, 0, sizeof w->g);
    for (int k = 0; k < BLOCKS; k++) {
        w->alive[k] = 0;
        for (int p = 0; p < VEC; p++) {
            int x = x0 + 4 * (k & 3) + PIXEL_X(p);
            int y = y0 + 4 * (k >> 2) + PIXEL_Y(p);
            float sum = 0, behind = 0;

            w->T[k][p] = 1;
            w->rest[k][p] = 0;
            if (x >= s->opt.width || y >= s->opt.height)
                continue;
            size_t at = (size_t)y * (size_t)s->opt.width + (size_t)x;
            const float *g = d_image + at * (size_t)C;
            const float *c = b->image + at * (size_t)C;

            for (int m = 0; m < C; m++) {
                w->g[k][m][p] = g[m];
                sum += c[m] * g[m];
                behind += b->background[m] * g[m];
            }
            w->rest[k][p] =
                sum + b->T[at] * (behind - (d_alpha ? d_alpha[at] : 0));
            w->alive[k] |= 1u << p;
        }
    }
}

/* 1 / (1 - alpha); alpha <= 0.99. */
VEC_INLINE vf inverse(vf x)
{
#ifdef ISA_AVX512
    vf r = (vf)_mm512_rcp14_ps((__m512)x);

    return r * vf_fnma(x, r, vf_set(2));
#else
    return vf_set(1) / x;
#endif
}

/* worth[j] = color_j . g at the block's pixels, for all entries of its list. */
static void worths(struct splat_work *w, int b, const float *table, int row)
{
    const uint32_t *list = w->list[b];
    uint32_t n = w->count[b];

    for (uint32_t j = 0; j < n; j += 4) {
        const float *c[4];
        vf acc[4];

        for (uint32_t k = 0; k < 4; k++) {
            uint32_t e = list[j + k < n ? j + k : j];

            c[k] = table + (size_t)w->index[e] * (size_t)row;
            acc[k] = vf_set(0);
        }
        for (int m = 0; m < row; m++) {
            vf g = vf_load(w->g[b][m]);

#pragma GCC unroll 4
            for (int k = 0; k < 4; k++)
                acc[k] = vf_fma(vf_set(c[k][m]), g, acc[k]);
        }
        for (uint32_t k = 0; k < 4; k++)
            vf_store(w->worth[j + k], acc[k]);
    }
}

/* Sums over the block's pixels of dL/dq times 1, x, y, xx, xy, yy; lanes are
 * Gaussians, d[p] pixel p.  (bx, by) is the block's centre. */
VEC_INLINE void moments(vf m[MOMENTS], const vf d[16], float bx, float by)
{
    vf sum[4], first[4], second[4];        /* of columns: 1, y, yy */

#pragma GCC unroll 4
    for (int x = 0; x < 4; x++) {
        vf outer = d[4 * x] + d[4 * x + 3], inner = d[4 * x + 1] + d[4 * x + 2];
        vf wide = d[4 * x + 3] - d[4 * x], thin = d[4 * x + 2] - d[4 * x + 1];

        sum[x] = outer + inner;
        first[x] = vf_set(1.5f) * wide + vf_set(0.5f) * thin;
        second[x] = vf_set(2.25f) * outer + vf_set(0.25f) * inner;
    }
    vf zero = sum[0] + sum[1] + sum[2] + sum[3];
    vf y = first[0] + first[1] + first[2] + first[3];
    vf yy = second[0] + second[1] + second[2] + second[3];
    vf x = vf_set(1.5f) * (sum[3] - sum[0]) + vf_set(0.5f) * (sum[2] - sum[1]);
    vf xx = vf_set(2.25f) * (sum[3] + sum[0]) +
            vf_set(0.25f) * (sum[2] + sum[1]);
    vf xy = vf_set(1.5f) * (first[3] - first[0]) +
            vf_set(0.5f) * (first[2] - first[1]);
    vf X = vf_set(bx), Y = vf_set(by);

    m[0] = zero;
    m[1] = vf_fma(X, zero, x);
    m[2] = vf_fma(Y, zero, y);
    m[3] = vf_fma(X, vf_fma(X, zero, x + x), xx);
    m[4] = vf_fma(X, vf_fma(Y, zero, y), vf_fma(Y, x, xy));
    m[5] = vf_fma(Y, vf_fma(Y, zero, y + y), yy);
}

/* Add the sums of up to 16 list entries to their rows of w->pair. */
VEC_INLINE void flush(struct splat_work *w, int b, const uint32_t *list,
                      uint32_t n, vf dq[16], vf weight[16],
                      const int channels)
{
    vf out[16];

    vf_transpose(dq);
    moments(out, dq, 4 * (float)(b & 3) - 6, 4 * (float)(b >> 2) - 6);
    for (int k = MOMENTS; k < 16; k++)
        out[k] = vf_set(0);
    if (channels <= 3) {
        vf_transpose(weight);
        for (int c = 0; c < channels; c++) {
            vf sum = vf_set(0);

#pragma GCC unroll 16
            for (int p = 0; p < VEC; p++)
                sum = vf_fma(weight[p], vf_set(w->g[b][c][p]), sum);
            out[MOMENTS + c] = sum;
        }
    }
    vf_transpose(out);
    for (uint32_t k = 0; k < n; k++) {
        float *to = w->pair[list[k]];

        vf_store(to, vf_load(to) + out[k]);
    }
}

/* dcolor (entry, row) += weight (entry, 16 pixels) g (16 pixels, row). */
static void color_backward(struct splat_work *w, int b, uint32_t n, int row)
{
    for (int part = 0; part < row; part += VEC) {
        vf g[16];

        for (int c = 0; c < VEC; c++)
            g[c] = vf_load(w->g[b][part + c]);
        vf_transpose(g);
        for (uint32_t j = 0; j < n; j++) {
            float *to = w->dcolor[w->list[b][j]] + part;
            vf sum = vf_load(to);

#pragma GCC unroll 16
            for (int p = 0; p < VEC; p++)
                sum = vf_fma(vf_set(w->weight[j][p]), g[p], sum);
            vf_store(to, sum);
        }
    }
}

/* One block: channels 3 keeps colours in the chunk, more go through worths and
 * color_backward. */
VEC_INLINE void block_backward(struct splat_work *w, int b,
                               const struct splat_state *st, const int degree,
                               const int wide)
{
    const struct view *v = &st->view;
    const uint32_t *list = w->list[b];
    uint32_t n = w->count[b], j = 0;
    vf x = block_x(b), T = vf_load(w->T[b]), rest = vf_load(w->rest[b]), g[3];
    vf cut = vf_set(v->cut), stop = vf_set(v->t_cut), clamp = vf_set(0.99f);
    vm alive = vm_from_bits(w->alive[b]);

    if (wide)
        worths(w, b, st->table, st->row);
    for (int c = 0; c < 3; c++)
        g[c] = vf_load(w->g[b][c]);
    while (j < n && vm_bits(alive)) {
        vf dq[16], keep[16], e[4];
        vm on[4];
        uint32_t m = n - j < VEC ? n - j : VEC;

        for (uint32_t i = 0; i < VEC; i++) {
            const float *c = w->info[list[j + i]];
            uint32_t at = i % 4;

            if (i >= m) {              /* the list's end is padded to four */
                dq[i] = keep[i] = vf_set(0);
                if (!at)
                    e[0] = e[1] = e[2] = e[3] = vf_set(0);
                continue;
            }
            if (!at) {
                exponents(e, w, list + j + i, b, x);
                FOUR on[k] = vf_ge(e[k], cut);
                vf_exp2_four(e, degree);
            }
            vf raw = vf_keep(on[at], e[at]), alpha = vf_min(raw, clamp);
            vf next = vf_fnma(alpha, T, T), worth;

            if (wide)
                worth = vf_load(w->worth[j + i]);
            else
                worth = vf_fma(vf_set(c[1]), g[0],
                        vf_fma(vf_set(c[2]), g[1], vf_set(c[3]) * g[2]));
            alive = vf_gt_and(alive, next, stop);
            vf weight = vf_mul_keep(alive, alpha, T);

            /* image = sum w c + T bg: behind this one is rest - w c.g, and
             * 1 - alpha divides it */
            rest = vf_fnma(weight, worth, rest);
            vf da = vf_fnma(rest, inverse(vf_set(1) - alpha), T * worth);
            vm free = v->dgr ? alive : vf_gt_and(alive, clamp, raw);

            dq[i] = vf_mul_keep(free, da, alpha * vf_set(LN2));
            T = vf_sel(alive, next, T);
            keep[i] = weight;
            if (wide)
                vf_store(w->weight[j + i], weight);
        }
        flush(w, b, list + j, m, dq, keep, wide ? 32 : 3);
        j += m;
    }
    if (wide)
        color_backward(w, b, j, st->row);
    vf_store(w->T[b], T);
    vf_store(w->rest[b], rest);
    w->alive[b] = vm_bits(alive);
}

/* Each combination is compiled apart; few people differentiate at less than
 * degree 5. */
static void block(struct splat_work *w, int b, const struct splat_state *st,
                  int degree)
{
    switch ((degree <= 3 ? 3 : 5) * 2 + (st->row > 0)) {
    case 6: block_backward(w, b, st, 3, 0); return;
    case 7: block_backward(w, b, st, 3, 1); return;
    case 10: block_backward(w, b, st, 5, 0); return;
    default: block_backward(w, b, st, 5, 1); return;
    }
}

static void chunk(struct splat_work *w, const struct splat *s,
                  const uint32_t *list, uint32_t n, float cx, float cy)
{
    chunk_build(w, s->state, list, n, cx, cy, false);
    memset(w->pair, 0, n * sizeof w->pair[0]);
    if (s->state->row)
        memset(w->dcolor, 0, n * sizeof w->dcolor[0]);
    for (int b = 0; b < BLOCKS; b++)
        if (w->count[b])
            block(w, b, s->state, s->opt.exp_degree);
}

/* The chunk's sums to their pairs' places. */
static void store_pairs(const struct splat_work *w, const struct splat *s,
                        const uint32_t *list, uint32_t n, int tx, int ty)
{
    const struct splat_state *st = s->state;
    struct splat_gradient_state *b = st->gradient;
    size_t colors = (size_t)s->opt.channels * sizeof(float);

    for (uint32_t e = 0; e < n; e++) {
        struct rect r = st->rect[list[e]];
        size_t at = b->base[list[e]] +
                    (size_t)((ty - r.y0) * (r.x1 - r.x0) + tx - r.x0);
        float *to = b->pair + at * (size_t)b->stride;

        if (st->row) {
            memcpy(to, w->pair[e], MOMENTS * sizeof(float));
            memcpy(to + MOMENTS, w->dcolor[e], colors);
        } else {
            memcpy(to, w->pair[e], VEC * sizeof(float));
        }
        b->seen[at] = 1;
    }
}

void ISA(splat_tile_backward)(const struct splat *s, struct splat_work *w,
                              uint32_t t, const float *d_image,
                              const float *d_alpha)
{
    const struct splat_state *st = s->state;
    int tx = (int)(t % (uint32_t)st->view.tx);
    int ty = (int)(t / (uint32_t)st->view.tx);
    uint32_t any = 1;

    load_pixels(w, s, d_image, d_alpha, TILE * tx, TILE * ty);
    for (uint32_t i = st->start[t]; i < st->end[t] && any; i += CHUNK) {
        uint32_t n = st->end[t] - i < CHUNK ? st->end[t] - i : CHUNK;

        chunk(w, s, st->list + i, n, (float)(TILE * tx) + 8,
              (float)(TILE * ty) + 8);
        store_pairs(w, s, st->list + i, n, tx, ty);
        any = 0;
        for (int b = 0; b < BLOCKS; b++)
            any |= w->alive[b];
    }
}
