/* Lookups in the photograph: places of VEC pixels at once, and
 * Keys's bicubic (1981, "Cubic convolution interpolation for digital image
 * processing") in a picture of four bytes a pixel, where lanes are four
 * neighbours' four channels. */
#include "lib/photo/lookup_kernel.h"

#include "lib/base/simd_shuffle.h"
#include "lib/photo/lookup.h"

/* ---- places -------------------------------------------------------------- */

static bool ISA(lookup_places)(struct lookup_run *r,
                               const struct splat_place_view *v,
                               const struct splat_place_side *side,
                               const float *place, const float *alpha,
                               size_t n)
{
    const float *A = v->A, *b = v->b, *S = v->shoulders, *neck = v->neck;
    const vf zero = vf_set(0), one = vf_set(1), cover = vf_set(texture_cover(v));
    const vf e[2] = {vf_set(side->e[0]), vf_set(side->e[1])};
    const vf turn = vf_set(texture_turn(v));
    vf max = zero, grain_max = zero;

    for (size_t i = 0; i < n; i += VEC, place += SPLAT_PLACE_CHANNELS * VEC) {
        const float *row[VEC];
        vf p[SPLAT_PLACE_CHANNELS];

        for (int k = 0; k < VEC; k++)
            row[k] = place + SPLAT_PLACE_CHANNELS * k;
        vf_columns(p, row, 1);
        vf weight = p[2];
        vm has = vf_gt(weight, vf_set(TEXTURE_GRAIN_MIN));

        if (!vm_any(has)) {
            vf_store(r->confidence + i, zero);
            vf_store(r->grain + i, zero);
            vf_store(r->u + i, zero);
            vf_store(r->v + i, zero);
            continue;
        }
        vf over = one / vf_sel(has, weight, one);
        vf opaque = vf_load(alpha + i);
        vf part = weight / vf_max(opaque, vf_set(TEXTURE_MIN));
        vf own = TEXTURE_SHARE(part);
        vf grain = vf_min(TEXTURE_GRAIN(part), TEXTURE_GRAIN_NO_MORE(part));
        vf covered = vf_min(cover * opaque, one);
        vf confidence = vf_keep(vf_gt(weight, vf_set(TEXTURE_MIN)),
                                vf_clamp(own, zero, one) * covered);
        vf nx = __builtin_convertvector(vi_iota() + (int)i, vf) * r->step +
                r->nx;
        vf x = A[0] * nx + (A[1] * r->ny + b[0]);
        vf y = A[2] * nx + (A[3] * r->ny + b[1]);

        grain = vf_keep(has, vf_clamp(grain, zero, one));
        vf_store(r->confidence + i, confidence);
        vf_store(r->grain + i, grain);
        max = vf_max(max, confidence);
        grain_max = vf_max(grain_max, grain);
        vf below = neck[0] * nx + (neck[1] * r->ny + neck[2]);
        vf share = vf_clamp(below, zero, one);
        vf head = one - vf_clamp(below - one, zero, one);

        vf_store(r->solid + i, head * turn *
                                 vf_clamp(TEXTURE_SOLID(opaque), zero, one));
        x += share * (S[0] * nx + (S[1] * r->ny + S[4]));
        y += share * (S[2] * nx + (S[3] * r->ny + S[5]));
        /* splat_place_blended */
        vf along = p[3] * (e[0] * x + e[1] * y);
        x += (p[0] - along * e[0]) * over;
        y += (p[1] - along * e[1]) * over;
        vf_store(r->u + i, r->half * (x + 1));
        vf_store(r->v + i, r->half * (y + 1));
    }
    r->grained = vm_any(vf_gt(grain_max, zero));
    return r->grained || vm_any(vf_gt(max, zero));
}

/* ---- bicubic ------------------------------------------------------------- */

/* The four neighbours' weights at t in [0,1) past the second are polynomials,
 * from the highest power.  Keys's a is -3/4: it restores photographs best that
 * were moved by known fractions of a pixel. */
static const float weights[4][4] = {{-0.75f, 1.5f, -0.75f, 0},
                                    {1.25f, -2.25f, 0, 1},
                                    {-1.25f, 1.5f, 0.75f, 0},
                                    {0.75f, -0.75f, 0, 0}};

/* VEC positions' neighbours: of each the first in x and y, its number in the
 * texture (-1: some are missing), and the weights across and down. */
struct lookup_taps {
    int32_t x[VEC], y[VEC], at[VEC];
    float across[VEC][4], down[VEC][4];
};

/* Neighbours of VEC coordinates p along an axis of `end` pixels; what is far
 * outside is the border's anyway, and NaN becomes the corner.  Returns the
 * first ones. */
VEC_INLINE vi lookup_axis(float weight[VEC][4], const float *p, float end)
{
    vf x = vf_min(vf_max(vf_load(p), vf_set(-2)), vf_set(end + 2)) - 0.5f;
    vi first = __builtin_convertvector(x, vi);
    vf w[4];

    first += x < __builtin_convertvector(first, vf);        /* downwards */
    x -= __builtin_convertvector(first, vf);
    for (int i = 0; i < 4; i++) {
        w[i] = vf_fma(vf_set(weights[i][0]), x, vf_set(weights[i][1]));
        w[i] = vf_fma(w[i], x, vf_set(weights[i][2]));
        w[i] = vf_fma(w[i], x, vf_set(weights[i][3]));
    }
    vf_put_rows(weight[0], w, 4);
    return first - 1;
}

/* Those of positions (u,v) in a texture of S x S pixels. */
VEC_INLINE void lookup_taps_make(struct lookup_taps *t, const float *u,
                                 const float *v, size_t S)
{
    const int32_t last = (int32_t)S - 3;
    vi x = lookup_axis(t->across, u, (float)S);
    vi y = lookup_axis(t->down, v, (float)S);
    vi inside = (x >= 0) & (y >= 0) & (x < last) & (y < last);

    vi_store(t->x, x);
    vi_store(t->y, y);
    vi_store(t->at, (y * (int32_t)S + x) | ~inside);
}

/* Sum of the four pixels, in order. */
VEC_INLINE vq lookup_sum(const vf p[VEC_PARTS])
{
#if defined(ISA_AVX512)
    __m256 half = _mm256_add_ps(_mm512_castps512_ps256((__m512)p[0]),
                                _mm512_extractf32x8_ps((__m512)p[0], 1));
    return (vq)_mm_add_ps(_mm256_castps256_ps128(half),
                          _mm256_extractf128_ps(half, 1));
#else
    vq q[4];

    memcpy(q, p, sizeof q);
    return (q[0] + q[2]) + (q[1] + q[3]);
#endif
}

/* Weights of the pixels that vector k of four pixels' channels holds. */
VEC_INLINE vf lookup_spread(const float w[4], const int k)
{
#if VEC == 16
    vf v = vf_repeat(w);

    (void)k;
    return __builtin_shufflevector(v, v, 0, 0, 0, 0, 5, 5, 5, 5,
                                   10, 10, 10, 10, 15, 15, 15, 15);
#elif VEC == 8
    vf v = vf_repeat(w);

    return k ? __builtin_shufflevector(v, v, 2, 2, 2, 2, 7, 7, 7, 7)
             : __builtin_shufflevector(v, v, 0, 0, 0, 0, 5, 5, 5, 5);
#else
    return vf_set(w[k]);
#endif
}

/* The sum over four rows `stride` bytes apart. */
VEC_INLINE vq lookup_cubic(const uint8_t *row, size_t stride,
                           const float across[4], const float down[4])
{
    vf sum[VEC_PARTS] = {{0}};

    for (int j = 0; j < 4; j++, row += stride) {
        for (int k = 0; k < VEC_PARTS; k++)
            sum[k] = vf_fma(vf_set(down[j]), vf_load_bytes(row + VEC * k),
                            sum[k]);
    }
#pragma GCC unroll 4
    for (int k = 0; k < VEC_PARTS; k++)
        sum[k] *= lookup_spread(across, k);
    return lookup_sum(sum);
}

/* Index i of n pixels, clamped inside. */
static inline size_t lookup_clamp(int32_t i, int32_t n)
{
    return (size_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
}

/* The same for position k where rows or columns are missing. */
static vq lookup_border(const uint8_t *texture, size_t S,
                        const struct lookup_taps *t, size_t k)
{
    uint8_t near[4][16];

    for (int j = 0; j < 4; j++)
        for (int i = 0; i < 4; i++)
            memcpy(near[j] + 4 * i, texture + 4 *
                   (S * lookup_clamp(t->y[k] + j, (int32_t)S) +
                    lookup_clamp(t->x[k] + i, (int32_t)S)), 4);
    return lookup_cubic(near[0], sizeof near[0], t->across[k], t->down[k]);
}

/* Each lane of c / 255 clamped to 0..1: the cubic overshoots at edges. */
VEC_INLINE vq lookup_saturate(vq c)
{
    c *= 1.0f / 255;
#ifdef __SSE2__
    return (vq)_mm_min_ps(_mm_max_ps((__m128)c, _mm_setzero_ps()),
                          _mm_set1_ps(1));
#else
    for (int k = 0; k < 4; k++)
        c[k] = c[k] > 0 ? c[k] < 1 ? c[k] : 1 : 0;
    return c;
#endif
}

static void ISA(texture_bicubic)(float *photo, const struct lookup_run *r,
                                 size_t n, const uint8_t *texture, size_t S)
{
    struct lookup_taps t;

    for (size_t i = 0; i < n; i++, photo += TEXTURE_PHOTO) {
        const size_t k = i % VEC;

        if (k == 0) {
            lookup_taps_make(&t, r->u + i, r->v + i, S);
            if (t.at[0] >= 0)           /* what the next row will need */
                __builtin_prefetch(texture + 4 * ((size_t)t.at[0] + 4 * S));
        }
        if (!(r->confidence[i] > 0))
            continue;
        vq c = t.at[k] < 0 ? lookup_border(texture, S, &t, k)
                           : lookup_cubic(texture + 4 * (size_t)t.at[k], 4 * S,
                                          t.across[k], t.down[k]);

        c = lookup_saturate(c);
        vq_store(photo, c);
        photo[4] = r->confidence[i] * (1 - (1 - c[3]) * r->solid[i]);
    }
}

/* ---- over what was drawn ------------------------------------------------- */

/* Four pixels. */
VEC_INLINE void lookup_mix_four(float *color, float *alpha,
                                const float *photo)
{
    vq p[4], w, c[3], was[3], a = vq_load(alpha);

    for (int k = 0; k < 4; k++) {
        p[k] = vq_load(photo + TEXTURE_PHOTO * k);
        w[k] = photo[TEXTURE_PHOTO * k + 4];
    }
    for (int k = 0; k < 3; k++)
        was[k] = vq_load(color + 4 * k);
    c[0] = __builtin_shufflevector(p[0], p[1], 0, 1, 2, 4);
    c[1] = __builtin_shufflevector(p[1], p[2], 1, 2, 4, 5);
    c[2] = __builtin_shufflevector(p[2], p[3], 2, 4, 5, 6);
    vq_store(color, was[0] + (c[0] - was[0]) *
             __builtin_shufflevector(w, w, 0, 0, 0, 1));
    vq_store(color + 4, was[1] + (c[1] - was[1]) *
             __builtin_shufflevector(w, w, 1, 1, 2, 2));
    vq_store(color + 8, was[2] + (c[2] - was[2]) *
             __builtin_shufflevector(w, w, 2, 3, 3, 3));
    vq_transpose(p);
    vq_store(alpha, a + w * (p[3] - a));
}

/* Fewer than four, at the end of a run: the same arithmetic. */
static void lookup_mix_rest(float *color, float *alpha, const float *photo,
                            size_t n)
{
    float c[12] = {0}, a[4] = {0}, p[4 * TEXTURE_PHOTO] = {0};

    memcpy(c, color, 3 * n * sizeof *c);
    memcpy(a, alpha, n * sizeof *a);
    memcpy(p, photo, TEXTURE_PHOTO * n * sizeof *p);
    lookup_mix_four(c, a, p);
    memcpy(color, c, 3 * n * sizeof *c);
    memcpy(alpha, a, n * sizeof *a);
}

static void ISA(texture_mix)(float *color, float *alpha, const float *photo,
                             size_t n)
{
    size_t i = 0;

    for (; i + 4 <= n; i += 4) {
        const float *p = photo + TEXTURE_PHOTO * i;

        if (p[4] != 0 || p[9] != 0 || p[14] != 0 || p[19] != 0)
            lookup_mix_four(color + 3 * i, alpha + i, p);
    }
    if (i < n)
        lookup_mix_rest(color + 3 * i, alpha + i, photo + TEXTURE_PHOTO * i,
                        n - i);
}

const struct lookup_kernels ISA(lookup_kernels) = {
    ISA(lookup_places), ISA(texture_bicubic), ISA(texture_mix)
};
