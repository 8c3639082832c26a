/* The shaders, compiled once per instruction set.  Every loop runs over the
 * lanes of a block without branches, so that the compiler can vectorise it;
 * the Makefile turns contraction off so that all versions round alike. */
#include "lib/lab/people/shade.h"

#include <math.h>
#include <string.h>

#include "lib/base/isa.h"
#include "lib/lab/people/noise.h"

#define N SHADE_N
#define LANES for (int i = 0; i < N; i++)

typedef float lane[N];

shade_skin_fn ISA(shade_skin);
shade_eye_fn ISA(shade_eye);
shade_cloth_fn ISA(shade_cloth);
shade_strand_fn ISA(shade_strand);

static inline float shade_clamp01(float x)
{
    x = x > 0 ? x : 0;
    return x < 1 ? x : 1;
}
static inline float shade_mix(float a, float b, float t)
{
    return a + (b - a) * t;
}
static inline float shade_max(float a, float b)
{
    return a > b ? a : b;
}
static inline float shade_step01(float a, float b, float x)
{
    float t = shade_clamp01((x - a) / (b - a));

    return t * t * (3 - 2 * t);
}

/* 2^x within 2e-4 relative, for x in -126..126. */
static inline float shade_exp2_fast(float x)
{
    x = x > -126 ? x : -126;
    x = x < 126 ? x : 126;
    int e = (int)(x + 256) - 256;
    float f = x - (float)e;
    float m = 1 + f * (0.6951786f + f * (0.2276770f + f * 0.0780245f));
    union { int i; float f; } bits = { .i = (e + 127) << 23 };
    return bits.f * m;
}
static inline float shade_exp_fast(float x)
{
    return shade_exp2_fast(x * 1.44269504f);
}

/* noise4 of noise.h for a block. */
static void shade_noise_block(lane out[4], const lane p[3],
                              const float shift[3], float scale)
{
    const uint32_t *lattice = noise_lattice_data;

    LANES {
        float x = (p[0][i] * scale) + shift[0];
        float y = (p[1][i] * scale) + shift[1];
        float z = (p[2][i] * scale) + shift[2];
        int xi = (int)(x + 8192) - 8192, yi = (int)(y + 8192) - 8192;
        int zi = (int)(z + 8192) - 8192;
        float fx = x - (float)xi, fy = y - (float)yi, fz = z - (float)zi;
        fx = fx * fx * (3 - 2 * fx);
        fy = fy * fy * (3 - 2 * fy);
        fz = fz * fz * (3 - 2 * fz);
        float s0 = 0, s1 = 0, s2 = 0, s3 = 0;
        for (int c = 0; c < 8; c++) {
            int a = c & 1, b = c >> 1 & 1, d = c >> 2;
            int at = (((zi + d) & (NOISE_N - 1)) * NOISE_N
                      + ((yi + b) & (NOISE_N - 1))) * NOISE_N
                     + ((xi + a) & (NOISE_N - 1));
            uint32_t v = lattice[at];
            float w = (a ? fx : 1 - fx) * (b ? fy : 1 - fy)
                      * (d ? fz : 1 - fz);
            s0 += w * (float)(int)(v & 255);
            s1 += w * (float)(int)(v >> 8 & 255);
            s2 += w * (float)(int)(v >> 16 & 255);
            s3 += w * (float)(int)(v >> 24);
        }
        out[0][i] = s0 * (2 / 255.0f) - 1;
        out[1][i] = s1 * (2 / 255.0f) - 1;
        out[2][i] = s2 * (2 / 255.0f) - 1;
        out[3][i] = s3 * (2 / 255.0f) - 1;
    }
}

static void shade_unit_block(lane v[3])
{
    LANES {
        float l = v[0][i] * v[0][i] + v[1][i] * v[1][i] + v[2][i] * v[2][i];
        float s = 1 / sqrtf(l + 1e-20f);
        v[0][i] *= s;
        v[1][i] *= s;
        v[2][i] *= s;
    }
}

/* How much of light 0 arrives: 1 lit, 0 in shadow. */
static void shade_shadow_block(lane lit, const struct shade_block *b,
                               const struct shade_shadow *s, float bias)
{
    const struct sun *sun = &s->sun;
    const float *map = s->map;
    float top = (float)(s->n - 2);

    LANES {
        float x = b->p[0][i] - sun->centre[0];
        float y = b->p[1][i] - sun->centre[1];
        float z = b->p[2][i] - sun->centre[2];
        float u = x * sun->u[0] + y * sun->u[1] + z * sun->u[2];
        float v = x * sun->v[0] + y * sun->v[1] + z * sun->v[2];
        float h = x * sun->w[0] + y * sun->w[1] + z * sun->w[2];
        u = u * sun->scale + sun->half - 0.5f;
        v = v * sun->scale + sun->half - 0.5f;
        u = u > 0 ? u : 0;
        v = v > 0 ? v : 0;
        u = u < top ? u : top;
        v = v < top ? v : top;
        int ui = (int)u, vi = (int)v;
        float fu = u - (float)ui, fv = v - (float)vi;
        int at = vi * s->n + ui;
        float m = shade_mix(shade_mix(map[at], map[at + 1], fu),
                            shade_mix(map[at + s->n], map[at + s->n + 1], fu),
                            fv);
        lit[i] = shade_clamp01(shade_exp_fast(s->sharp * (h + bias)) /
                               (m + 1e-30f));
    }
}

/* Ambient light on normals n. */
static void shade_ambient_block(lane out[3], const lane n[3],
                                const struct shade_env *env)
{
    LANES {
        float w[6];
        for (int k = 0; k < 3; k++) {
            float v = n[k][i], q = v * v;
            w[2 * k] = v < 0 ? q : 0;
            w[2 * k + 1] = v < 0 ? 0 : q;
        }
        for (int c = 0; c < 3; c++)
            out[c][i] = w[0] * env->cube[0][c] + w[1] * env->cube[1][c]
                        + w[2] * env->cube[2][c] + w[3] * env->cube[3][c]
                        + w[4] * env->cube[4][c] + w[5] * env->cube[5][c];
    }
}

/* Lobes of one light about normals n, towards the eye v: a sum of two
 * exponentials in (1 - n.h), with Fresnel. */
static void shade_gloss_block(lane out, const lane n[3], const lane v[3],
                              const struct shade_light *l, float broad,
                              float tight, float share)
{
    LANES {
        float h0 = l->dir[0] + v[0][i], h1 = l->dir[1] + v[1][i];
        float h2 = l->dir[2] + v[2][i];
        float s = 1 / sqrtf(h0 * h0 + h1 * h1 + h2 * h2 + 1e-12f);
        float nh = (n[0][i] * h0 + n[1][i] * h1 + n[2][i] * h2) * s;
        float vh = (v[0][i] * h0 + v[1][i] * h1 + v[2][i] * h2) * s;
        float nl = n[0][i] * l->dir[0] + n[1][i] * l->dir[1]
                   + n[2][i] * l->dir[2];
        float g = 1 - shade_clamp01(vh), f = 0.04f + 0.96f * g * g * g * g * g;
        float e = shade_clamp01(nh) - 1;
        out[i] = f * shade_clamp01(nl * 4)
                 * (broad * 0.2f * shade_exp_fast(broad * e)
                    + share * tight * 0.2f * shade_exp_fast(tight * e));
    }
}

/* The direction to the eye. */
static void shade_view_block(lane v[3], const struct shade_block *b)
{
    for (int k = 0; k < 3; k++)
        LANES v[k][i] = -b->p[k][i];
    shade_unit_block(v);
}

/* Diffuse light that crept under the surface: red wraps furthest round the
 * terminator and into the shadow's edge.  Adds to out. */
static void shade_skin_light(lane out[3], const lane n[3], const lane lit,
                             const struct shade_light *l)
{
    static const float wrap[3] = { 0.32f, 0.14f, 0.08f };

    for (int c = 0; c < 3; c++) {
        float w = wrap[c], k = 1 / ((1 + w) * (1 + w));
        LANES {
            float nl = n[0][i] * l->dir[0] + n[1][i] * l->dir[1]
                       + n[2][i] * l->dir[2];
            float s = lit[i], open = shade_mix(s * s, sqrtf(s), w + 0.35f);
            out[c][i] += l->rgb[c] * shade_max(nl + w, 0) * k * open;
        }
    }
}

/* Base colour, redder, darker and shaven where the paint says, with noise. */
static void shade_skin_albedo(lane a[3], const struct shade_block *b,
                              const struct shade_skin *s, const lane low[4],
                              const lane mid[4], const lane spots)
{
    static const float blood[3] = { 1.06f, 0.74f, 0.72f };
    static const float shade[3] = { 0.80f, 0.66f, 0.62f };
    static const float shaven[3] = { 0.62f, 0.64f, 0.68f };

    for (int c = 0; c < 3; c++)
        LANES {
            float red = b->k[PAINT_RED][i] + s->blotch * low[0][i];
            float x = s->base[c] * (1 + 0.05f * low[1][i] + 0.05f * mid[0][i]);
            x *= shade_mix(1, blood[c], shade_clamp01(red));
            x *= shade_mix(1, shade[c], b->k[PAINT_DARK][i]);
            float spot = shade_clamp01((spots[i] - 0.42f) * 4) * s->freckle
                         * shade_clamp01(0.15f + 1.6f * b->k[PAINT_RED][i]);
            x *= 1 - spot * (0.25f + 0.15f * (float)c);
            float chin = b->k[PAINT_BEARD][i] * (0.8f + 0.4f * mid[2][i]);
            x = shade_mix(x, x * shaven[c] + 0.06f * s->hair[c],
                          shade_clamp01(chin * s->stubble));
            float lip = shade_step01(0.25f, 0.75f, b->k[PAINT_LIP][i]
                                                   + 0.05f * mid[3][i]);
            x = shade_mix(x, s->lip[c] * (1 + 0.12f * mid[2][i]), lip);
            float cap = shade_step01(0.2f, 0.6f, b->k[PAINT_HAIR][i]
                                                 + 0.15f * mid[1][i]);
            float root = shade_mix(s->hair[c] * (0.55f + 0.25f * mid[0][i]), x,
                                   s->shaved);
            x = shade_mix(x, root, cap);
            x = shade_mix(x, s->brow[c], 0.35f * b->k[PAINT_BROW][i]);
            a[c][i] = shade_max(x, 0.002f);
        }
}

/* Oil and gloss of skin, `shine` strong, in every light; lit: the first one's
 * shadow. */
static void shade_skin_gloss(struct shade_block *b, const lane n[3],
                             const lane v[3], const lane lit, const lane shine,
                             const struct shade_env *env)
{
    lane g;

    for (int l = 0; l < SHADE_LIGHTS; l++) {
        shade_gloss_block(g, n, v, &env->light[l], 9, 45, 0.5f);
        for (int c = 0; c < 3; c++)
            LANES b->rgb[c][i] += g[i] * shine[i] * env->light[l].rgb[c]
                                  * (l == 0 ? lit[i] : b->ao[i]);
    }
}

void ISA(shade_skin)(struct shade_block *b, const struct shade_env *env,
                     const struct shade_skin *s)
{
    lane low[4], mid[4], fine[4], a[3], v[3], n[3], lit, sum[3], amb[3];
    lane shine;

    shade_noise_block(low, b->c, s->shift, 7);
    shade_noise_block(mid, b->c, s->shift, 46);
    shade_noise_block(fine, b->c, s->shift, 170);
    shade_unit_block(b->n);
    shade_view_block(v, b);
    shade_skin_albedo(a, b, s, low, mid, fine[2]);
    for (int k = 0; k < 3; k++)
        LANES n[k][i] = b->n[k][i] + s->pores * (fine[k + 1][i]
                        + 0.7f * mid[k + 1][i]) + 0.02f * low[k + 1][i];
    shade_unit_block(n);
    shade_shadow_block(lit, b, &env->shadow, 0.012f);
    shade_ambient_block(amb, n, env);
    LANES shine[i] = s->oil * (0.4f + b->k[PAINT_OIL][i])
                     * (1 + 0.4f * fine[0][i]) * (1 - b->k[PAINT_HAIR][i])
                     + s->gloss * b->k[PAINT_LIP][i];
    for (int c = 0; c < 3; c++)
        LANES {
            float open = b->ao[i] * (1 - b->k[PAINT_SHUT][i]);
            /* light between surfaces of a colour takes on that colour */
            float bounce = open / (1 - a[c][i] * (1 - open) * 0.8f);
            sum[c][i] = amb[c][i] * bounce;
        }
    for (int l = 0; l < SHADE_LIGHTS; l++) {
        if (l == 1)
            LANES lit[i] = shade_mix(0.35f, 1, b->ao[i]);
        shade_skin_light(sum, n, lit, &env->light[l]);
    }
    for (int c = 0; c < 3; c++)
        LANES b->rgb[c][i] = sum[c][i] * a[c][i];
    shade_shadow_block(lit, b, &env->shadow, 0.012f);
    shade_skin_gloss(b, n, v, lit, shine, env);
    LANES {
        float nv = shade_clamp01(n[0][i] * v[0][i] + n[1][i] * v[1][i]
                                 + n[2][i] * v[2][i]);
        float f = 1 - nv, rim = f * f * f * f * 0.35f * b->ao[i] * shine[i];
        b->rgb[0][i] += amb[0][i] * rim;
        b->rgb[1][i] += amb[1][i] * rim;
        b->rgb[2][i] += amb[2][i] * rim;
    }
}

/* Iris, pupil, limbal ring and white at direction e of the eyeball. */
static void shade_eye_albedo(lane a[3], lane wet, const lane e[3],
                             const lane streak[4], const lane vein[4],
                             const struct shade_eye *s)
{
    float ri = s->iris_radius, rp = s->pupil;

    for (int c = 0; c < 3; c++)
        LANES {
            float r = sqrtf(e[0][i] * e[0][i] + e[1][i] * e[1][i]);
            r += e[2][i] < 0 ? 2 : 0;
            float t = shade_clamp01((r - rp) / (ri - rp));
            float x = shade_mix(s->iris[c] * 1.25f, s->ring[c], t * t);
            x *= 1 + 0.55f * streak[0][i] * (0.4f + 0.6f * t);
            x = shade_mix(x, s->ring[c] * 0.18f,
                          shade_step01(ri - 0.09f, ri, r));
            x = shade_mix(0.004f, x, shade_step01(rp - 0.02f, rp + 0.03f, r));
            float edge = shade_clamp01(fabsf(e[0][i]) * 1.3f - 0.35f);
            float red = edge * s->vein * (0.5f + 0.5f * vein[0][i]);
            float w = s->white[c] * (1 - red * (c == 0 ? 0.12f : 0.42f));
            a[c][i] = shade_mix(x, w, shade_step01(ri - 0.03f, ri + 0.05f, r));
            wet[i] = 1;
        }
}

/* e: directions from the eyeballs' centres; polar: where the iris' streaks are
 * looked up, around the pupil and outwards. */
static void shade_eye_directions(lane e[3], lane polar[3],
                                 const struct shade_block *b,
                                 const struct shade_eye *s)
{
    for (int k = 0; k < 3; k++)
        LANES {
            float right = b->c[0][i] < 0 ? 1 : 0;
            float o = shade_mix(s->centre[0][k], s->centre[1][k], right);
            e[k][i] = b->c[k][i] - o;
        }
    shade_unit_block(e);
    LANES {
        float r = sqrtf(e[0][i] * e[0][i] + e[1][i] * e[1][i]) + 1e-6f;
        polar[0][i] = e[0][i] / r * 7;
        polar[1][i] = e[1][i] / r * 7;
        polar[2][i] = r * 3;
    }
}

void ISA(shade_eye)(struct shade_block *b, const struct shade_env *env,
                    const struct shade_eye *s)
{
    lane e[3], polar[3], streak[4], vein[4], a[3], wet, v[3], n[3], lit, g;
    lane amb[3], refl[3], mirror[3];

    shade_eye_directions(e, polar, b, s);
    shade_noise_block(streak, polar, s->shift, 1.6f);
    shade_noise_block(vein, b->c, s->shift, 90);
    shade_eye_albedo(a, wet, e, streak, vein, s);
    shade_unit_block(b->n);
    shade_view_block(v, b);
    /* the cornea bulges: its normal turns outwards near the iris' edge */
    for (int k = 0; k < 3; k++)
        LANES n[k][i] = b->n[k][i];
    shade_shadow_block(lit, b, &env->shadow, 0.02f);
    shade_ambient_block(amb, n, env);
    LANES {
        float nv = n[0][i] * v[0][i] + n[1][i] * v[1][i] + n[2][i] * v[2][i];
        for (int k = 0; k < 3; k++)
            refl[k][i] = 2 * nv * n[k][i] - v[k][i];
    }
    shade_ambient_block(mirror, refl, env);
    for (int c = 0; c < 3; c++)
        LANES {
            float open = b->ao[i] * b->ao[i] * (1 - b->k[PAINT_SHUT][i]);
            b->rgb[c][i] = a[c][i] * amb[c][i] * open
                           + mirror[c][i] * 0.035f * b->ao[i];
        }
    for (int l = 0; l < SHADE_LIGHTS; l++) {
        const struct shade_light *q = &env->light[l];
        LANES lit[i] = l == 0 ? shade_max(lit[i], 0.15f) : b->ao[i];
        shade_gloss_block(g, n, v, q, 120, 900, 1);
        for (int c = 0; c < 3; c++)
            LANES {
                float nl = n[0][i] * q->dir[0] + n[1][i] * q->dir[1]
                           + n[2][i] * q->dir[2];
                float d = shade_max(nl + 0.25f, 0) * 0.64f * lit[i] * b->ao[i];
                b->rgb[c][i] += q->rgb[c] * (a[c][i] * d
                                             + 0.5f * g[i] * lit[i]);
            }
    }
}

/* Pattern of the cloth: how much of the second colour, and a height. */
static void shade_weave_block(lane second, lane height,
                              const struct shade_block *b,
                              const struct shade_cloth *s, const lane mid[4])
{
    float k = s->scale;
    float stripe = s->weave == CLOTH_STRIPES ? 1 : 0;
    float plaid = s->weave == CLOTH_PLAID ? 1 : 0;
    float knit = s->weave == CLOTH_KNIT ? 1 : 0;

    LANES {
        float u = b->c[0][i] * k, v = b->c[1][i] * k;
        float fu = fabsf(u - (float)(int)(u + 4096) + 4095.5f) * 2;
        float fv = fabsf(v - (float)(int)(v + 4096) + 4095.5f) * 2;
        float su = shade_step01(0.45f, 0.55f, fu),
              sv = shade_step01(0.45f, 0.55f, fv);
        second[i] = stripe * sv + plaid * 0.5f * (su + sv)
                    + s->grain * 0.5f * (1 + mid[0][i]);
        float row = v * 6 + 0.6f * (fu - 0.5f);
        float r = row - (float)(int)(row + 8192) + 8192;
        height[i] = knit * (1 - 4 * (r - 0.5f) * (r - 0.5f))
                    * (0.7f + 0.3f * fu) + (1 - knit) * 0.8f;
    }
}

void ISA(shade_cloth)(struct shade_block *b, const struct shade_env *env,
                      const struct shade_cloth *s)
{
    lane low[4], mid[4], n[3], v[3], second, height, lit, amb[3], g;

    shade_noise_block(low, b->c, s->shift, 5);
    shade_noise_block(mid, b->c, s->shift, 60);
    shade_unit_block(b->n);
    shade_view_block(v, b);
    shade_weave_block(second, height, b, s, mid);
    for (int k = 0; k < 3; k++)
        LANES n[k][i] = b->n[k][i] + s->bump * (0.5f * low[k + 1][i]
                                                + 0.35f * mid[k + 1][i]);
    shade_unit_block(n);
    shade_shadow_block(lit, b, &env->shadow, 0.03f);
    shade_ambient_block(amb, n, env);
    for (int c = 0; c < 3; c++)
        LANES {
            float open = b->ao[i] * (1 - b->k[PAINT_SHUT][i]);
            b->rgb[c][i] = amb[c][i] * open;
        }
    for (int l = 0; l < SHADE_LIGHTS; l++) {
        const struct shade_light *q = &env->light[l];
        LANES {
            float nl = n[0][i] * q->dir[0] + n[1][i] * q->dir[1]
                       + n[2][i] * q->dir[2];
            float d = shade_max(nl + 0.06f, 0) * 0.94f
                      * (l == 0 ? lit[i] : b->ao[i]);
            for (int c = 0; c < 3; c++)
                b->rgb[c][i] += q->rgb[c] * d;
        }
    }
    for (int c = 0; c < 3; c++)
        LANES {
            float a = shade_mix(s->base[c], s->second[c],
                                shade_clamp01(second[i]));
            a *= (0.55f + 0.45f * height[i]) * (1 + s->grain * mid[0][i]);
            b->rgb[c][i] *= a * (1 - 0.75f * b->k[PAINT_DARK][i]);
        }
    for (int l = 0; l < SHADE_LIGHTS; l++) {
        shade_gloss_block(g, n, v, &env->light[l], shade_mix(8, 60, s->wet),
                          300, s->wet);
        for (int c = 0; c < 3; c++)
            LANES b->rgb[c][i] += g[i] * s->gloss * env->light[l].rgb[c]
                                  * (l == 0 ? lit[i] : 1) * b->ao[i];
    }
}

/* What a strand reflects of light q, added to sum; open: how far that reaches
 * it. */
static void shade_strand_light(lane sum[3], const struct shade_block *b,
                               const lane v[3], const lane open,
                               const struct shade_strand *s,
                               const struct shade_light *q)
{
    LANES {
        float tl = 0, tv = 0, nl = 0;
        for (int k = 0; k < 3; k++) {
            tl += b->c[k][i] * q->dir[k];
            tv += b->c[k][i] * v[k][i];
            nl += b->n[k][i] * q->dir[k];
        }
        float sl = sqrtf(shade_clamp01(1 - tl * tl));
        float sv = sqrtf(shade_clamp01(1 - tv * tv));
        float face = shade_clamp01(nl * 0.75f + 0.25f + s->soft);
        float d = sl * face * open[i];
        /* Kajiya and Kay's cone, shifted to root and tip */
        float cone = sl * sv - tl * tv;
        float jitter = 0.10f * b->k[0][i];
        float e1 = shade_clamp01(cone + 0.02f + jitter) - 1;
        float e2 = shade_clamp01(cone - 0.04f - jitter) - 1;
        float w = shade_clamp01(nl * 2 + 0.2f) * open[i];
        float white = s->gloss * w * shade_exp_fast(60 * e1);
        float tint = s->tint * w * shade_exp_fast(22 * e2);
        for (int c = 0; c < 3; c++) {
            float a = s->base[c] * (1 + s->spread * b->k[0][i]);
            sum[c][i] += q->rgb[c] * (a * (d + tint)
                                      + (0.02f + 0.1f * a) * white);
        }
    }
}

void ISA(shade_strand)(struct shade_block *b, const struct shade_env *env,
                       const struct shade_strand *s)
{
    lane v[3], lit, open, amb[3], sum[3];

    shade_unit_block(b->n);
    shade_unit_block(b->c);
    shade_view_block(v, b);
    shade_shadow_block(lit, b, &env->shadow, 0.03f);
    /* the strand is round: its normal turns sideways across the width */
    LANES {
        float t0 = b->c[0][i], t1 = b->c[1][i], t2 = b->c[2][i];
        float x0 = t1 * v[2][i] - t2 * v[1][i];
        float x1 = t2 * v[0][i] - t0 * v[2][i];
        float x2 = t0 * v[1][i] - t1 * v[0][i];
        float k = 0.35f * b->k[1][i];
        b->n[0][i] += k * x0;
        b->n[1][i] += k * x1;
        b->n[2][i] += k * x2;
    }
    shade_unit_block(b->n);
    shade_ambient_block(amb, b->n, env);
    for (int c = 0; c < 3; c++)
        LANES sum[c][i] = s->base[c] * (1 + s->spread * b->k[0][i])
                          * amb[c][i] * b->k[2][i] * (0.4f + 0.6f * b->ao[i]);
    for (int l = 0; l < SHADE_LIGHTS; l++) {
        LANES open[i] = (l == 0 ? shade_mix(lit[i], sqrtf(lit[i]), 0.6f) : 1)
                        * b->k[2][i];
        shade_strand_light(sum, b, v, open, s, &env->light[l]);
    }
    memcpy(b->rgb, sum, sizeof sum);
}
