/* A tile of the picture: its Gaussians front to back, block by block. */
#include <math.h>
#include <string.h>

#include "formats/safetensors.h"
#include "lib/base/isa.h"
#include "lib/splat/chunk.h"

void ISA(splat_tile)(const struct splat *s, struct splat_work *w, uint32_t t,
                     const struct target *out);
size_t ISA(splat_work_size)(void);

/* Blend a block's list: T and up to 4 channels stay in registers. */
VEC_INLINE void blend(struct splat_work *w, int b, const struct view *v,
                      const int degree, const int channels)
{
    const uint32_t *list = w->list[b];
    uint32_t n = w->count[b];
    struct pixels p;
    vf T = vf_load(w->T[b]), c[4], cut = vf_set(v->cut);
    vf stop = vf_set(v->t_cut);
    vm alive = vm_from_bits(w->alive[b]);

    pixels_init(&p, b);
    for (int k = 0; k < channels; k++)
        c[k] = vf_load(w->color[b][k]);
    for (uint32_t j = 0; j < n; j++) {
        const float *k = w->chunk[0] + list[j];
        vf alpha = alpha_of(exponent(k, &p, degree < 5), cut, degree);
        vf next = vf_fnma(alpha, T, T);

        alive = vf_gt_and(alive, next, stop);
        vf weight = vf_mul_keep(alive, alpha, T);

        T = vf_sel(alive, next, T);
#pragma GCC unroll 4
        for (int m = 0; m < channels; m++)
            c[m] = vf_fma(weight, vf_set(k[(RED + m) * COLUMN]), c[m]);
        if ((j & 3) == 3 && !vm_bits(alive))
            break;
    }
    for (int k = 0; k < channels; k++)
        vf_store(w->color[b][k], c[k]);
    vf_store(w->T[b], T);
    w->alive[b] = vm_bits(alive);
}

/* Weights of a block's list into w->weight; rows that are all 0 are dropped.
 * Returns the rows. */
VEC_INLINE uint32_t weights(struct splat_work *w, int b, const struct view *v,
                            const int degree)
{
    const uint32_t *list = w->list[b];
    uint32_t n = w->count[b], rows = 0;
    struct pixels p;
    vf T = vf_load(w->T[b]), cut = vf_set(v->cut), stop = vf_set(v->t_cut);
    vf depth = vf_load(w->depth[b]);
    vm alive = vm_from_bits(w->alive[b]);

    pixels_init(&p, b);
    for (uint32_t j = 0; j < n; j++) {
        const float *k = w->chunk[0] + list[j];
        vf alpha = alpha_of(exponent(k, &p, degree < 5), cut, degree);
        vf next = vf_fnma(alpha, T, T);

        alive = vf_gt_and(alive, next, stop);
        vf weight = vf_mul_keep(alive, alpha, T);

        T = vf_sel(alive, next, T);
        depth = vf_fma(weight, vf_set(k[FOURTH * COLUMN]), depth);
        vf_store(w->weight[rows], weight);
        w->used[rows] = w->index[list[j]];
        rows += vm_bits(vf_gt(weight, vf_set(0))) != 0;
        if ((j & 3) == 3 && !vm_bits(alive))
            break;
    }
    vf_store(w->depth[b], depth);
    vf_store(w->T[b], T);
    w->alive[b] = vm_bits(alive);
    return rows;
}

/* wide (16 pixels, row) += weight^T (rows, 16 pixels) table (rows, row):
 * lanes are channels. */
VEC_INLINE void product(struct splat_work *w, int b, uint32_t rows,
                        const float *table, const int row)
{
    for (int half = 0; half < 2; half++)
        for (int part = 0; part < row; part += VEC) {
            float (*out)[SPLAT_MAX_CHANNELS] = &w->wide[16 * b + 8 * half];
            vf acc[8];

            for (int p = 0; p < 8; p++)
                acc[p] = vf_load(out[p] + part);
            for (uint32_t j = 0; j < rows; j++) {
                const float *g = w->weight[j] + 8 * half;
                vf c = vf_load(table + (size_t)w->used[j] * (size_t)row + part);

#pragma GCC unroll 8
                for (int p = 0; p < 8; p++)
                    acc[p] = vf_fma(vf_set(g[p]), c, acc[p]);
            }
            for (int p = 0; p < 8; p++)
                vf_store(out[p] + part, acc[p]);
        }
}

#ifdef ISA_AVX512
/* The same in 16-bit integers, two Gaussians at a time: weights and colours
 * in Q15, sums in 32 bits.  table rows hold channels in the order that the
 * interleaving undoes (splat.c, pack_fixed). */
VEC_INLINE void product_fixed(struct splat_work *w, int b, uint32_t rows,
                              const int16_t *table, const float *scale)
{
    uint32_t pair[COLUMN / 2 + 1][VEC], pairs = (rows + 1) / 2;

    if (rows & 1) {
        vf_store(w->weight[rows], vf_set(0));
        w->used[rows] = w->used[rows - 1];
    }
    for (uint32_t j = 0; j < pairs; j++) {
        vi lo = vf_round(vf_load(w->weight[2 * j]) * vf_set(32767));
        vi hi = vf_round(vf_load(w->weight[2 * j + 1]) * vf_set(32767));

        vi_store(pair[j], lo | (hi << 16));
    }
    for (int half = 0; half < 2; half++) {
        __m512i acc[2][8];

        for (int p = 0; p < 8; p++)
            acc[0][p] = acc[1][p] = _mm512_setzero_si512();
        for (uint32_t j = 0; j < pairs; j++) {
            __m512i r0 = _mm512_loadu_si512(table + 32 * w->used[2 * j]);
            __m512i r1 = _mm512_loadu_si512(table + 32 * w->used[2 * j + 1]);
            __m512i c0 = _mm512_unpacklo_epi16(r0, r1);
            __m512i c1 = _mm512_unpackhi_epi16(r0, r1);

#pragma GCC unroll 8
            for (int p = 0; p < 8; p++) {
                __m512i g = _mm512_set1_epi32((int)pair[j][8 * half + p]);

                acc[0][p] = _mm512_dpwssd_epi32(acc[0][p], c0, g);
                acc[1][p] = _mm512_dpwssd_epi32(acc[1][p], c1, g);
            }
        }
        for (int p = 0; p < 8; p++)
            for (int k = 0; k < 2; k++) {
                float *out = w->wide[16 * b + 8 * half + p] + 16 * k;
                vf x = (vf)_mm512_cvtepi32_ps(acc[k][p]);

                vf_store(out, vf_fma(x, vf_load(scale + 16 * k),
                                     vf_load(out)));
            }
    }
}
#endif

VEC_INLINE void narrow_chunk(const struct splat *s, struct splat_work *w,
                             const uint32_t *list, uint32_t n, float cx,
                             float cy, const int degree, const int channels)
{
    chunk_build(w, s->state, list, n, cx, cy, degree < 5, s->opt.depth);
    for (int b = 0; b < BLOCKS; b++)
        if (w->count[b])
            blend(w, b, &s->state->view, degree, channels);
}

VEC_INLINE void wide_chunk(const struct splat *s, struct splat_work *w,
                           const uint32_t *list, uint32_t n, float cx,
                           float cy, const int degree)
{
    const struct splat_state *st = s->state;

    chunk_build(w, st, list, n, cx, cy, degree < 5, 1);
    memcpy(w->index, list, n * sizeof *list);
    for (int b = 0; b < BLOCKS; b++) {
        uint32_t rows;

        if (!w->count[b] ||
            !(rows = weights(w, b, &st->view, degree)))
            continue;
#ifdef ISA_AVX512
        if (st->fixed) {
            product_fixed(w, b, rows, st->fixed, st->fixed_scale);
            continue;
        }
#endif
        if (st->row == 16)
            product(w, b, rows, st->table, 16);
        else
            product(w, b, rows, st->table, 32);
    }
}

static void chunk(const struct splat *s, struct splat_work *w,
                  const uint32_t *list, uint32_t n, float cx, float cy)
{
    int four = s->opt.channels > 3 || s->opt.depth;

    if (s->state->row) {
        switch (s->opt.exp_degree) {
        case 2: wide_chunk(s, w, list, n, cx, cy, 2); return;
        case 3: wide_chunk(s, w, list, n, cx, cy, 3); return;
        case 4: wide_chunk(s, w, list, n, cx, cy, 4); return;
        default: wide_chunk(s, w, list, n, cx, cy, 5); return;
        }
    }
    switch (s->opt.exp_degree * 2 + four) {
    case 4: narrow_chunk(s, w, list, n, cx, cy, 2, 3); return;
    case 5: narrow_chunk(s, w, list, n, cx, cy, 2, 4); return;
    case 6: narrow_chunk(s, w, list, n, cx, cy, 3, 3); return;
    case 7: narrow_chunk(s, w, list, n, cx, cy, 3, 4); return;
    case 8: narrow_chunk(s, w, list, n, cx, cy, 4, 3); return;
    case 9: narrow_chunk(s, w, list, n, cx, cy, 4, 4); return;
    case 10: narrow_chunk(s, w, list, n, cx, cy, 5, 3); return;
    default: narrow_chunk(s, w, list, n, cx, cy, 5, 4); return;
    }
}

/* Nothing drawn yet; pixels outside the picture are not alive. */
static void begin(struct splat_work *w, const struct splat *s, int x0, int y0)
{
    for (int b = 0; b < BLOCKS; b++) {
        uint32_t bits = 0;

        for (int p = 0; p < VEC; p++)
            bits |= (uint32_t)(x0 + 4 * (b & 3) + (p & 3) < s->opt.width &&
                               y0 + 4 * (b >> 2) + (p >> 2) < s->opt.height)
                    << p;
        w->alive[b] = bits;
        for (int p = 0; p < VEC; p++)
            w->T[b][p] = 1;
    }
    memset(w->color, 0, sizeof w->color);
    memset(w->depth, 0, sizeof w->depth);
    if (s->state->row)
        memset(w->wide, 0, sizeof w->wide);
}

/* Channel c of pixel p of block b. */
VEC_INLINE float value(const struct splat_work *w, bool wide, int b, int p,
                       int c)
{
    return wide ? w->wide[16 * b + p][c] : w->color[b][c][p];
}

static void put_pixel(const struct splat_work *w, const struct splat *s,
                      const struct target *out, size_t at, int b, int p)
{
    int C = s->opt.channels;
    bool wide = s->state->row != 0;
    float T = w->T[b][p];
    size_t to = at * (size_t)C;

    for (int c = 0; c < C; c++) {
        float x = value(w, wide, b, p, c);

        if (out->bare)
            out->bare[to + (size_t)c] = x;
        if (out->background)
            x += T * out->background[c];
        if (out->half)
            out->half[to + (size_t)c] = float_to_half(x);
        else
            out->image[to + (size_t)c] = x;
    }
    if (out->alpha)
        out->alpha[at] = 1 - T;
    if (out->final_T)
        out->final_T[at] = T;
    if (out->depth) {
        float z = wide ? w->depth[b][p] : w->color[b][3][p];

        out->depth[at] = T < 1 ? z / (1 - T) : 0;
    }
}

static void finish(const struct splat_work *w, const struct splat *s,
                   const struct target *out, int x0, int y0)
{
    for (int y = 0; y < TILE && y0 + y < s->opt.height; y++)
        for (int x = 0; x < TILE && x0 + x < s->opt.width; x++) {
            size_t at = (size_t)(y0 + y) * (size_t)s->opt.width +
                        (size_t)(x0 + x);

            put_pixel(w, s, out, at, 4 * (y >> 2) + (x >> 2),
                      4 * (y & 3) + (x & 3));
        }
}

static bool any_alive(const struct splat_work *w)
{
    uint32_t any = 0;

    for (int b = 0; b < BLOCKS; b++)
        any |= w->alive[b];
    return any != 0;
}

void ISA(splat_tile)(const struct splat *s, struct splat_work *w, uint32_t t,
                     const struct target *out)
{
    const struct splat_state *st = s->state;
    int x0 = TILE * (int)(t % (uint32_t)st->view.tx);
    int y0 = TILE * (int)(t / (uint32_t)st->view.tx);
    float cx = (float)x0 + 8, cy = (float)y0 + 8;

    begin(w, s, x0, y0);
    for (uint32_t i = st->start[t]; i < st->end[t] && any_alive(w);
         i += CHUNK) {
        uint32_t n = st->end[t] - i < CHUNK ? st->end[t] - i : CHUNK;

        chunk(s, w, st->list + i, n, cx, cy);
    }
    finish(w, s, out, x0, y0);
}

size_t ISA(splat_work_size)(void)
{
    return (sizeof(struct splat_work) + 63) / 64 * 64;
}
