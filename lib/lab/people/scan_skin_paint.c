/* One person's skin from the statistics. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/scan_skin.h"
#include "lib/lab/people/traits.h"
#include "lib/base/vec3.h"

#define N SKIN_SIZE
#define M SKIN_SLOW
#define DONORS 12

#define MOUTH_SHADE 0.5f

/* Mean log luminance about the middle of the face. */
static float skin_mean_log(const float *o)
{
    float sum = 0;

    for (int y = M * 3 / 8; y < M * 5 / 8; y++)
        for (int x = M / 4; x < M * 3 / 4; x++) {
            const float *p = o + 3 * (y * M + x);
            sum += 0.3f * p[0] + 0.59f * p[1] + 0.11f * p[2];
        }
    return sum / (M / 4 * (M / 2));
}

/* Skin is redder than green and greener than blue, by as much as people's
 * is: the whole is shifted where the draw has left that. */
static void skin_keep_hue(float *o, const struct traits *t)
{
    float mean[3] = {0, 0, 0};

    for (int y = M * 3 / 8; y < M * 5 / 8; y++)
        for (int x = M / 4; x < M * 3 / 4; x++)
            mad3(mean, mean, o + 3 * (y * M + x), 1.0f / (M / 4 * (M / 2)));
    float rg = mean[0] - mean[1], gb = mean[1] - mean[2];
    float up = clampf(rg, t->skin_red_green[0], t->skin_red_green[1]) - rg;
    float down = clampf(gb, t->skin_green_blue[0], t->skin_green_blue[1]) - gb;
    for (size_t p = 0; p < (size_t)M * M; p++) {
        o[3 * p] += up;
        o[3 * p + 2] -= down;
    }
}

/* lip[k] <- how much lighter lips are than the middle of the face, per channel
 * of log albedo (M,M,3). */
static void skin_lip_difference(float lip[3], const float *o,
                                const struct skin_model *m)
{
    float skin[3] = {0, 0, 0}, n = 0, count = 0;

    lip[0] = lip[1] = lip[2] = 0;
    for (int y = 0; y < M; y++)
        for (int x = M / 4; x < M * 3 / 4; x++) {
            const float *p = o + 3 * (y * M + x);
            int at = (y * N + x) * (N / M);

            if (m->lip[at] == 255 && !m->mouth[at]) {
                mad3(lip, lip, p, 1);
                n += 1;
            } else if (y >= M * 3 / 8 && y < M * 5 / 8 && !m->lip[at]) {
                mad3(skin, skin, p, 1);
                count += 1;
            }
        }
    for (int k = 0; k < 3; k++)
        lip[k] = lip[k] / n - skin[k] / count;
}

/* Lips are redder and darker than the skin about them, by as much as people's
 * are. */
static void skin_keep_lips(float *o, const struct skin_model *m,
                           const struct traits *t)
{
    float lip[3];

    skin_lip_difference(lip, o, m);
    float red = lip[0] - lip[1], lum = 0.5f * (lip[0] + lip[1]);
    float more = 0.5f * (clampf(red, t->lip_red[0], t->lip_red[1]) - red);
    float dark = clampf(lum, t->lip_dark[0], t->lip_dark[1]) - lum;
    for (int y = 0; y < M; y++)
        for (int x = 0; x < M; x++) {
            float a = m->lip[(y * N + x) * (N / M)] / 255.0f;
            float *p = o + 3 * (y * M + x);

            p[0] += a * (dark + more);
            p[1] += a * (dark - more);
            p[2] += a * dark;
        }
}

/* Log albedo (M,M,3): mean, components, melanin and blood. */
static void skin_slow_colour(float *o, const struct skin_model *m,
                             const struct skin_look *l, const struct traits *t)
{
    size_t d = 3 * (size_t)M * M;

    memcpy(o, m->mean, d * sizeof *o);
    for (int k = 0; k < m->parts; k++)
        for (size_t p = 0; p < d; p++)
            o[p] += l->z[k] * m->part[(size_t)k * d + p];
    for (size_t p = 0; p < d; p++)
        o[p] += l->tone * t->skin_melanin[p % 3] + l->red * t->skin_blood[p % 3];
    skin_keep_hue(o, t);
    skin_keep_lips(o, m, t);
    /* no skin is whiter than the fairest; redness of its own stays */
    float mean = skin_mean_log(o), over = mean - logf(t->skin_fairest);
    for (size_t p = 0; over > 0 && p < d; p++)
        o[p] -= over;
}

/* Mean colour of cheeks, nose and forehead, linear. */
static void skin_find_tone(float tone[3], const float *slow)
{
    float n = 0;

    tone[0] = tone[1] = tone[2] = 0;
    for (int y = M * 3 / 8; y < M * 5 / 8; y++)
        for (int x = M / 4; x < M * 3 / 4; x++) {
            for (int k = 0; k < 3; k++)
                tone[k] += expf(slow[3 * (y * M + x) + k]);
            n += 1;
        }
    for (int k = 0; k < 3; k++)
        tone[k] /= n;
}

/* Fine log luminance (N,N): many people's grain at once, with random signs
 * of side and random shares. */
static void skin_mix_grain(float *o, const struct skin_model *m,
                           const struct skin_look *l)
{
    struct random r;
    float w[DONORS], sum = 0;
    uint32_t who[DONORS];

    random_init(&r, l->key, "grain");
    for (int k = 0; k < DONORS; k++) {
        w[k] = (float)random_range(&r, 0.3, 1);
        who[k] = random_below(&r, 2 * (uint32_t)m->people);
        sum += w[k] * w[k];
    }
    for (int p = 0; p < N * N; p++)
        o[p] = 0.7f * m->crease[p];
    for (int k = 0; k < DONORS; k++) {
        const int8_t *g = m->grain + (size_t)(who[k] / 2) * N * N;
        float a = l->grain * w[k] / (sqrtf(sum) * 256);
        for (int y = 0; y < N; y++, g += N)
            if (who[k] & 1)
                for (int x = 0; x < N; x++)
                    o[y * N + x] += a * (float)g[N - 1 - x];
            else
                for (int x = 0; x < N; x++)
                    o[y * N + x] += a * (float)g[x];
    }
}

/* Dark spots: a share of as many as most people have, with radii up to so many
 * texels and up to so deep; how: these three. */
static void skin_add_spots(float *o, struct random *r, float share,
                           const float how[3])
{
    for (int i = 0; i < (int)(how[0] * share); i++) {
        float cx = (float)random_range(r, 0.18, 0.82) * N;
        float cy = (float)random_range(r, 0.2, 0.8) * N;
        float rad = (float)random_range(r, 0.4, 1) * how[1];
        float d = (float)random_range(r, 0.3, 1) * how[2];
        int n = (int)(2 * rad) + 1;
        for (int y = (int)cy - n; y <= (int)cy + n; y++)
            for (int x = (int)cx - n; x <= (int)cx + n; x++) {
                float e = hypotf((float)x - cx, (float)y - cy) / rad;
                o[y * N + x] -= d * ramp(1.4f, 0.4f, e);
            }
    }
}

/* o (3) <- the slow colour p (M,M,3) at a texel of N. */
static void skin_bilinear(float o[3], const float *p, int x, int y)
{
    float fx = clampf(((float)x + 0.5f) * M / N - 0.5f, 0, M - 1.001f);
    float fy = clampf(((float)y + 0.5f) * M / N - 0.5f, 0, M - 1.001f);
    int u = (int)fx, v = (int)fy;
    const float *q = p + 3 * (v * M + u);

    fx -= (float)u;
    fy -= (float)v;
    for (int k = 0; k < 3; k++)
        o[k] = lerpf(lerpf(q[k], q[k + 3], fx),
                     lerpf(q[k + 3 * M], q[k + 3 * M + 3], fx), fy);
}

/* Stubble and make-up on one texel's colour. */
static void skin_decorate(float c[3], const struct skin_model *m,
                          const struct skin_look *l, const struct traits *t,
                          int i, float hair)
{
    float x = (float)(i % N) / N, y = (float)(i / N) / N;
    float lip = m->lip[i] / 255.0f, beard = m->beard[i] / 255.0f;

    if (l->stubble > 0 && beard > 0) {
        float s = l->stubble * beard * (0.5f + 0.9f * hair);
        for (int k = 0; k < 3; k++)
            c[k] *= lerpf(1, 0.72f * t->stubble_tint[k], clampf(s, 0, 1));
    }
    if (l->lipstick > 0 && lip > 0)
        lerp3(c, c, l->lip, 0.8f * lip * l->lipstick);
    /* lips shade each other where they meet */
    float between = m->mouth[i] / 255.0f;
    for (int k = 0; k < 3; k++)
        c[k] *= 1 - MOUTH_SHADE * between * between;
    float side = fabsf(x - 0.5f);
    if (l->shadow > 0) {
        /* over the eyes */
        float e = hypotf((side - 0.155f) / 0.085f, (y - 0.262f) / 0.032f);
        lerp3(c, c, l->lid, 0.7f * l->shadow * ramp(1.2f, 0.5f, e));
    }
    if (l->blush > 0) {
        float e = hypotf((side - 0.22f) / 0.10f, (y - 0.44f) / 0.06f);
        float g = 0.35f * l->blush * ramp(1.3f, 0, e);
        c[0] *= 1 - 0.1f * g;
        c[1] *= 1 - g;
        c[2] *= 1 - 0.9f * g;
    }
}

void skin_paint(uint8_t *out, float tone[3], const struct skin_model *m,
                const struct skin_look *l, const struct traits *t)
{
    static const float share[3] = {0.85f, 1.05f, 1.12f};
    struct random r;
    float *slow = malloc(3 * M * M * sizeof *slow);
    float *fine = malloc(N * N * sizeof *fine);

    tone[0] = 0.5f, tone[1] = 0.33f, tone[2] = 0.25f;
    memset(out, 128, 4 * N * N);
    if (!slow || !fine)
        goto out;
    skin_slow_colour(slow, m, l, t);
    skin_mix_grain(fine, m, l);
    random_init(&r, l->key, "spots");
    skin_add_spots(fine, &r, l->freckle, t->freckle_spots);
    skin_add_spots(fine, &r, l->mole, t->mole_spots);
    skin_find_tone(tone, slow);
    for (int i = 0; i < N * N; i++) {
        uint64_t h = random_mix(l->key + (uint64_t)i);
        float hair = (float)(h & 255) / 255, c[3];
        skin_bilinear(c, slow, i % N, i / N);
        for (int k = 0; k < 3; k++)
            c[k] = clampf(expf(c[k] + share[k] * fine[i]), 0.01f, 0.93f);
        /* where the scans' photographs end, the rest of the head begins */
        float x = fabsf((float)(i % N) / N - 0.5f), y = (float)(i / N) / N;
        float in = ramp(0.5f, 0.42f, x) * ramp(0, 0.10f, y)
                   * ramp(1, 0.88f, y);
        lerp3(c, tone, c, in);
        skin_decorate(c, m, l, t, i, hair);
        /* pores: finer than the photographs show */
        float pore = ((float)(h >> 8 & 255) + (float)(h >> 16 & 255)) / 255
                     - 1;
        float height = 128 + clampf(160 * fine[i], -70, 70) + 9 * pore;
        for (int k = 0; k < 3; k++)
            out[4 * i + k] = (uint8_t)(255 * sqrtf(c[k]) + 0.5f);
        out[4 * i + 3] = (uint8_t)clampf(height, 0, 255);
    }
out:
    free(slow);
    free(fine);
}
