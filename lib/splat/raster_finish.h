/* Inside the kernels: the sums of a finished tile's blocks as rows of the
 * picture, in the form that the target wants: planes to pixels, a background
 * behind them, half precision, past the caches.  Included by raster_tmpl.c
 * only. */
#ifndef SPID_SPLAT_RASTER_FINISH_H
#define SPID_SPLAT_RASTER_FINISH_H

#include <string.h>

#include "lib/base/half.h"
#include "lib/splat/chunk.h"

/* Four rows of sixteen pixels from a row of blocks. */
VEC_INLINE void raster_block_rows(float out[4][TILE], const float *blocks)
{
#if VEC == 16
    const __m512i rotated = _mm512_setr_epi32(0, 4, 8, 12, 1, 5, 9, 13,
                                             2, 6, 10, 14, 3, 7, 11, 15);
    vf r[4];

#pragma GCC unroll 4
    for (size_t x = 0; x < 4; x++)
        r[x] = (vf)_mm512_permutexvar_ps(
            rotated, (__m512)vf_load(blocks + VEC * x));
    vf_swap_quads(r);
#pragma GCC unroll 4
    for (size_t y = 0; y < 4; y++)
        vf_store(out[y], r[y]);
#else
    for (size_t x = 0; x < TILE; x += 4) {
        vq r[4];

#pragma GCC unroll 4
        for (size_t k = 0; k < 4; k++)
            r[k] = vq_load(blocks + 4 * (x + k));
        vq_transpose(r);
#pragma GCC unroll 4
        for (size_t y = 0; y < 4; y++)
            vq_store(out[y] + x, r[y]);
    }
#endif
}

/* n pixels of up to 4 channels from planes to (n, C). */
static void raster_put_colors(float *out, float (*row)[TILE], int n, int C)
{
    if (C == 3 && n == TILE) {
        for (int x = 0; x < TILE; x += VEC) {
            vf v[3] = {vf_load(row[0] + x), vf_load(row[1] + x),
                       vf_load(row[2] + x)};

            vf_put_rgb(out + 3 * x, v);
        }
        return;
    }
    for (int x = 0; x < n; x++)
        for (int c = 0; c < C; c++)
            out[x * C + c] = row[c][x];
}

/* n floats to half precision. */
static void raster_to_half(uint16_t *out, const float *in, size_t n)
{
    for (; n >= VEC; n -= VEC, in += VEC, out += VEC)
        vf_store_half(out, vf_load(in));
    for (size_t i = 0; i < n; i++)
        out[i] = float_to_half(in[i]);
}

/* Sums of the tile's pixel (x, y) of more than 4 channels. */
VEC_INLINE const float *raster_wide_pixel(const struct splat_work *w, int x,
                                          int y)
{
    return w->wide[4 * TILE * (y >> 2) + 4 * x + (y & 3)];
}

/* n pixels, C floats each, from their blocks' sums. */
VEC_INLINE void raster_put_wide(float *out, const struct splat_work *w, int y,
                                int n, const size_t C)
{
    for (int x = 0; x < n; x++)
        memcpy(out + (size_t)x * C, raster_wide_pixel(w, x, y),
               C * sizeof *out);
}

#ifdef __SSE2__
/* The same past the caches, all 32 channels: a large picture would only push
 * the Gaussians out of them.  out is aligned to 16 bytes. */
static void raster_stream_wide(float *out, const struct splat_work *w, int y,
                               int n)
{
    for (int x = 0; x < n; x++) {
        const float *in = raster_wide_pixel(w, x, y);

#pragma GCC unroll 8
        for (int k = 0; k < SPLAT_MAX_CHANNELS; k += 4)
            _mm_stream_ps(out + x * SPLAT_MAX_CHANNELS + k,
                          _mm_load_ps(in + k));
    }
}
#endif

/* And as halves: a pixel is one line of the cache, and out aligned to it.
 * T: NULL, or pixels of 1 are left as they were; what remains is about to be
 * sent, and short enough for the caches. */
static void raster_stream_half(uint16_t *out, const struct splat_work *w, int y,
                               int n, const float *T)
{
    for (int x = 0; x < n; x++, out += SPLAT_MAX_CHANNELS) {
        const float *in = raster_wide_pixel(w, x, y);

        if (T && T[x] == 1)
            continue;
#ifdef ISA_AVX512
        __m256i low = _mm512_cvtps_ph(_mm512_load_ps(in), 0);
        __m256i high = _mm512_cvtps_ph(_mm512_load_ps(in + 16), 0);
        __m512i both = _mm512_inserti64x4(_mm512_castsi256_si512(low), high,
                                          1);

        if (!T) {
            _mm512_stream_si512((void *)out, both);
            continue;
        }
        _mm512_store_si512((void *)out, both);
#elif defined(ISA_AVX2)
#pragma GCC unroll 4
        for (int k = 0; k < SPLAT_MAX_CHANNELS; k += VEC) {
            __m128i h = _mm256_cvtps_ph(_mm256_loadu_ps(in + k), 0);

            if (!T)
                _mm_stream_si128((void *)(out + k), h);
            else
                _mm_store_si128((void *)(out + k), h);
        }
#else
        for (int k = 0; k < SPLAT_MAX_CHANNELS; k += VEC)
            vf_store_half(out + k, vf_load(in + k));
#endif
    }
}

/* Four rows of a tile on their way out: T, depth, up to 4 colours,
 * place channels. */
struct strip {
    float T[4][TILE], z[4][TILE], color[4][4][TILE], place[4][4][TILE];
};

/* Can colours of more than 4 channels go straight to where they belong? */
VEC_INLINE bool raster_straight(const struct splat *s, const struct target *out)
{
    return s->opt.channels == SPLAT_MAX_CHANNELS && !out->background_free &&
           !out->background;
}

/* Colours of row y, more than 4 channels, into `to`.  true: and that is all
 * there is to do. */
static bool raster_finish_wide(struct splat_work *w, const struct strip *p,
                               const struct splat *s, const struct target *out,
                               float *to, size_t at, int y, int n)
{
    size_t C = (size_t)s->opt.channels;

    if (raster_straight(s, out)) {
        uint16_t *half = out->half ? out->half + at * C : NULL;

        if (half && !((uintptr_t)half & 63)) {
            raster_stream_half(half, w, y, n,
                               s->opt.covered ? p->T[y & 3] : NULL);
            return true;
        }
#ifdef __SSE2__
        if (!half && !((uintptr_t)to & 15)) {
            raster_stream_wide(to, w, y, n);
            return true;
        }
#endif
    }
    if (C == SPLAT_MAX_CHANNELS)
        raster_put_wide(to, w, y, n, SPLAT_MAX_CHANNELS);
    else
        raster_put_wide(to, w, y, n, C);
    return false;
}

/* Colours of row y: without background into background_free (or NULL), with it
 * into the picture. */
static void raster_finish_colors(struct splat_work *w, struct strip *p,
                                 const struct splat *s,
                                 const struct target *out, size_t at, int y,
                                 int n)
{
    float line[16 * SPLAT_MAX_CHANNELS], row[4][TILE];
    size_t C = (size_t)s->opt.channels, values = (size_t)n * C;
    bool wide = s->state->row > 0;
    float *to = out->half ? line : out->image + at * C;

    if (wide && raster_finish_wide(w, p, s, out, to, at, y, n))
        return;
    for (size_t c = 0; !wide && c < C; c++)
        memcpy(row[c], p->color[c][y & 3], sizeof row[c]);
    if (out->background_free && !wide)
        raster_put_colors(to, row, n, (int)C);
    if (out->background_free)
        memcpy(out->background_free + at * C, to, values * sizeof *to);
    if (wide && out->background)
        for (int x = 0; x < n; x++)
            for (size_t c = 0; c < C; c++)
                to[(size_t)x * C + c] += p->T[y & 3][x] * out->background[c];
    if (!wide && (out->background || !out->background_free)) {
        for (size_t c = 0; out->background && c < C; c++)
            for (size_t x = 0; x < TILE; x += VEC)
                vf_store(row[c] + x, vf_fma(vf_load(p->T[y & 3] + x),
                                            vf_set(out->background[c]),
                                            vf_load(row[c] + x)));
        raster_put_colors(to, row, n, (int)C);
    }
    if (out->half)
        raster_to_half(out->half + at * C, line, values);
}

/* Places of row y of a strip, pixels from `at` on, and what is made of them. */
static void raster_finish_places(const struct strip *p, const struct splat *s,
                                 const struct target *out, size_t at, int y,
                                 int n)
{
    const int width = s->opt.width;
    const size_t first = SPLAT_PLACE_CHANNELS * at;
    float place[SPLAT_PLACE_CHANNELS * TILE];
    const size_t bytes = SPLAT_PLACE_CHANNELS * (size_t)n * sizeof *place;

    for (int x = 0; x < TILE; x += VEC) {
        vf v[SPLAT_PLACE_CHANNELS];

        for (int c = 0; c < SPLAT_PLACE_CHANNELS; c++)
            v[c] = vf_load(p->place[c][y] + x);
        vf_put_rows(place + SPLAT_PLACE_CHANNELS * x, v, SPLAT_PLACE_CHANNELS);
    }
    if (out->place)
        memcpy(out->place + first, place, bytes);
    if (out->kept_place)
        memcpy(out->kept_place + first, place, bytes);
    if (out->shade)
        out->shade(out->ctx, out->image ? out->image +
                                          at * (size_t)s->opt.channels : NULL,
                   out->alpha + at, place, (int)(at % (size_t)width),
                   (int)(at / (size_t)width), n);
}

/* T, alpha and depth of row y of a strip. */
static void raster_finish_row(const struct strip *p, const struct target *out,
                              size_t at, int y, int n)
{
    const float *T = p->T[y], *z = p->z[y];
    float opaque[TILE], depth[TILE];
    size_t bytes = (size_t)n * sizeof *T;

    if (out->final_T)
        memcpy(out->final_T + at, T, bytes);
    for (int x = 0; x < TILE; x += VEC)
        vf_store(opaque + x, vf_set(1) - vf_load(T + x));
    if (out->alpha && n == TILE)
        memcpy(out->alpha + at, opaque, sizeof opaque);
    else if (out->alpha)
        memcpy(out->alpha + at, opaque, bytes);
    if (!out->depth)
        return;
    for (int x = 0; x < n; x++)
        depth[x] = T[x] < 1 ? z[x] / opaque[x] : 0;
    memcpy(out->depth + at, depth, bytes);
}

/* The tile's sums to the pictures, four rows at a time. */
static void raster_finish(struct splat_work *w, const struct splat *s,
                          const struct target *out, int x0, int y0)
{
    int n = s->opt.width - x0 < TILE ? s->opt.width - x0 : TILE;
    const bool place = out->place || out->shade;
    struct strip p;

    for (int by = 0; by < 4; by++) {
        raster_block_rows(p.T, w->T[ACROSS * by]);
        for (int c = 0; !s->state->row && c < 4; c++)
            raster_block_rows(p.color[c], w->sum[COLOR + c][ACROSS * by]);
        for (int c = 0; place && c < SPLAT_PLACE_CHANNELS; c++)
            raster_block_rows(p.place[c], w->sum[PLACE + c][ACROSS * by]);
        if (out->depth)
            raster_block_rows(p.z, w->sum[DEPTH][ACROSS * by]);
        for (int y = 4 * by; y < 4 * by + 4 && y0 + y < s->opt.height; y++) {
            size_t at = (size_t)(y0 + y) * (size_t)s->opt.width + (size_t)x0;

            raster_finish_colors(w, &p, s, out, at, y, n);
            raster_finish_row(&p, out, at, y & 3, n);
            if (place)
                raster_finish_places(&p, s, out, at, y & 3, n);
        }
    }
}

#endif
