/* Shadow map, ambient occlusion on the screen, gathering of samples for the
 * shaders, and resolving samples to pixels. */
#include "lib/lab/people/stage.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/lab/people/vec.h"

#define SUN_REACH 1.35f         /* half the width of what it sees */
#define SUN_SHARP 26.0f

/* Three-texel box, twice: about the softness of a small window. */
static void lighting_soften(float *map, float *tmp, int n)
{
    for (int pass = 0; pass < 2; pass++) {
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++) {
                const float *r = map + y * n;
                int l = x ? x - 1 : 0, h = x < n - 1 ? x + 1 : x;
                tmp[y * n + x] = (r[l] + r[x] + r[h]) * (1 / 3.0f);
            }
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++) {
                int l = y ? y - 1 : 0, h = y < n - 1 ? y + 1 : y;
                map[y * n + x] = (tmp[l * n + x] + tmp[y * n + x]
                                  + tmp[h * n + x]) * (1 / 3.0f);
            }
    }
}

void stage_shadow(struct stage *s, const struct actor *a,
                  struct shade_env *env)
{
    struct shade_shadow *w = &env->shadow;
    const float up[3] = { 0, -1, 0 };
    size_t n = (size_t)STAGE_SHADOW * STAGE_SHADOW;

    *w = (struct shade_shadow){ .map = s->shadow, .n = STAGE_SHADOW,
                                .sharp = SUN_SHARP };
    sun_aim(&w->sun, env->light[0].dir, up, STAGE_SHADOW, SUN_REACH);
    sun_centre(&w->sun, s->place, a->head->V, 16);
    raster_clear(&s->sun);
    for (size_t i = 0; i < a->nv; i++)
        s->spot[i] = sun_place(&w->sun, s->place + 3 * i);
    raster_triangles(&s->sun, s->spot, a->faces, a->nf, 0, 0);
    for (size_t i = 0; i < a->nstrand; i++) {
        const struct strand *t = &a->strand[i];
        if (t->kind != STRAND_HAIR || i % 2)
            continue;
        for (int j = 0; j < t->points; j++)
            s->tuft_spot[t->first + (size_t)j]
                = sun_place(&w->sun, s->tuft + 3 * (t->first + (size_t)j));
        raster_strand(&s->sun, s->tuft_spot + t->first, t->points, t->first,
                      2 * t->half * w->sun.scale, 1);
    }
    for (size_t i = 0; i < n; i++) {
        float h = s->sun.q[i] > 0 ? s->sun.q[i] - SUN_FAR : -2;
        s->shadow[i] = expf(SUN_SHARP * clampf(h, -2, 2));
    }
    lighting_soften(s->shadow, s->blur, STAGE_SHADOW);
}

/* ---- ambient occlusion ------------------------------------------------- */

/* Place of sample (x, y) in camera space. */
static void lighting_unproject(float p[3], const struct stage *s, int x, int y,
                               float inv_focal)
{
    float q = s->eye.q[(size_t)y * (size_t)s->eye.w + (size_t)x];
    float z = 1 / q, half = 0.5f * (float)s->eye.w;

    p[0] = ((float)x + 0.5f - half) * z * inv_focal;
    p[1] = ((float)y + 0.5f - half) * z * inv_focal;
    p[2] = z;
}

/* Interpolated over its face, unit. */
static void lighting_sample_normal(float n[3], const struct stage *s,
                                   const struct actor *a, size_t at)
{
    const int32_t *f = a->faces + 3 * s->eye.id[at];
    float b1 = s->eye.b1[at], b2 = s->eye.b2[at];

    for (int k = 0; k < 3; k++)
        n[k] = s->normal[3 * f[0] + k] * (1 - b1 - b2)
               + s->normal[3 * f[1] + k] * b1 + s->normal[3 * f[2] + k] * b2;
    unit3(n);
    if (n[2] > 0)
        for (int k = 0; k < 3; k++)
            n[k] = -n[k];
}

/* Share of taps about the sample that something nearer hides. */
static float lighting_occlusion_at(const struct stage *s, const struct actor *a,
                                   int x, int y, float inv_focal)
{
    /* a spiral of ten taps, turned from pixel to pixel */
    static const float ring[10] = { .10f, .18f, .27f, .36f, .46f, .56f, .67f,
                                    .78f, .89f, 1 };
    size_t at = (size_t)y * (size_t)s->eye.w + (size_t)x;
    float p[3], n[3], sum = 0;
    lighting_unproject(p, s, x, y, inv_focal);
    lighting_sample_normal(n, s, a, at);
    float reach = 0.15f / (p[2] * inv_focal);
    uint32_t h = (uint32_t)(x >> 1) * 0x9e3779b1u
                 ^ (uint32_t)(y >> 1) * 0x85ebca6bu;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    float turn = (float)(h >> 8) * (6.2831853f / 16777216.0f);
    float c = cosf(turn), sn = sinf(turn);
    for (int i = 0; i < 10; i++) {
        float r = reach * ring[i] * ring[i];
        int u = x + (int)(c * r), v = y + (int)(sn * r);
        /* the golden angle */
        float t = c * -0.7373688f - sn * 0.6754903f;
        sn = c * 0.6754903f + sn * -0.7373688f;
        c = t;
        if (u < 0 || v < 0 || u >= s->eye.w || v >= s->eye.h
            || s->eye.q[(size_t)v * (size_t)s->eye.w + (size_t)u] <= 0)
            continue;
        float q[3], d[3];
        lighting_unproject(q, s, u, v, inv_focal);
        sub3(d, q, p);
        float l2 = dot3(d, d), up = dot3(d, n) - 0.004f;
        float near = clampf(1 - l2 / 0.06f, 0, 1);
        sum += near * fmaxf(up, 0) / sqrtf(l2 + 1e-6f);
    }
    return clampf(1 - 0.30f * sum * 0.9f, 0.08f, 1);
}

void stage_occlusion(struct stage *s, const struct actor *a)
{
    float inv = 1 / camera_focal((float)s->eye.w);
    int n = s->size;

    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            int u = x * STAGE_GRID, v = y * STAGE_GRID;
            uint32_t id = s->eye.id[(size_t)v * (size_t)s->eye.w + (size_t)u];
            s->ao_blur[y * n + x] = id & RASTER_STRAND ? 1
                                  : lighting_occlusion_at(s, a, u, v, inv);
        }
    for (int y = 0; y < n; y++)
        for (int x = 0; x < n; x++) {
            float sum = 0, w = 0;
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < n; v++)
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < n; u++) {
                    sum += s->ao_blur[v * n + u];
                    w += 1;
                }
            s->ao[y * n + x] = sum / w;
        }
}
