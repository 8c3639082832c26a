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

/* The derivatives of texture_cover by matte and alpha. */
static void lookup_cover_slopes(float slope[2], float matte, float alpha,
                                struct texture_rim rim)
{
    slope[0] = slope[1] = 0;
    if (matte > rim.most * alpha) {
        slope[0] = -rim.most * alpha / (matte * matte);
        slope[1] = rim.most / matte;
    } else if (matte < alpha && alpha < 2 * matte) {
        slope[0] = -rim.least * alpha / (matte * matte);
        slope[1] = rim.least / matte;
    }
}

/* c (4) was multiplied by texture_cover: dc (4) from d (4); returns the
 * gradient by alpha. */
static float lookup_cover_backward(float dc[4], const float d[4],
                                   const float c[4], float alpha,
                                   struct texture_rim rim)
{
    const float by = texture_cover(c[3], alpha, rim);
    float slope[2], sum = 0;

    lookup_cover_slopes(slope, c[3], alpha, rim);
    for (int k = 0; k < 4; k++) {
        sum += d[k] * c[k];
        dc[k] = by * d[k];
    }
    dc[3] += sum * slope[0];
    return sum * slope[1];
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
 * gradient d; returns the gradient by the coverage alpha. */
static float lookup_position_backward(float duv[2], const float d[4],
                                      const struct lookup_sample *s,
                                      float alpha, struct texture_rim rim)
{
    float clamped[4], dc[4];

    for (int c = 0; c < 4; c++)
        clamped[c] = fminf(fmaxf(s->sum[c], 0), 1);
    const float dalpha = lookup_cover_backward(dc, d, clamped, alpha, rim);
    duv[0] = duv[1] = 0;
    for (int c = 0; c < 4; c++)
        if (s->sum[c] > 0 && s->sum[c] < 1) {   /* the rest is clamped */
            duv[0] += dc[c] * s->by_x[c];
            duv[1] += dc[c] * s->by_y[c];
        }
    return dalpha;
}

/* dp (3) += duv through the place p (3), half its picture's side. */
static void lookup_place_backward(float *dp, const float duv[2],
                                  const float *p, float half)
{
    dp[0] += half * duv[0] / p[2];
    dp[1] += half * duv[1] / p[2];
    dp[2] -= half * (duv[0] * p[0] + duv[1] * p[1]) / (p[2] * p[2]);
}

/* ---- confidence -------------------------------------------------------- */

/* The neighbour (0: none) to which the place changes most, and by how much. */
static long lookup_jump(float *jump, const float *place, size_t x, size_t y,
                        size_t size)
{
    const float *p = place + 3 * (y * size + x);
    const long row = (long)size;
    const long step[4] = {x > 0 ? -1 : 0, x + 1 < size ? 1 : 0,
                          y > 0 ? -row : 0, y + 1 < size ? row : 0};
    long most = 0;

    *jump = 0;
    for (int k = 0; k < 4; k++) {
        const float *q = p + 3 * step[k];

        if (!step[k] || !(q[2] > TEXTURE_LEAST))
            continue;
        float dx = q[0] / q[2] - p[0] / p[2], dy = q[1] / q[2] - p[1] / p[2];
        float far = 0.5f * (float)size * sqrtf(dx * dx + dy * dy);
        if (far > *jump) {
            *jump = far;
            most = step[k];
        }
    }
    return most;
}

/* Both places' gradients by the jump between p and q. */
static void lookup_jump_backward(float *dp, float *dq, const float *p,
                                 const float *q, float djump, size_t size)
{
    float dx = q[0] / q[2] - p[0] / p[2], dy = q[1] / q[2] - p[1] / p[2];
    float scale = 0.5f * (float)size * djump / sqrtf(dx * dx + dy * dy);
    const float to[2] = {scale * dx, scale * dy};
    const float from[2] = {-to[0], -to[1]};

    lookup_place_backward(dq, to, q, 1);
    lookup_place_backward(dp, from, p, 1);
}

/* dplace and dalpha += the confidence's gradient at pixel (x,y), and what the
 * confidence was. */
static float lookup_confidence_backward(float *dplace, float *dalpha,
                                        const float *place,
                                        const struct splat_place_view *v,
                                        float zoom, float alpha, float d,
                                        size_t x, size_t y, size_t size)
{
    const size_t i = y * size + x;
    const float *p = place + 3 * i;
    float cover = fmaxf(alpha, TEXTURE_LEAST), jump;
    float own = TEXTURE_SHARE(p[2] / cover);
    long to = lookup_jump(&jump, place, x, y, size);
    float sure = (TEXTURE_LEAP - jump) / (TEXTURE_LEAP - TEXTURE_JUMP);
    float clamped = fminf(fmaxf(sure, 0), 1), most = fminf(fmaxf(own, 0), 1);
    float drawn = texture_stretch(place, v, zoom, x, y, size);

    d *= drawn;
    if (own > 0 && own < 1) {
        const float slope = TEXTURE_SHARE(1) - TEXTURE_SHARE(0);

        dplace[3 * i + 2] += d * clamped * slope / cover;
        if (alpha > TEXTURE_LEAST)
            dalpha[i] -= d * clamped * slope * p[2] / (cover * cover);
    }
    if (sure > 0 && sure < 1)
        lookup_jump_backward(dplace + 3 * i, dplace + 3 * i + 3 * to, p,
                             p + 3 * to,
                             -d * most / (TEXTURE_LEAP - TEXTURE_JUMP), size);
    return most * clamped * drawn;
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
    const float *A = v->A, *b = v->b;
    const struct texture_rim rim = texture_rim(v);
    const float zoom = texture_zoom(v);

    for (size_t i = 0; i < size * size; i++) {
        const float *p = place + 3 * i, *d = dphoto + TEXTURE_PHOTO * i;
        float nx = ((float)(i % size) + 0.5f) * step - 1;
        float ny = ((float)(i / size) + 0.5f) * step - 1, duv[2];

        if (!(p[2] > TEXTURE_LEAST))
            continue;
        const struct lookup_sample s = lookup_sample_at(
            t->level[level], S,
            half * (A[0] * nx + A[1] * ny + b[0] + p[0] / p[2] + 1),
            half * (A[2] * nx + A[3] * ny + b[1] + p[1] / p[2] + 1));
        const struct texture_rim here = texture_rim_at(
            rim, texture_inside(alpha, i % size, i / size, size));
        const float whole = texture_whole(fminf(fmaxf(s.sum[3], 0), 1),
                                          alpha[i], here);
        if (!(lookup_confidence_backward(dplace, dalpha, place, v, zoom,
                                         alpha[i], d[4] * whole, i % size,
                                         i / size, size) > 0))
            continue;
        dalpha[i] += lookup_position_backward(duv, d, &s, alpha[i], here);
        lookup_place_backward(dplace + 3 * i, duv, p, half);
    }
}
