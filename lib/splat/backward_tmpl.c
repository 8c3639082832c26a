/* Gradients of a tile's pixels: the traversal of the forward pass again, front
 * to back, with what is behind each Gaussian as the whole minus what has
 * passed. */
#include <string.h>

#include "lib/base/isa.h"
#include "lib/splat/backward.h"
#include "lib/splat/chunk.h"

void ISA(splat_tile_backward)(const struct splat *s, struct splat_work *w,
                              uint32_t t,
                              const struct splat_picture_gradients *d);

/* Pixels of the block at (x0, y0), as numbers; those outside the picture are
 * taken as pixel 0.  Returns which are inside. */
VEC_INLINE uint32_t backward_pixels(vi *at, const struct splat *s, int x0,
                                    int y0)
{
    vi x = vi_set(x0) + (vi_iota() >> 2), y = vi_set(y0) + (vi_iota() & 3);
    vf W = vf_set((float)s->opt.width), H = vf_set((float)s->opt.height);
    vm in = vf_gt(W, __builtin_convertvector(x, vf));

    in = vf_gt_and(in, H, __builtin_convertvector(y, vf));
    *at = (y * s->opt.width + x) & (vi)vf_keep(in, (vf)vi_set(-1));
    return vm_bits(in);
}

/* Gradients of four channels at block k's pixels, for the sums of four
 * Gaussians. */
static void backward_load_grad_color(struct splat_work *w, int k,
                                     const float (*grad)[VEC])
{
    for (int p = 0; p < VEC; p++) {
        float r = grad[0][p], g = grad[1][p], b = grad[2][p], a = grad[3][p];

#if VEC == 16
        vf low = vf_sel((vm)0x00f0, vf_set(g), vf_set(r));
        vf high = vf_sel((vm)0x0f00, vf_set(b), vf_set(a));

        vf_store(w->grad_color[k][p], vf_sel((vm)0x00ff, low, high));
#else
        vq_store(w->grad_color[k][p], (vq){r, r, r, r});
        vq_store(w->grad_color[k][p] + 4, (vq){g, g, g, g});
        vq_store(w->grad_color[k][p] + 8, (vq){b, b, b, b});
        vq_store(w->grad_color[k][p] + 12, (vq){a, a, a, a});
#endif
    }
}

/* Fetch a tile's pixels, up to three channels. */
VEC_INLINE void backward_fetch_pixels(const struct splat *s,
                                      const float *d_image, int x0, int y0)
{
    const struct splat_gradient_state *b = s->state->gradient;
    size_t C = (size_t)s->opt.channels;
    size_t n = (size_t)(s->opt.width - x0 < TILE ? s->opt.width - x0 : TILE);

    for (int y = y0; y < y0 + TILE && y < s->opt.height; y++) {
        size_t at = (size_t)y * (size_t)s->opt.width + (size_t)x0;

        chunk_fetch(d_image + at * C, n * C * sizeof *d_image);
        chunk_fetch(b->image + at * C, n * C * sizeof *b->image);
        chunk_fetch(b->T + at, n * sizeof *b->T);
    }
}

/* dL/dplace of block k's pixels, numbers at; returns what the places are
 * worth. */
VEC_INLINE vf backward_load_places(struct splat_work *w, int k,
                                   const float *place, const float *d_place,
                                   vi at)
{
    vf sum = vf_set(0);

    for (int m = 0; m < SPLAT_PLACE_CHANNELS; m++) {
        vf g = vf_gather(d_place + m, at * SPLAT_PLACE_CHANNELS);

        vf_store(w->g_place[k][m], g);
        sum = vf_fma(vf_gather(place + m, at * SPLAT_PLACE_CHANNELS), g, sum);
    }
    backward_load_grad_color(w, k, (const float (*)[VEC])w->g_place[k]);
    return sum;
}

/* Load the gradients of the tile's pictures, and remaining = what all the
 * light is worth: sum_i w_i c_i.g + T (background.g - dL/dalpha), places among
 * the c_i. */
static void backward_load_pixels(struct splat_work *w, const struct splat *s,
                                 const struct splat_picture_gradients *d,
                                 int x0, int y0)
{
    const struct splat_gradient_state *b = s->state->gradient;
    const float *d_image = d->image;
    int C = s->opt.channels;

    if (!s->state->row)
        backward_fetch_pixels(s, d_image, x0, y0);
    for (int k = 0; k < SLICES; k++) {
        vf sum = vf_set(0), behind = sum;
        vi at;

        w->alive[k] = backward_pixels(&at, s, x0 + COLUMNS * (k % ACROSS),
                                      y0 + 4 * (k / ACROSS));
        vf_store(w->T[k], vf_set(1));
        for (int m = 0; m < C; m++) {
            vf g = vf_gather(d_image + m, at * C);

            vf_store(w->g[k][m], g);
            sum = vf_fma(vf_gather(b->image + m, at * C), g, sum);
            behind = vf_fma(vf_set(b->background[m]), g, behind);
        }
        for (int m = C; m < SPLAT_MAX_CHANNELS; m++)
            vf_store(w->g[k][m], vf_set(0));
        if (d->place)
            sum += backward_load_places(w, k, b->place, d->place, at);
        if (d->alpha)
            behind -= vf_gather(d->alpha, at);
        vf_store(w->remaining[k], vf_fma(vf_gather(b->T, at), behind, sum));
        if (!s->state->row)
            backward_load_grad_color(w, k, (const float (*)[VEC])w->g[k]);
    }
}

/* 1 / (1 - alpha); alpha <= 0.99. */
VEC_INLINE vf backward_inverse(vf x)
{
#ifdef ISA_AVX512
    vf r = (vf)_mm512_rcp14_ps((__m512)x);

    return r * vf_fnma(x, r, vf_set(2));
#else
    return vf_set(1) / x;
#endif
}

/* color_dot_grad[j] = color_j . g at the block's pixels, for all entries of its
 * list. */
static void backward_color_dot_grads(struct splat_work *w, int b,
                                     const float *table, int row)
{
    const uint32_t *list = w->list[b / PARTS];
    uint32_t n = w->count[b / PARTS];

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
            vf_store(w->color_dot_grad[j + k], acc[k]);
    }
}

/* Where a block's pixels are about the tile's centre: rows and their squares,
 * and of column x the powers 0, 1, 2 of its place, each four times. */
struct powers {
    float y[4], yy[4];
    float x[COLUMNS][16];
};

/* The powers of block b. */
VEC_INLINE void backward_powers(struct powers *at, int b)
{
    for (int k = 0; k < 4; k++) {
        float y = 4 * (float)(b / ACROSS) - 7.5f + (float)k;

        at->y[k] = y;
        at->yy[k] = y * y;
    }
    for (int k = 0; k < COLUMNS; k++) {
        float x = (float)(COLUMNS * (b % ACROSS) + k) - 7.5f;

        for (int j = 0; j < 16; j++)
            at->x[k][j] = j < 4 ? 1 : j < 8 ? x : j < 12 ? x * x : 0;
    }
}

/* Sums over the columns of numbers by column and Gaussian, times the
 * powers part .. of sixteen: lanes 4 power + Gaussian. */
VEC_INLINE vf backward_column_sum(const float *row, const struct powers *at,
                                  const int part)
{
    vf m = vf_repeat(row) * vf_load(at->x[0] + part);

#pragma GCC unroll 3
    for (int x = 1; x < COLUMNS; x++)
        m = vf_fma(vf_repeat(row + 4 * x), vf_load(at->x[x] + part), m);
    return m;
}

/* The same of the weights' rows, times dL/dcolor: lanes 4 channel +
 * Gaussian. */
VEC_INLINE vf backward_grad_color_sum(const float (*row)[VEC],
                                      const float (*grad_color)[16],
                                      const int part)
{
    vf sum[4];

    FOUR sum[k] = vf_repeat(row[k]) * vf_load(grad_color[k] + part);
#pragma GCC unroll 3
    for (int x = 1; x < COLUMNS; x++)
        FOUR sum[k] = vf_fma(vf_repeat(row[k] + 4 * x),
                             vf_load(grad_color[4 * x + k] + part), sum[k]);
    return sum[0] + sum[1] + (sum[2] + sum[3]);
}

/* Add the sums of four list entries to their rows of w->pair: dq, and with
 * `channels` to sum up here, 0, 3 or 4, the weights, at the block's pixels.  First
 * columns are summed, lanes 4 x + Gaussian, then the columns together, lanes
 * 4 power + Gaussian. */
VEC_INLINE void backward_flush(struct splat_work *w,
                               const float (*grad_color)[16],
                               const uint32_t *list, vf dq[4], vf weight[4],
                               const struct powers *at, const int channels)
{
    float row[3][VEC], shade[4][VEC];
    vf m[4];

    vf_transpose_quads(dq);
    m[0] = dq[0] + dq[1] + (dq[2] + dq[3]);
    m[1] = vf_set(at->y[0]) * dq[0];
    m[2] = vf_set(at->yy[0]) * dq[0];
#pragma GCC unroll 3
    for (int y = 1; y < 4; y++) {
        m[1] = vf_fma(vf_set(at->y[y]), dq[y], m[1]);
        m[2] = vf_fma(vf_set(at->yy[y]), dq[y], m[2]);
    }
#pragma GCC unroll 3
    for (int f = 0; f < 3; f++)
        vf_store(row[f], m[f]);
    FROM_MEMORY(row);
    if (channels) {
        vf_transpose_quads(weight);
        FOUR vf_store(shade[k], weight[k]);
        FROM_MEMORY(shade);
    }
    /* of sixteen numbers the last four have no meaning but the fourth channel */
    const int numbers = channels > 3 ? 16 : 12;
#pragma GCC unroll 4
    for (int part = 0; part < numbers; part += VEC) {
#pragma GCC unroll 3
        for (int f = 0; f < 3; f++)
            m[f] = backward_column_sum(row[f], at, part);
        m[3] = vf_set(0);
        if (channels)
            m[3] = backward_grad_color_sum((const float (*)[VEC])shade,
                                           grad_color, part);
        vf_transpose_quads(m);
        FOUR {
            float *to = w->pair[list[k]] + part;

            vf_store(to, vf_load(to) + m[k]);
        }
    }
}

/* dcolor (entry, row) += weight (entry, VEC pixels) g (VEC pixels, row). */
static void backward_colors(struct splat_work *w, int b, uint32_t n, int row)
{
    for (int part = 0; part < row; part += VEC) {
        const float *from[VEC];
        vf g[VEC];

        for (int c = 0; c < VEC; c++)
            from[c] = w->g[b][part + c];
        vf_columns(g, from, VEC_QUADS);
        for (uint32_t j = 0; j < n; j++) {
            float *to = w->dcolor[w->list[b / PARTS][j]] + part;
            vf sum = vf_load(to);

#pragma GCC unroll 16
            for (int p = 0; p < VEC; p++)
                sum = vf_fma(vf_set(w->row[j][p]), g[p], sum);
            vf_store(to, sum);
        }
    }
}

/* Where a block's colours are: up to three channels in the chunk; of more in
 * the table, by backward_color_dot_grads and backward_colors, and then there
 * may be places in the chunk. */
enum backward_kind { BACKWARD_CHUNK, BACKWARD_TABLE, BACKWARD_TABLE_PLACE };

/* One block's share of the chunk. */
VEC_INLINE void backward_traverse(struct splat_work *w, int b,
                                  const struct splat_state *st,
                                  const int degree,
                                  const enum backward_kind kind)
{
    const struct view *v = &st->view;
    const float (*grad_color)[16] = (const float (*)[16])w->grad_color[b];
    const uint32_t *list = w->list[b / PARTS];
    const bool wide = kind != BACKWARD_CHUNK;
    const bool place = kind == BACKWARD_TABLE_PLACE;
    uint32_t n = w->count[b / PARTS], j = 0;
    vf x = chunk_slice_x(b), cut = vf_set(v->cut), stop = vf_set(v->t_cut);
    vm alive = vm_from_bits(w->alive[b]);
    vf T = vf_keep(alive, vf_load(w->T[b])), g[SPLAT_PLACE_CHANNELS];
    vf remaining = vf_load(w->remaining[b]);
    struct powers at;

    backward_powers(&at, b);
    if (wide)
        backward_color_dot_grads(w, b, st->table, st->row);
    for (int c = 0; c < SPLAT_PLACE_CHANNELS; c++)
        g[c] = vf_load(place ? w->g_place[b][c] : w->g[b][c]);
    for (; j < n && vm_any(alive); j += 4) {
        vf e[4], alpha[4], behind[4], color_dot_grad[4], dq[4], weight[4];
        vm on[4];

        chunk_alphas(alpha, on, e, w, list + j, b, &x, cut, degree, 1);
        FOUR behind[k] = backward_inverse(vf_set(1) - alpha[k]);
        ABREAST(behind);
        FOUR {
            uint32_t entry = list[j + (uint32_t)k];
            const float *c = w->entry[entry] + (place ? PLACE : COLOR);
            vf dot = vf_fma(vf_set(c[0]), g[0],
                            vf_fma(vf_set(c[1]), g[1], vf_set(c[2]) * g[2]));

            color_dot_grad[k] =
                wide ? vf_load(w->color_dot_grad[j + (uint32_t)k]) : dot;
            if (place)
                color_dot_grad[k] += vf_fma(vf_set(c[3]), g[3], dot);
        }
        FOUR {
            vf all = vf_mul_keep(on[k], alpha[k], T), before = remaining;

            T -= all;
            vm drawn = vf_gt_and(on[k], T, stop);

            weight[k] = vf_keep(drawn, all);
            /* image = sum w c + T bg: behind this one is remaining - w c.g,
             * which 1 - alpha divides; dL/dq = alpha dL/dalpha */
            remaining = vf_fnma(weight[k], color_dot_grad[k], remaining);
            if (!v->dgr)               /* which forgets the clamp */
                drawn = vf_gt_and(drawn, vf_set(0.99f), e[k]);
            dq[k] = vf_fnma_keep(drawn, remaining, behind[k], before);
            if (wide)
                vf_store(w->row[j + (uint32_t)k], weight[k]);
        }
        backward_flush(w, grad_color, list + j, dq, weight, &at,
                       place ? 4 : wide ? 0 : 3);
        alive = vf_gt(T, stop);
    }
    if (wide)
        backward_colors(w, b, j < n ? j : n, st->row);
    vf_store(w->T[b], T);
    vf_store(w->remaining[b], remaining);
    w->alive[b] = vm_bits(alive);
}

/* Each kind is compiled apart, and each of the degrees that a renderer with
 * gradients has. */
static void backward_block(struct splat_work *w, int b,
                           const struct splat_state *st, int degree,
                           enum backward_kind kind)
{
    switch (kind) {
    case BACKWARD_CHUNK:
        if (degree == 3)
            backward_traverse(w, b, st, 3, BACKWARD_CHUNK);
        else
            backward_traverse(w, b, st, 5, BACKWARD_CHUNK);
        return;
    case BACKWARD_TABLE:
        if (degree == 3)
            backward_traverse(w, b, st, 3, BACKWARD_TABLE);
        else
            backward_traverse(w, b, st, 5, BACKWARD_TABLE);
        return;
    case BACKWARD_TABLE_PLACE:
        if (degree == 3)
            backward_traverse(w, b, st, 3, BACKWARD_TABLE_PLACE);
        else
            backward_traverse(w, b, st, 5, BACKWARD_TABLE_PLACE);
        return;
    }
}

/* Where the pairs of n entries of tile (tx, ty) go. */
static void backward_find_pairs(struct splat_work *w, const struct splat *s,
                                const uint32_t *list, uint32_t n, uint32_t tx,
                                uint32_t ty)
{
    const struct splat_gradient_state *b = s->state->gradient;

    for (uint32_t e = 0; e < n; e++) {
        struct pair_range p = b->range[list[e]];

        w->pair_of[e] = p.origin + ty * p.across + tx;
    }
}

/* Fetch the places of block b's share of n entries: all at once, they would be
 * waited for. */
VEC_INLINE void backward_fetch_pairs(const struct splat_work *w,
                                     const struct splat *s, uint32_t n,
                                     uint32_t b)
{
    const struct splat_gradient_state *g = s->state->gradient;

    for (uint32_t e = n * b / SLICES; e < n * (b + 1) / SLICES; e++)
        __builtin_prefetch(g->pair + (size_t)w->pair_of[e] * (size_t)g->stride,
                           1);
}

/* Store an entry's sums m about the tile's centre, about its own centre (u,
 * v): each step takes x - u or y - v for one x or y. */
VEC_INLINE void backward_put_centered(float *to, const float m[16], float u,
                                      float v)
{
    const vq along = {u, u, u, 0}, first = {0, v, v, 0}, second = {0, 0, v, 0};
    vq q[3] = {vq_load(m), vq_load(m + 4), vq_load(m + 8)};

    q[2] -= along * q[1];
    q[1] -= along * q[0];
    q[2] -= along * q[1];
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        q[k] -= first * __builtin_shufflevector(q[k], q[k], 0, 0, 1, 3);
        q[k] -= second * __builtin_shufflevector(q[k], q[k], 0, 0, 1, 3);
        vq_store(to + 4 * k, q[k]);
    }
    vq_store(to + 12, (vq){0, 0, 0, m[GRAD_COLOR(3)]});
}

/* The chunk's sums to their pairs' places. */
static void backward_store_pairs(const struct splat_work *w,
                                 const struct splat *s, const uint32_t *list,
                                 uint32_t n)
{
    const struct splat_gradient_state *b = s->state->gradient;
    size_t colors = (size_t)s->state->row * sizeof(float);

    for (uint32_t e = 0; e < n; e++) {
        float *to = b->pair + (size_t)w->pair_of[e] * (size_t)b->stride;

        backward_put_centered(to, w->pair[e], w->center[0][e], w->center[1][e]);
        if (colors)
            memcpy(to + 16, w->dcolor[e], colors);
        b->seen[w->pair_of[e]] = (uint8_t)(1 + list[e] % VEC);
    }
}

/* The next n entries of a tile's list: find their pairs, lay them out, add up
 * block by block, put the sums away. */
static void backward_chunk(struct splat_work *w, const struct splat *s,
                           const uint32_t *list, uint32_t n, int tx, int ty,
                           enum backward_kind kind)
{
    backward_find_pairs(w, s, list, n, (uint32_t)tx, (uint32_t)ty);
    chunk_build(w, s->state, list, n, (float)(TILE * tx) + 8,
                (float)(TILE * ty) + 8, false);
    memset(w->pair, 0, n * sizeof w->pair[0]);
    if (s->state->row)
        memset(w->dcolor, 0, n * sizeof w->dcolor[0]);
    for (int b = 0; b < SLICES; b++) {
        backward_fetch_pairs(w, s, n, (uint32_t)b);
        if (w->count[b / PARTS])
            backward_block(w, b, s->state, s->opt.exp_degree, kind);
    }
    backward_store_pairs(w, s, list, n);
}

void ISA(splat_tile_backward)(const struct splat *s, struct splat_work *w,
                              uint32_t t,
                              const struct splat_picture_gradients *d)
{
    const struct splat_state *st = s->state;
    int tx = (int)(t % (uint32_t)st->view.tx);
    int ty = (int)(t / (uint32_t)st->view.tx);
    enum backward_kind kind = !st->row   ? BACKWARD_CHUNK
                              : d->place ? BACKWARD_TABLE_PLACE
                                         : BACKWARD_TABLE;
    uint32_t any = 1;

    backward_load_pixels(w, s, d, TILE * tx, TILE * ty);
    for (uint32_t i = st->start[t]; i < st->end[t] && any; i += CHUNK) {
        uint32_t n = st->end[t] - i < CHUNK ? st->end[t] - i : CHUNK;

        backward_chunk(w, s, st->list + i, n, tx, ty, kind);
        any = 0;
        for (int b = 0; b < SLICES; b++)
            any |= w->alive[b];
    }
}
