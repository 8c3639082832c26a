/* The panorama projected on harmonics, its peaks taken out as lamps, and
 * blurred levels of it. */
#include "lib/lab/people/scan_light.h"

#include <math.h>
#include <string.h>

#include "formats/panorama.h"
#include "lib/base/vec3.h"

/* Exponents of the cosine lobe of each level; level 0 mirrors. */
static const int lobe[LIGHT_LEVELS] = {0, 90, 22, 5};
static const int level_width[LIGHT_LEVELS] = {512, 64, 48, 32};

/* ---- preparing a panorama ----------------------------------------------- */

/* out (h,w,3) = means over the cells of a larger picture. */
static void light_shrink(float *out, int w, int h, const float *in, int iw,
                         int ih)
{
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            int x0 = x * iw / w, x1 = (x + 1) * iw / w;
            int y0 = y * ih / h, y1 = (y + 1) * ih / h;
            double sum[3] = {0, 0, 0};
            for (int v = y0; v < y1; v++)
                for (int u = x0; u < x1; u++)
                    for (int k = 0; k < 3; k++)
                        sum[k] += (double)in[3 * (v * iw + u) + k];
            for (int k = 0; k < 3; k++)
                out[3 * (y * w + x) + k]
                    = (float)(sum[k] / ((x1 - x0) * (y1 - y0)));
        }
}

/* Mean luminance over the sphere. */
static double light_mean(const float *p, int w, int h)
{
    double sum = 0;

    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++)
            sum += (double)(panorama_solid_angle(y, w, h)
                            * light_luminance(p + 3 * (y * w + x)));
    return sum / (4 * (double)PI_F);
}

/* The light within `reach` radians of the brightest place becomes a lamp and
 * leaves p, which keeps the mean of its surroundings there.  Returns whether
 * it was worth a lamp. */
static int light_take_lamp(struct lamp *l, float *p, int w, int h)
{
    float best = 0, peak[3] = {0, 1, 0}, rim[3] = {0, 0, 0}, n = 0;
    const float reach = 0.22f;

    for (int i = 0; i < w * h; i++)
        if (light_luminance(p + 3 * i) > best) {
            best = light_luminance(p + 3 * i);
            panorama_direction(peak, i % w, i / w, w, h);
        }
    *l = (struct lamp){0};
    for (int pass = 0; pass < 2; pass++) {
        float size = 0, all = 0;
        for (int i = 0; i < w * h; i++) {
            float d[3], *c = p + 3 * i;
            float sa = panorama_solid_angle(i / w, w, h);
            panorama_direction(d, i % w, i / w, w, h);
            float angle = acosf(clampf(dot3(d, peak), -1, 1));
            if (pass == 0 && angle > reach && angle < 1.5f * reach) {
                mad3(rim, rim, c, sa);
                n += sa;
            }
            if (pass == 0 || angle > reach)
                continue;
            for (int k = 0; k < 3; k++) {
                float over = maxf(c[k] - rim[k], 0);
                l->rgb[k] += over * sa;
                mad3(l->dir, l->dir, d, over * sa);
                size += over * sa * angle;
                all += over * sa;
                c[k] -= over;
            }
        }
        for (int k = 0; pass == 0 && k < 3; k++)
            rim[k] /= maxf(n, 1e-6f);
        l->size = clampf(size / maxf(all, 1e-9f), 0.01f, reach);
    }
    unit3(l->dir);
    /* the whole sphere at mean luminance 1 gives irradiance pi */
    return light_luminance(l->rgb) > 0.12f;
}

static float light_power_of(float x, int n)
{
    float p = 1;

    for (; n; n >>= 1, x *= x)
        if (n & 1)
            p *= x;
    return p;
}

/* Mirrored by a rough surface: every direction's mean under a cosine lobe.  dir
 * (ih,iw,4) is scratch. */
static void light_blur_level(float *out, int w, int h, const float *in, int iw,
                             int ih, int power, float *dir)
{
    const float min = powf(1e-4f, 1 / (float)power);
    float *area = dir + 3 * iw * ih;

    for (int i = 0; i < ih; i++)
        area[i] = panorama_solid_angle(i, iw, ih);
    for (int i = 0; i < iw * ih; i++)
        panorama_direction(dir + 3 * i, i % iw, i / iw, iw, ih);
    for (int i = 0; i < w * h; i++) {
        float d[3], sum[3] = {0, 0, 0}, all = 0;
        panorama_direction(d, i % w, i / w, w, h);
        for (int j = 0; j < iw * ih; j++) {
            float c = dot3(d, dir + 3 * j);
            if (c < min)
                continue;
            c = light_power_of(c, power) * area[j / iw];
            mad3(sum, sum, in + 3 * j, c);
            all += c;
        }
        for (int k = 0; k < 3; k++)
            out[3 * i + k] = sum[k] / maxf(all, 1e-9f);
    }
}

/* Ever smaller and blurrier panoramas, and one without its lamps. */
int light_map_make(struct light_map *m, const float *rgb, int w, int h,
                   struct arena *memory, struct error *err)
{
    const int sw = level_width[1], sh = sw / 2;
    const size_t n = (size_t)(sw * sh);
    struct arena room = {0};
    float *dir = arena_take(&room, 4 * n, sizeof *dir);

    *m = (struct light_map){.calm = arena_take(memory, 3 * n, sizeof *m->calm)};
    for (int k = 0; k < LIGHT_LEVELS; k++) {
        m->w[k] = level_width[k] < w ? level_width[k] : w;
        m->h[k] = m->w[k] / 2;
        m->level[k] = arena_take(memory, 3 * (size_t)(m->w[k] * m->h[k]),
                                 sizeof *m->level[k]);
    }
    int rc = arena_check(&room, "a light", err) ||
             arena_check(memory, "a light", err) ? -1 : 0;
    if (rc)
        goto out;
    light_shrink(m->level[0], m->w[0], m->h[0], rgb, w, h);
    light_shrink(m->calm, sw, sh, m->level[0], m->w[0], m->h[0]);
    double mean = light_mean(m->calm, sw, sh);
    for (int i = 0; i < 3 * m->w[0] * m->h[0]; i++)
        m->level[0][i] = (float)((double)m->level[0][i] / mean);
    for (size_t i = 0; i < 3 * n; i++)
        m->calm[i] = (float)((double)m->calm[i] / mean);
    while (m->nlamp < LIGHT_LAMPS
           && light_take_lamp(&m->lamp[m->nlamp], m->calm, sw, sh))
        m->nlamp++;
    for (int k = 1; k < LIGHT_LEVELS; k++)
        light_blur_level(m->level[k], m->w[k], m->h[k], m->calm, sw, sh,
                         lobe[k], dir);
out:
    arena_release(&room);
    return rc;
}

int light_map_load(struct light_map *m, const char *path, struct arena *memory,
                   struct error *err)
{
    struct panorama p;

    if (panorama_read(&p, path, err))
        return -1;
    int rc = light_map_make(m, p.rgb, (int)p.width, (int)p.height, memory, err);
    panorama_release(&p);
    return rc;
}

/* ---- harmonics ---------------------------------------------------------- */

float harmonic2_moments(const struct harmonic2 *h, const float m[10])
{
    const float *c = h->c, *q = m + 4;

    return h->a * m[0] + h->b[0] * m[1] + h->b[1] * m[2] + h->b[2] * m[3]
           + c[0] * q[0] + c[1] * q[1] + c[2] * q[2]
           + 2 * (c[3] * q[3] + c[4] * q[4] + c[5] * q[5]);
}

void harmonic2_turn(struct harmonic2 *o, const struct harmonic2 *h,
                    const float r[9])
{
    float m[9] = {h->c[0], h->c[3], h->c[4], h->c[3], h->c[1], h->c[5],
                  h->c[4], h->c[5], h->c[2]}, t[9], rt[9], b[3];

    for (int i = 0; i < 9; i++)
        rt[i] = r[3 * (i % 3) + i / 3];
    rot3(b, r, h->b);
    mat3_mul(t, r, m);
    mat3_mul(m, t, rt);
    o->a = h->a;
    copy3(o->b, b);
    o->c[0] = m[0];
    o->c[1] = m[4];
    o->c[2] = m[8];
    o->c[3] = m[1];
    o->c[4] = m[2];
    o->c[5] = m[5];
}

/* ---- one person's light ------------------------------------------------- */

/* World to camera at turn t, and back. */
static void light_to_camera(float o[3], const float d[3], float t)
{
    float c = cosf(t), s = sinf(t);

    o[0] = c * d[0] + s * d[2];
    o[1] = -d[1];
    o[2] = -(c * d[2] - s * d[0]);
}

/* Light that falls on people has been about: paler than what it comes from. */
static void light_pale(float c[3])
{
    float lum = light_luminance(c), gray[3] = {lum, lum, lum};

    lerp3(c, c, gray, 0.35f);
}

void light_init(struct light *l, const struct light_map *m, float turn,
                const float gain[3])
{
    int w = level_width[1], h = w / 2;

    *l = (struct light){.map = m, .turn = turn, .nlamp = m->nlamp};
    copy3(l->gain, gain);
    for (int i = 0; i < w * h; i++) {
        float d[3], c[3];
        panorama_direction(d, i % w, i / w, w, h);
        light_to_camera(c, d, turn);
        float rgb[3];
        copy3(rgb, m->calm + 3 * i);
        light_pale(rgb);
        for (int k = 0; k < 3; k++)
            harmonic2_add(&l->sky[k], c,
                          gain[k] * rgb[k]
                          * panorama_solid_angle(i / w, w, h));
    }
    for (int i = 0; i < m->nlamp; i++) {
        l->lamp[i] = m->lamp[i];
        light_to_camera(l->lamp[i].dir, m->lamp[i].dir, turn);
        light_pale(l->lamp[i].rgb);
        for (int k = 0; k < 3; k++)
            l->lamp[i].rgb[k] *= gain[k];
    }
}

/* Luminance of a surface with unit normal n. */
static float light_on(const void *light, const float n[3])
{
    const struct light *l = light;
    float c[3];

    for (int k = 0; k < 3; k++)
        c[k] = maxf(harmonic2_diffuse(&l->sky[k], n), 0);
    for (int i = 0; i < l->nlamp; i++)
        mad3(c, c, l->lamp[i].rgb,
             maxf(dot3(n, l->lamp[i].dir), 0) / PI_F);
    return light_luminance(c);
}

void light_slope(float slope[3], const struct light *l)
{
    light_fit(slope, light_on, l);
}

/* Bilinear in a level at texture place (u, v) in 0..1. */
static void light_sample_level(float o[3], const float *p, int w, int h,
                               float u, float v)
{
    float x = u * (float)w - 0.5f, y = v * (float)h - 0.5f;
    int x0 = (int)floorf(x), y0 = (int)floorf(y);
    float fx = x - (float)x0, fy = y - (float)y0;
    int x1 = x0 + 1, y1 = y0 + 1;

    x0 = x0 < 0 ? x0 + w : x0 >= w ? x0 - w : x0;
    x1 = x1 < 0 ? x1 + w : x1 >= w ? x1 - w : x1;
    y0 = y0 < 0 ? 0 : y0 >= h ? h - 1 : y0;
    y1 = y1 < 0 ? 0 : y1 >= h ? h - 1 : y1;
    const float *a = p + 3 * (y0 * w + x0), *b = p + 3 * (y0 * w + x1);
    const float *c = p + 3 * (y1 * w + x0), *d = p + 3 * (y1 * w + x1);
    for (int k = 0; k < 3; k++)
        o[k] = lerpf(lerpf(a[k], b[k], fx), lerpf(c[k], d[k], fx), fy);
}

/* Arc tangent of y / x over 2 pi, -0.5..0.5, within 1e-4 of a turn. */
static float light_turn_of(float y, float x)
{
    float ax = fabsf(x), ay = fabsf(y);
    float a = minf(ax, ay) / maxf(maxf(ax, ay), 1e-20f);
    float s = a * a;
    float r = ((-0.0464964749f * s + 0.15931422f) * s - 0.327622764f) * s * a
              + a;

    r = ay > ax ? PI_F / 2 - r : r;
    r = x < 0 ? PI_F - r : r;
    return (y < 0 ? -r : r) / (2 * PI_F);
}

void light_mirror(float rgb[3], const struct light *l, const float d[3],
                  float level)
{
    const struct light_map *m = l->map;
    float flat = sqrtf(d[0] * d[0] + d[2] * d[2]);

    /* camera (x, z) -> world at turn 0: phi is measured from -z */
    float u = light_turn_of(d[0], d[2]) + l->turn / (2 * PI_F) + 0.5f;
    float v = 2 * light_turn_of(flat, -d[1]);
    int a = (int)level;

    u -= floorf(u);
    a = a < 0 ? 0 : a > LIGHT_LEVELS - 1 ? LIGHT_LEVELS - 1 : a;
    light_sample_level(rgb, m->level[a], m->w[a], m->h[a], u, v);
    float f = level - (float)a;
    if (f > 0.01f && a < LIGHT_LEVELS - 1) {
        float o[3];
        light_sample_level(o, m->level[a + 1], m->w[a + 1], m->h[a + 1], u, v);
        lerp3(rgb, rgb, o, f);
    }
    for (int k = 0; k < 3; k++)
        rgb[k] *= l->gain[k];
}
