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

/* Light passing through a slice's pixels.  T is 0 where a pixel has been
 * finished; kept is its last transmittance everywhere. */
struct light {
    vf T, kept;
};

/* What slice b's pixels let through so far. */
VEC_INLINE void light_init(struct light *l, const struct splat_work *w, int b)
{
    l->kept = vf_load(w->T[b]);
    l->T = vf_keep(vm_from_bits(w->alive[b]), l->kept);
}

/* The same put back, and which pixels still take light. */
VEC_INLINE void light_store(struct splat_work *w, int b,
                            const struct light *l)
{
    w->alive[b] = vm_bits(vf_gt(l->T, vf_set(0)));
    vf_store(w->T[b], l->kept);
}

/* One Gaussian's weight at the slice's pixels, and where it counts.  The rule,
 * T (1 - alpha) <= t_cut drops the Gaussian and all behind it, is applied to
 * products that run ahead: T only falls, so what comes after the first that is
 * too small is too small as well. */
VEC_INLINE vm light_pass(vf *weight, struct light *l, vm on, vf alpha,
                         vf t_cut)
{
    const vf all = vf_mul_keep(on, alpha, l->T);

    l->T -= all;
    on = vf_gt(l->T, t_cut);
    l->kept = vf_sel(on, l->T, l->kept);
    *weight = vf_keep(on, all);
    return on;
}

/* Pass light through a block's list: w->weight of each entry, until nothing
 * of the block takes light any more; returns how many. */
VEC_INLINE uint32_t raster_traverse(struct splat_work *w, int block,
                                    const struct view *v, const int degree)
{
    enum { ENTRIES = 4 / PARTS };
    const uint32_t *list = w->list[block], n = w->count[block];
    const vf cut = vf_set(v->cut), t_cut = vf_set(v->t_cut);
    const int first = PARTS * block;
    struct light light[PARTS];
    uint32_t j = 0;
    vf x[PARTS];
    bool some = true;

    for (int k = 0; k < PARTS; k++) {
        light_init(&light[k], w, first + k);
        x[k] = chunk_slice_x(first + k);
    }
    for (; j < n && some; j += ENTRIES) {
        vf alpha[4], free[4];
        vm seen[4], on[PARTS];

        chunk_alphas(alpha, seen, free, w, list + j, first, x, cut, degree,
                     PARTS);
        FOUR {
            vf weight;

            on[k % PARTS] = light_pass(&weight, &light[k % PARTS], seen[k],
                                       alpha[k], t_cut);
            vf_store(w->weight[j + k / PARTS][k % PARTS], weight);
        }
        some = false;
        for (int k = 0; k < PARTS; k++) {
            light[k].T = vf_keep(on[k], light[k].T);
            some |= vm_any(on[k]);
        }
    }
    for (int k = 0; k < PARTS; k++)
        light_store(w, first + k, &light[k]);
    return j;
}

/* w->sum of a block's slices += the first rows' weights times their entries'
 * columns: those of the bits that are set. */
VEC_INLINE void raster_sum(struct splat_work *w, int block, uint32_t rows,
                           const unsigned columns)
{
    vf sum[SUMS][PARTS];

#define EACH_SUM \
    _Pragma("GCC unroll 8") for (int c = 0; c < SUMS; c++) \
        if (columns >> c & 1) \
            _Pragma("GCC unroll 4") for (int k = 0; k < PARTS; k++)
    EACH_SUM sum[c][k] = vf_load(w->sum[c][PARTS * block + k]);
    for (uint32_t j = 0; j < rows; j++) {
        const float *entry = w->entry[w->list[block][j]];

        EACH_SUM sum[c][k] = vf_fma(vf_load(w->weight[j][k]),
                                    vf_set(entry[c]), sum[c][k]);
    }
    EACH_SUM vf_store(w->sum[c][PARTS * block + k], sum[c][k]);
}

/* w->row: slice b's weights of the first entries, times scale, without those
 * that are nowhere more than min; returns how many. */
VEC_INLINE uint32_t raster_rows(struct splat_work *w, int b, uint32_t entries,
                                float scale, float min)
{
    uint32_t n = 0;

    for (uint32_t j = 0; j < entries; j++) {
        const vf weight = vf_load(w->weight[j][b % PARTS]) * vf_set(scale);

        vf_store(w->row[n], weight);
        w->used[n] = w->index[w->list[b / PARTS][j]];
        n += vm_any(vf_gt(weight, vf_set(min))) != 0;
    }
    return n;
}

/* How many pixels, and vectors of channels, a product sums up at a time: what
 * the registers hold. */
#if VEC == 16
enum { PIXELS_ABREAST = 8, VECTORS_ABREAST = 1 };
#else
enum { PIXELS_ABREAST = 4, VECTORS_ABREAST = 2 };
#endif

/* wide (VEC pixels, row) += row^T (rows, VEC pixels) table (rows, row): lanes
 * are channels. */
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
                const float *g = w->row[j] + first;
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

/* The same in 16-bit integers, two Gaussians at a time: rows and colours in
 * Q15, sums in 32 bits.  table rows hold channels in the order that the
 * interleaving undoes. */
static void raster_product_fixed(struct splat_work *w, int b, uint32_t rows,
                                 const int16_t *table, const float *scale)
{
    uint32_t pair[COLUMN / 2 + 1][VEC], pairs = (rows + 1) / 2;

    if (rows & 1) {
        vf_store(w->row[rows], vf_set(0));
        w->used[rows] = w->used[rows - 1];
    }
    for (uint32_t j = 0; j < pairs; j++) {
        vi lo = vf_round(vf_load(w->row[2 * j]));
        vi hi = vf_round(vf_load(w->row[2 * j + 1]));

        vi_store(pair[j], lo | (hi << 16));
    }
    for (int p = 0; p < VEC; p += FIXED_ABREAST)
        for (int c = 0; c < 16; c += VEC)
            raster_sum_fixed(w, VEC * b + p, c, pairs,
                             (const uint32_t (*)[VEC])&pair[0][p],
                             table + 2 * c, scale);
}
#endif

/* More than four channels of slice b: the product of weights and table. */
static void raster_wide_slice(const struct splat_state *st,
                              struct splat_work *w, int b, uint32_t entries)
{
#if defined(__SSE2__) || defined(__ARM_NEON)
    if (st->fixed) {
        /* weights in Q15; under a half they are 0 */
        raster_product_fixed(w, b, raster_rows(w, b, entries, 32767, 0.5f),
                             st->fixed, st->fixed_scale);
        return;
    }
#endif
    raster_product(w, b, raster_rows(w, b, entries, 1, 0), st->table,
                   st->row);
}

/* One block's share of the chunk.  Each degree and each choice of columns is
 * compiled apart. */
static void raster_block(const struct splat *s, struct splat_work *w,
                         int block, bool place)
{
    const struct view *v = &s->state->view;
    const bool wide = s->state->row > 0;
    uint32_t n;

    switch (s->opt.exp_degree) {
    case 2: n = raster_traverse(w, block, v, 2); break;
    case 3: n = raster_traverse(w, block, v, 3); break;
    case 4: n = raster_traverse(w, block, v, 4); break;
    default: n = raster_traverse(w, block, v, 5); break;
    }
    if (!wide)                  /* all at once would not fit the registers */
        raster_sum(w, block, n, 0x07);
    if (place)
        raster_sum(w, block, n, 0xf0);
    if (s->opt.depth || s->opt.channels == 4)
        raster_sum(w, block, n, 0x08);
    for (int k = 0; wide && k < PARTS; k++)
        raster_wide_slice(s->state, w, PARTS * block + k, n);
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

/* Pixels of slice b that lie in the picture. */
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

    for (int b = 0; b < SLICES; b++) {
        w->alive[b] = whole ? ALL_ALIVE : raster_inside(s, b, x0, y0);
        vf_store(w->T[b], vf_set(1));
    }
    memset(w->sum, 0, sizeof w->sum);
    if (s->state->row)
        memset(w->wide, 0, sizeof w->wide);
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
            chunk_fetch(out->place + SPLAT_PLACE_CHANNELS * at,
                        SPLAT_PLACE_CHANNELS * n * sizeof *out->place);
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

    for (int b = 0; b < SLICES; b++)
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

        raster_chunk(s, w, st->list + i, n, cx, cy,
                     out->place || out->shade);
    }
    raster_finish(w, s, out, x0, y0);
}

size_t ISA(splat_work_size)(void)
{
    return (sizeof(struct splat_work) + 63) / 64 * 64;
}
