/* Linear light to encoded bytes: exposure, tone, blur, noise, coarse cells,
 * JPEG. */
#include "lib/lab/people/lens.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/vec.h"

/* sRGB-encoded value of linear x (0..1), from a table over the square root. */
static float srgb_table[1026];

static float lens_encode(float x)
{
    float t = sqrtf(clampf(x, 0, 1)) * 1024;
    int i = (int)t;

    return lerpf(srgb_table[i], srgb_table[i + 1], t - (float)i);
}

void lens_init(void)
{
    for (int i = 0; i < 1026; i++) {
        float r = (float)i / 1024, x = r * r;
        srgb_table[i] = x <= 0.0031308f
                        ? 12.92f * x : 1.055f * powf(x, 1 / 2.4f) - 0.055f;
    }
}

/* Highlights roll off instead of clipping. */
static float lens_shoulder(float x)
{
    return x < 0.55f ? x : 0.55f + 0.45f * (1 - 1 / (1 + (x - 0.55f) * 2.2f));
}

/* The weights w (2 r + 1) of a blur by a Gaussian of sigma pixels, which sum
 * to 1; returns r, 1 to `most`. */
static int lens_blur_weights(float *w, int most, float sigma)
{
    int r = (int)ceilf(2.5f * sigma);
    float sum = 0;

    r = r < 1 ? 1 : r > most ? most : r;
    for (int i = -r; i <= r; i++)
        sum += w[i + r] = expf(-0.5f * (float)(i * i) / (sigma * sigma));
    for (int i = 0; i <= 2 * r; i++)
        w[i] /= sum;
    return r;
}

/* One pixel of a row blurred across: ends are repeated. */
static void lens_soften_end(float *to, const float *row, int x, int n,
                            int channels, const float *w, int r)
{
    for (int k = 0; k < channels; k++) {
        float v = 0;
        for (int i = -r; i <= r; i++) {
            int u = x + i < 0 ? 0 : x + i >= n ? n - 1 : x + i;
            v += w[i + r] * row[channels * u + k];
        }
        to[channels * x + k] = v;
    }
}

void lens_soften(float *img, float *tmp, int n, int channels, int most,
                 float sigma)
{
    float w[2 * LENS_BLUR_MOST + 1];
    const int row = channels * n, r = lens_blur_weights(w, most, sigma);
    const int edge = r < (n + 1) / 2 ? r : (n + 1) / 2;

    for (int y = 0; y < n; y++) {                       /* across */
        const float *from = img + row * y;
        float *to = tmp + row * y;

        for (int x = 0; x < edge; x++) {
            lens_soften_end(to, from, x, n, channels, w, r);
            lens_soften_end(to, from, n - 1 - x, n, channels, w, r);
        }
        for (int x = channels * edge; x < channels * (n - edge); x++)
            to[x] = 0;
        for (int i = -r; i <= r; i++)
            for (int x = channels * edge; x < channels * (n - edge); x++)
                to[x] += w[i + r] * from[x + channels * i];
    }
    for (int y = 0; y < n; y++) {                       /* down */
        memset(img + row * y, 0, (size_t)row * sizeof *img);
        for (int i = -r; i <= r; i++) {
            int v = y + i < 0 ? 0 : y + i >= n ? n - 1 : y + i;
            for (int x = 0; x < row; x++)
                img[row * y + x] += w[i + r] * tmp[row * v + x];
        }
    }
}

void lens_smear(float *img, float *tmp, int n, int channels, int most,
                float dx, float dy)
{
    const size_t bytes = (size_t)(channels * n * n) * sizeof *img;
    int taps = (int)ceilf(fmaxf(fabsf(dx), fabsf(dy))) + 1;

    taps = taps > most ? most : taps;
    memset(tmp, 0, bytes);
    for (int i = 0; i < taps; i++) {
        float t = taps > 1 ? (float)i / (float)(taps - 1) - 0.5f : 0;
        int u = (int)lrintf(t * dx), v = (int)lrintf(t * dy);
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++) {
                int p = x + u, q = y + v;
                p = p < 0 ? 0 : p >= n ? n - 1 : p;
                q = q < 0 ? 0 : q >= n ? n - 1 : q;
                for (int k = 0; k < channels; k++)
                    tmp[channels * (y * n + x) + k]
                        += img[channels * (q * n + p) + k] / (float)taps;
            }
    }
    memcpy(img, tmp, bytes);
}

void lens_coarsen(float *img, float *tmp, int n, int channels, float low)
{
    int m = (int)((float)n * low);

    m = m < 8 ? 8 : m;
    float step = (float)n / (float)m;
    for (int y = 0; y < m; y++)
        for (int x = 0; x < m; x++)
            for (int k = 0; k < channels; k++) {
                int u = (int)(((float)x + 0.25f) * step);
                int v = (int)(((float)y + 0.25f) * step);
                int u1 = (int)(((float)x + 0.75f) * step);
                int v1 = (int)(((float)y + 0.75f) * step);
                tmp[channels * (y * m + x) + k]
                    = 0.25f * (img[channels * (v * n + u) + k]
                               + img[channels * (v * n + u1) + k]
                               + img[channels * (v1 * n + u) + k]
                               + img[channels * (v1 * n + u1) + k]);
            }
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float fu = clampf(((float)x + 0.5f) / step - 0.5f, 0,
                              (float)(m - 1) - 0.001f);
            float fv = clampf(((float)y + 0.5f) / step - 0.5f, 0,
                              (float)(m - 1) - 0.001f);
            int u = (int)fu, v = (int)fv;
            for (int k = 0; k < channels; k++) {
                const float *p = tmp + channels * (v * m + u) + k;
                img[channels * (y * n + x) + k]
                    = lerpf(lerpf(p[0], p[channels], fu - (float)u),
                            lerpf(p[channels * m],
                                  p[channels * (m + 1)], fu - (float)u),
                            fv - (float)v);
            }
        }
}

/* What happens to light on its way: motion, and a lens that is not sharp. */
static void lens_optics(float *img, float *tmp, int n, int channels,
                        const struct lens_look *l, float dx, float dy)
{
    if (l->shutter > 0 && fabsf(dx) + fabsf(dy) > 1)
        lens_smear(img, tmp, n, channels, 9, dx, dy);
    lens_soften(img, tmp, n, channels, 7,
                (0.42f + l->blur) * (float)n / 256);
}

/* Linear light to encoded colours: balance, vignette, tone, saturation. */
static void lens_develop(float *img, int n, const struct lens_look *l)
{
    float half = 0.5f * (float)n;

    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float *p = img + 3 * (y * n + x), v[3], gray;
            float dx = ((float)x - half) / half, dy = ((float)y - half) / half;
            float e = l->exposure * (1 - l->vignette * 0.35f
                                         * (dx * dx + dy * dy));
            for (int k = 0; k < 3; k++)
                v[k] = lens_encode(lens_shoulder(p[k] * e * l->balance[k]));
            gray = 0.30f * v[0] + 0.59f * v[1] + 0.11f * v[2];
            for (int k = 0; k < 3; k++) {
                float c = gray + (v[k] - gray) * l->saturation;
                c = 0.45f + (c - 0.45f) * l->contrast;
                c = clampf(c, 0, 1);
                p[k] = l->gamma == 1 ? c
                                     : c + (l->gamma - 1) * c * (c - 1) * 1.2f;
            }
        }
}

float lens_grain(float v, int k, uint64_t h, float noise)
{
    /* sum of two bytes: close enough to a bell */
    int g = (int)(h >> (16 * k) & 255) + (int)(h >> (16 * k + 8) & 255);

    return v + noise * ((float)g - 255) * (1 / 104.0f) * (1.3f - 0.8f * v);
}

/* Noise of the sensor, then bytes. */
static void lens_finish(struct stage *s, const float *img,
                        const struct persona *p, uint64_t frame)
{
    size_t n = (size_t)s->size * (size_t)s->size;
    uint64_t key = random_mix(p->key ^ random_mix(frame + 0x6e6f));

    for (size_t i = 0; i < n; i++) {
        uint64_t h = random_mix(key + i);
        for (int k = 0; k < 3; k++) {
            float v = lens_grain(img[3 * i + (size_t)k], k, h, p->lens.noise);
            s->rgb[3 * i + (size_t)k]
                = (uint8_t)(clampf(v, 0, 1) * 255 + 0.5f);
        }
        s->mask[i] = (uint8_t)(s->cover[i] * 255 + 0.5f);
    }
}

void lens_expose(struct stage *s, const struct persona *p, const float *wall,
                 uint64_t frame, double time, float blur_x, float blur_y)
{
    size_t n = (size_t)s->size * (size_t)s->size;
    const struct lens_look *l = &p->lens;
    float *img = s->light;

    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++)
            img[3 * i + k] += wall[3 * i + k] * (1 - s->cover[i]);
    occluder_draw(s, p, time);
    lens_optics(img, s->scratch, s->size, 3, l, blur_x, blur_y);
    lens_optics(s->cover, s->scratch, s->size, 1, l, blur_x, blur_y);
    lens_develop(img, s->size, l);
    if (l->low < 0.95f) {
        lens_coarsen(img, s->scratch, s->size, 3, l->low);
        lens_coarsen(s->cover, s->scratch, s->size, 1, l->low);
    }
    lens_finish(s, img, p, frame);
    if (l->jpeg)
        jpeg_damage(s->rgb, s->scratch, s->size, l->jpeg);
}
