/* A tile of the picture: Eq. C, sum_i c_i alpha_i prod_j<i (1 - alpha_j), its
 * Gaussians front to back, block by block, a pixel to each lane. */
#include <math.h>
#include <string.h>

#include "lib/base/isa.h"
#include "lib/splat/chunk.h"
#include "lib/splat/raster_finish.h"

void ISA(splat_tile)(const struct splat *s, struct splat_work *w, uint32_t t,
                     const struct target *out);
size_t ISA(splat_work_size)(void);

/* Light passing through a block's pixels.  T is 0 where a pixel has been
 * finished; kept is its last transmittance everywhere. */
struct light {
    vf T, kept, cut, stop;
};

/* What block b's pixels let through so far. */
VEC_INLINE void light_init(struct light *l, const struct splat_work *w, int b,
                           const struct view *v)
{
    l->kept = vf_load(w->T[b]);
    l->T = vf_keep(vm_from_bits(w->alive[b]), l->kept);
    l->cut = vf_set(v->cut);
    l->stop = vf_set(v->t_cut);
}

/* The same put back, and which pixels still take light. */
VEC_INLINE void light_store(struct splat_work *w, int b,
                            const struct light *l)
{
    w->alive[b] = vm_bits(vf_gt(l->T, vf_set(0)));
    vf_store(w->T[b], l->kept);
}

/* One Gaussian's weight at the block's pixels, and where it counts.  The rule,
 * T (1 - alpha) <= t_cut drops the Gaussian and all behind it, is applied to
 * products that run ahead: T only falls, so what comes after the first that is
 * too small is too small as well. */
VEC_INLINE vm light_pass(vf *weight, struct light *l, vm on, vf alpha)
{
    *weight = vf_mul_keep(on, alpha, l->T);
    l->T -= *weight;
    on = vf_gt(l->T, l->stop);
    l->kept = vf_sel(on, l->T, l->kept);
    return on;
}

/* Keep a weight as a row for the product, unless it is 0 everywhere.  Returns
 * the rows. */
VEC_INLINE uint32_t raster_keep_row(struct splat_work *w, uint32_t rows,
                                    uint32_t e, vf weight)
{
    vf_store(w->weight[rows], weight);
    w->used[rows] = w->index[e < CHUNK ? e : 0];
    return rows + (vm_bits(vf_gt(weight, vf_set(0))) != 0);
}

/* Pass light through a block's list, T in a register: blend 3 or 4 channels,
 * which stay in registers, or for more (channels 0) put the weights into
 * w->weight and return their rows.  Places are three further channels in
 * registers. */
VEC_INLINE uint32_t raster_traverse(struct splat_work *w, int b,
                                    const struct view *v, const int degree,
                                    const int channels, const bool place)
{
    const uint32_t *list = w->list[b];
    float *sums[4] = {w->color[0][b], w->color[1][b], w->color[2][b],
                      channels ? w->color[3][b] : w->depth[b]};
    const int first = channels ? 0 : 3, last = channels ? channels : 4;
    uint32_t n = w->count[b], rows = 0;
    struct light l;
    vf c[4], p[3], x = chunk_block_x(b);

    light_init(&l, w, b, v);
    for (int k = first; k < last; k++)
        c[k] = vf_load(sums[k]);
    for (int k = 0; place && k < 3; k++)
        p[k] = vf_load(w->blended[k][b]);
    for (uint32_t j = 0; j < n; j += 4) {
        vm on = VM_ALL, seen[4];
        vf alpha[4], free[4];

        chunk_alphas(alpha, seen, free, w, list + j, b, x, l.cut, degree);
#pragma GCC unroll 4
        for (uint32_t i = 0; i < 4; i++) {
            uint32_t e = list[j + i];
            vf weight;

            on = light_pass(&weight, &l, seen[i], alpha[i]);
#pragma GCC unroll 3
            for (int m = first; m < 3; m++)
                c[m] = vf_fma_keep(on, weight, vf_set(w->info[e][1 + m]),
                                   c[m]);
            if (last > 3)
                c[3] = vf_fma_keep(on, weight, vf_set(w->fourth[e]), c[3]);
#pragma GCC unroll 3
            for (int m = 0; place && m < 3; m++)
                p[m] = vf_fma_keep(on, weight, vf_set(w->place[e][m]), p[m]);
            if (!channels)
                rows = raster_keep_row(w, rows, e, vf_keep(on, weight));
        }
        l.T = vf_keep(on, l.T);
        if (!vm_any(on))
            break;
    }
    for (int k = first; k < last; k++)
        vf_store(sums[k], c[k]);
    for (int k = 0; place && k < 3; k++)
        vf_store(w->blended[k][b], p[k]);
    light_store(w, b, &l);
    return rows;
}

/* How many pixels, and vectors of channels, a product sums up at a time: what
 * the registers hold. */
#if VEC == 16
enum { PIXELS_ABREAST = 8, VECTORS_ABREAST = 1 };
#else
enum { PIXELS_ABREAST = 4, VECTORS_ABREAST = 2 };
#endif

/* wide (VEC pixels, row) += weight^T (rows, VEC pixels) table (rows, row):
 * lanes are channels. */
static void raster_product(struct splat_work *w, int b, uint32_t rows,
                           const float *table, int row)
{
    const int step = VEC * VECTORS_ABREAST;

    for (int first = 0; first < VEC; first += PIXELS_ABREAST)
        for (int part = 0; part < row; part += step) {
            float (*out)[SPLAT_MAX_CHANNELS] = &w->wide[VEC * b + first];
            vf acc[PIXELS_ABREAST][VECTORS_ABREAST];

            for (int p = 0; p < PIXELS_ABREAST; p++)
                for (int k = 0; k < VECTORS_ABREAST; k++)
                    acc[p][k] = vf_load(out[p] + part + VEC * k);
            for (uint32_t j = 0; j < rows; j++) {
                const float *g = w->weight[j] + first;
                const float *c = table + (size_t)w->used[j] * (size_t)row +
                                 part;
                vf color[VECTORS_ABREAST];

                for (int k = 0; k < VECTORS_ABREAST; k++)
                    color[k] = vf_load(c + VEC * k);
#pragma GCC unroll 8
                for (int p = 0; p < PIXELS_ABREAST; p++)
                    for (int k = 0; k < VECTORS_ABREAST; k++)
                        acc[p][k] = vf_fma(vf_set(g[p]), color[k], acc[p][k]);
            }
            for (int p = 0; p < PIXELS_ABREAST; p++)
                for (int k = 0; k < VECTORS_ABREAST; k++)
                    vf_store(out[p] + part + VEC * k, acc[p][k]);
        }
}

#if defined(__SSE2__) || defined(__ARM_NEON)
/* acc += pairs of 16-bit numbers in c times those of *g. */
VEC_INLINE vi raster_add_pairs(vi acc, vi c, const uint32_t *g)
{
#if VEC == 16
    /* by hand: the compiler would copy every sum before and after */
    __asm__("vpdpwssd %2%{1to16%}, %1, %0" : "+v"(acc) : "v"(c), "m"(*g));
    return acc;
#elif VEC == 8
    return acc + (vi)_mm256_madd_epi16((__m256i)c,
                                       _mm256_set1_epi32((int)*g));
#elif defined(__ARM_NEON)
    int16x4_t two = vreinterpret_s16_u32(vdup_n_u32(*g));
    int32x4_t sum = vmlal_lane_s16((int32x4_t)acc,
                                   vget_low_s16((int16x8_t)c), two, 0);

    return (vi)vmlal_high_lane_s16(sum, (int16x8_t)c, two, 1);
#else
    return acc + (vi)_mm_madd_epi16((__m128i)c, _mm_set1_epi32((int)*g));
#endif
}

enum { FIXED_ABREAST = VEC == 16 ? 8 : 4 };   /* pixels summed up at a time */

/* Rows of two Gaussians interleaved: lane n of c[0] is channel n of both, of
 * c[1] channel 16 + n (pack.c, pack_fixed).  NEON, which multiplies by a lane,
 * has the first Gaussian's channels in the lower half, the second's above. */
VEC_INLINE void raster_interleave_fixed(vi c[2], const int16_t *r0,
                                        const int16_t *r1)
{
    vi a = vi_load(r0), b = vi_load(r1);

#if VEC == 16
    c[0] = (vi)_mm512_unpacklo_epi16((__m512i)a, (__m512i)b);
    c[1] = (vi)_mm512_unpackhi_epi16((__m512i)a, (__m512i)b);
#elif defined(__ARM_NEON)
    c[0] = (vi)vzip1q_s64((int64x2_t)a, (int64x2_t)b);
    c[1] = (vi)vzip2q_s64((int64x2_t)a, (int64x2_t)b);
#else
    c[0] = (vi)X86(unpacklo_epi16)((X86_I)a, (X86_I)b);
    c[1] = (vi)X86(unpackhi_epi16)((X86_I)a, (X86_I)b);
#endif
}

/* Sums of the channels first .. and 16 + first .. of a few pixels, over pairs
 * of rows. */
VEC_INLINE void raster_sum_fixed(struct splat_work *w, int pixel, int first,
                                 uint32_t pairs, const uint32_t (*pair)[VEC],
                                 const int16_t *table, const float *scale)
{
    vi acc[2][FIXED_ABREAST] = {0};

    for (uint32_t j = 0; j < pairs; j++) {
        vi c[2];

        raster_interleave_fixed(c, table + 32 * w->used[2 * j],
                                table + 32 * w->used[2 * j + 1]);
#pragma GCC unroll 8
        for (int p = 0; p < FIXED_ABREAST; p++) {
            const uint32_t *g = &pair[j][p];

            acc[0][p] = raster_add_pairs(acc[0][p], c[0], g);
            acc[1][p] = raster_add_pairs(acc[1][p], c[1], g);
        }
    }
#pragma GCC unroll 8
    for (int p = 0; p < FIXED_ABREAST; p++)
#pragma GCC unroll 2
        for (int k = 0; k < 2; k++) {
            float *out = w->wide[pixel + p] + first + 16 * k;
            vf x = __builtin_convertvector(acc[k][p], vf);

            vf_store(out, vf_fma(x, vf_load(scale + first + 16 * k),
                                 vf_load(out)));
        }
}

/* The same in 16-bit integers, two Gaussians at a time: weights and colours
 * in Q15, sums in 32 bits.  table rows hold channels in the order that the
 * interleaving undoes. */
static void raster_product_fixed(struct splat_work *w, int b, uint32_t rows,
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
    for (int p = 0; p < VEC; p += FIXED_ABREAST)
        for (int c = 0; c < 16; c += VEC)
            raster_sum_fixed(w, VEC * b + p, c, pairs,
                             (const uint32_t (*)[VEC])&pair[0][p],
                             table + 2 * c, scale);
}
#endif

/* More than four channels: weights first, then their product with the table. */
VEC_INLINE void raster_wide_block(const struct splat_state *st,
                                  struct splat_work *w, int b, const int degree,
                                  const bool place)
{
    uint32_t rows = raster_traverse(w, b, &st->view, degree, 0, place);

    if (!rows)
        return;
#if defined(__SSE2__) || defined(__ARM_NEON)
    if (st->fixed) {
        raster_product_fixed(w, b, rows, st->fixed, st->fixed_scale);
        return;
    }
#endif
    raster_product(w, b, rows, st->table, st->row);
}

/* How a block's colours are summed: three channels or four (or depth) in
 * registers, more by products with the table. */
enum blend { BLEND_THREE, BLEND_FOUR, BLEND_TABLE };

/* One kind's traversal; degree and place are constants. */
VEC_INLINE void raster_blend(const struct splat_state *st,
                             struct splat_work *w, int b, enum blend kind,
                             const int degree, const bool place)
{
    const struct view *v = &st->view;

    switch (kind) {
    case BLEND_THREE: raster_traverse(w, b, v, degree, 3, place); return;
    case BLEND_FOUR: raster_traverse(w, b, v, degree, 4, place); return;
    case BLEND_TABLE: raster_wide_block(st, w, b, degree, place); return;
    }
}

/* One block's share of the chunk.  Each combination is compiled apart. */
static void raster_block(const struct splat *s, struct splat_work *w, int b,
                         bool place)
{
    const struct splat_state *st = s->state;
    enum blend kind = st->row ? BLEND_TABLE
                      : s->opt.channels > 3 || s->opt.depth ? BLEND_FOUR
                                                            : BLEND_THREE;

    switch (s->opt.exp_degree * 2 + place) {
    case 2 * 2: raster_blend(st, w, b, kind, 2, false); return;
    case 2 * 3: raster_blend(st, w, b, kind, 3, false); return;
    case 2 * 4: raster_blend(st, w, b, kind, 4, false); return;
    case 2 * 5: raster_blend(st, w, b, kind, 5, false); return;
    case 2 * 2 + 1: raster_blend(st, w, b, kind, 2, true); return;
    case 2 * 3 + 1: raster_blend(st, w, b, kind, 3, true); return;
    case 2 * 4 + 1: raster_blend(st, w, b, kind, 4, true); return;
    default: raster_blend(st, w, b, kind, 5, true); return;
    }
}

/* The next n entries of the tile's list, block by block. */
static void raster_chunk(const struct splat *s, struct splat_work *w,
                         const uint32_t *list, uint32_t n, float cx, float cy,
                         bool place)
{
    chunk_build(w, s->state, list, n, cx, cy, s->opt.depth);
    for (int b = 0; b < BLOCKS; b++)
        if (w->count[b])
            raster_block(s, w, b, place);
}

/* Pixels of block b that lie in the picture. */
static uint32_t raster_inside(const struct splat *s, int b, int x0, int y0)
{
    uint32_t bits = 0;

    for (int p = 0; p < VEC; p++)
        bits |= (uint32_t)(
                    x0 + COLUMNS * (b % ACROSS) + PIXEL_X(p) < s->opt.width &&
                    y0 + 4 * (b / ACROSS) + PIXEL_Y(p) < s->opt.height) << p;
    return bits;
}

/* Nothing drawn yet; pixels outside the picture are not alive. */
static void raster_begin(struct splat_work *w, const struct splat *s, int x0,
                         int y0)
{
    bool whole = x0 + TILE <= s->opt.width && y0 + TILE <= s->opt.height;

    for (int b = 0; b < BLOCKS; b++) {
        w->alive[b] = whole ? ALL_ALIVE : raster_inside(s, b, x0, y0);
        vf_store(w->T[b], vf_set(1));
        vf_store(w->depth[b], vf_set(0));
    }
    if (s->state->place)
        memset(w->blended, 0, sizeof w->blended);
    if (s->state->row)
        memset(w->wide, 0, sizeof w->wide);
    else
        memset(w->color, 0, sizeof w->color);
}

/* Fetch where the tile goes: written at its end, every line would be waited
 * for.  32 channels are more than the caches should hold. */
VEC_INLINE void raster_fetch_target(const struct splat *s,
                                    const struct target *out, int x0, int y0)
{
    size_t C = s->state->row ? 0 : (size_t)s->opt.channels;
    size_t n = (size_t)(s->opt.width - x0 < TILE ? s->opt.width - x0 : TILE);

    for (int y = y0; y < y0 + TILE && y < s->opt.height; y++) {
        size_t at = (size_t)y * (size_t)s->opt.width + (size_t)x0;

        if (C && out->image)
            chunk_fetch(out->image + at * C, n * C * sizeof *out->image);
        if (C && out->background_free)
            chunk_fetch(out->background_free + at * C,
                        n * C * sizeof *out->background_free);
        if (out->place)
            chunk_fetch(out->place + 3 * at, 3 * n * sizeof *out->place);
        if (out->alpha)
            chunk_fetch(out->alpha + at, n * sizeof *out->alpha);
        if (out->final_T)
            chunk_fetch(out->final_T + at, n * sizeof *out->final_T);
    }
}

/* Does any pixel of the tile still take light? */
static bool raster_any_alive(const struct splat_work *w)
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

    raster_begin(w, s, x0, y0);
    raster_fetch_target(s, out, x0, y0);
    for (uint32_t i = st->start[t]; i < st->end[t] && raster_any_alive(w);
         i += CHUNK) {
        uint32_t n = st->end[t] - i < CHUNK ? st->end[t] - i : CHUNK;

        raster_chunk(s, w, st->list + i, n, cx, cy, out->place != NULL);
    }
    raster_finish(w, s, out, x0, y0);
}

size_t ISA(splat_work_size)(void)
{
    return (sizeof(struct splat_work) + 63) / 64 * 64;
}
