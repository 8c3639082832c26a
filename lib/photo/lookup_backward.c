/* Back through the lookup in the photograph (texture.h): from colours to the
 * places they were taken at, and from the confidence to what it goes by. */
#include "lib/photo/texture.h"

#include <math.h>
#include <string.h>

#include "lib/photo/lookup.h"

/* ---- colours ----------------------------------------------------------- */

/* Keys's weights at t in [0,1), and their derivatives. */
static void lookup_weights(float w[4], float dw[4], float t)
{
    float t2 = t * t, t3 = t2 * t;

    w[0] = -0.75f * t3 + 1.5f * t2 - 0.75f * t;
    w[1] = 1.25f * t3 - 2.25f * t2 + 1;
    w[2] = -1.25f * t3 + 1.5f * t2 + 0.75f * t;
    w[3] = 0.75f * t3 - 0.75f * t2;
    dw[0] = -2.25f * t2 + 3 * t - 0.75f;
    dw[1] = 3.75f * t2 - 4.5f * t;
    dw[2] = -3.75f * t2 + 3 * t + 0.75f;
    dw[3] = 2.25f * t2 - 1.5f * t;
}

/* Index i of n pixels, clamped inside. */
static size_t lookup_clamp(long i, long n)
{
    return (size_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
}

/* A lookup's four numbers, and how they change along the two axes. */
struct lookup_sample {
    float sum[4], by_x[4], by_y[4];
};

/* At the position (u,v), pixels, of texture (S,S,4). */
static struct lookup_sample lookup_sample_at(const uint8_t *texture, size_t S,
                                             float u, float v)
{
    const float end = (float)S;
    float x = fminf(fmaxf(u, -2), end + 2) - 0.5f;
    float y = fminf(fmaxf(v, -2), end + 2) - 0.5f;
    float fx = floorf(x), fy = floorf(y), wx[4], wy[4], dx[4], dy[4];
    struct lookup_sample s = {0};

    lookup_weights(wx, dx, x - fx);
    lookup_weights(wy, dy, y - fy);
    for (int k = 0; k < 16; k++) {
        int i = k % 4, j = k / 4;
        const uint8_t *p = texture + 4 *
            (S * lookup_clamp((long)fy - 1 + j, (long)S) +
             lookup_clamp((long)fx - 1 + i, (long)S));

        for (int c = 0; c < 4; c++) {
            float value = (float)p[c] / 255;

            s.sum[c] += wy[j] * wx[i] * value;
            s.by_x[c] += wy[j] * dx[i] * value;
            s.by_y[c] += dy[j] * wx[i] * value;
        }
    }
    return s;
}

/* duv (2) = gradient by the position of a lookup whose four numbers have
 * gradient d. */
static void lookup_position_backward(float duv[2], const float d[4],
                                     const struct lookup_sample *s)
{
    duv[0] = duv[1] = 0;
    for (int c = 0; c < 4; c++)
        if (s->sum[c] > 0 && s->sum[c] < 1) {   /* the rest is clamped */
            duv[0] += d[c] * s->by_x[c];
            duv[1] += d[c] * s->by_y[c];
        }
}

/* dp (4) += duv through the place p (4) on M(y), half its picture's side (back
 * through splat_place_blended). */
static void lookup_place_backward(float *dp, const float duv[2],
                                  const float *p, const double M[2],
                                  const struct splat_place_side *side,
                                  float half)
{
    const float *e = side->e, by = half / p[2];
    const float along = (float)(e[0] * M[0] + e[1] * M[1]) *
                        (duv[0] * e[0] + duv[1] * e[1]);

    dp[0] += by * duv[0];
    dp[1] += by * duv[1];
    dp[2] -= by * (duv[0] * p[0] + duv[1] * p[1] - p[3] * along) / p[2];
    dp[3] -= by * along;
}

/* ---- confidence -------------------------------------------------------- */

/* dp (4) and dalpha += the confidence's gradient d at the place p (4) under
 * coverage alpha, of which it is `times` as much at most. */
static void lookup_confidence_backward(float *dp, float *dalpha,
                                       const float *p, float alpha,
                                       float times, float d)
{
    const float cover = fmaxf(alpha, TEXTURE_MIN);
    const float own = TEXTURE_SHARE(p[2] / cover);
    const float slope = TEXTURE_SHARE(1) - TEXTURE_SHARE(0);

    if (times * alpha < 1) {
        *dalpha += d * times * fminf(own, 1);
        d *= times * alpha;
    }
    if (own < 1) {
        dp[2] += d * slope / cover;
        if (alpha > TEXTURE_MIN)
            *dalpha -= d * slope * p[2] / (cover * cover);
    }
}

/* The confidence itself. */
static float lookup_confidence(const float *p, float alpha, float times)
{
    const float own = TEXTURE_SHARE(p[2] / fmaxf(alpha, TEXTURE_MIN));

    return fminf(fmaxf(own, 0), 1) * fminf(times * alpha, 1);
}

/* texture_turn, of the head alone. */
static float lookup_turn(const struct splat_place_view *v, float x, float y)
{
    const float *n = v->neck, below = n[0] * x + n[1] * y + n[2] - 1;

    return (1 - fminf(fmaxf(below, 0), 1)) * texture_turn(v);
}

/* Back through what the confidence loses where the photograph shows nobody: d (5) of
 * what came out becomes that of the confidence and matte before, dalpha is added
 * to. */
static void lookup_cover_backward(float d[TEXTURE_PHOTO], float *dalpha,
                                  float confidence, float matte, float turn,
                                  float alpha)
{
    const float solid = fminf(TEXTURE_SOLID(alpha), 1), by = turn * solid;
    const float slope = solid < 1 ? TEXTURE_SOLID(1) - TEXTURE_SOLID(0) : 0;

    if (!(solid > 0))
        return;
    *dalpha -= d[4] * confidence * (1 - matte) * turn * slope;
    d[3] += d[4] * confidence * by;
    d[4] *= 1 - (1 - matte) * by;
}

/* ---- the whole lookup --------------------------------------------------- */

void texture_lookup_backward(float *dplace, float *dalpha,
                             const float *dphoto, const struct texture *t,
                             const struct splat_place_view *v,
                             const float *place, const float *alpha,
                             size_t size)
{
    const size_t level = texture_level(t, v, size), S = t->side[level];
    const float step = 2.0f / (float)size, half = 0.5f * (float)S;
    const float times = texture_cover(v);
    const struct splat_place_side side = splat_place_side(v);

    for (size_t i = 0; i < size * size; i++) {
        const float *p = place + SPLAT_PLACE_CHANNELS * i;
        float d[TEXTURE_PHOTO], *dp = dplace + SPLAT_PLACE_CHANNELS * i;
        float nx = ((float)(i % size) + 0.5f) * step - 1;
        float ny = ((float)(i / size) + 0.5f) * step - 1, duv[2];
        double M[2], at[2];

        const float confidence = lookup_confidence(p, alpha[i], times);

        if (!(p[2] > TEXTURE_MIN) || !(confidence > 0))
            continue;
        memcpy(d, dphoto + TEXTURE_PHOTO * i, sizeof d);
        splat_place_at(M, v, nx, ny);
        memcpy(at, M, sizeof at);
        splat_place_blended(at, &side, p);
        const struct lookup_sample s =
            lookup_sample_at(t->level[level], S, half * ((float)at[0] + 1),
                             half * ((float)at[1] + 1));
        lookup_cover_backward(d, dalpha + i, confidence,
                              fminf(fmaxf(s.sum[3], 0), 1),
                              lookup_turn(v, nx, ny), alpha[i]);
        lookup_confidence_backward(dp, dalpha + i, p, alpha[i], times, d[4]);
        lookup_position_backward(duv, d, &s);
        lookup_place_backward(dp, duv, p, M, &side, half);
    }
}
