/* What surfaces do with light: skin, eyes, teeth and gums, cloth, hair. */
#include <math.h>
#include <string.h>

#include "lib/lab/people/noise.h"
#include "lib/lab/people/scan_stage.h"
#include "lib/base/vec3.h"

/* ---- light on a surface ------------------------------------------------- */

/* Of a gloss: how much and how rough its mirror-like part is, 0..1, and its
 * reflectance straight on. */
enum { AMOUNT, ROUGH, F0 };

static float shade_square(float x)
{
    return x * x;
}

/* Schlick's approximation. */
static float shade_fresnel(float f0, float c)
{
    float m = 1 - clampf(c, 0, 1);

    return f0 + (1 - f0) * m * m * m * m * m;
}

/* Highlight of a lamp: GGX with Kelemen's visibility. */
static float shade_lamp_gloss(const struct scan_point *o, const struct lamp *l,
                              float rough, float f0)
{
    float h[3], a = shade_square(rough) + 0.4f * l->size;

    for (int k = 0; k < 3; k++)
        h[k] = l->dir[k] + o->view[k];
    unit3(h);
    float nh = maxf(dot3(o->n, h), 0), lh = maxf(dot3(l->dir, h), 0.1f);
    float a2 = shade_square(a), d = shade_square(nh) * (a2 - 1) + 1;

    return a2 / (3.14159f * shade_square(d) + 1e-7f) * shade_fresnel(f0, lh)
           / (4 * shade_square(lh));
}

/* Light mirrored: the sky's and the lamps', where `open` of it is free. */
static void shade_add_gloss(float rgb[3], const struct scan_stage *s,
                            const struct scan_point *o, const float *g,
                            const float shadow[LIGHT_LAMPS])
{
    const struct light *l = &s->figure->light;
    float r[3], c[3], nv = dot3(o->n, o->view);
    float open = clampf(0.5f * (o->bright[0] + o->bright[1]), 0, 1);

    for (int k = 0; k < 3; k++)
        r[k] = 2 * nv * o->n[k] - o->view[k];
    /* rough surfaces reach their full mirror only at grazing views */
    float f = shade_fresnel(g[F0], maxf(nv, 0.02f) + 0.15f * g[ROUGH]);
    light_mirror(c, l, r, g[ROUGH] * 5);
    mad3(rgb, rgb, c, g[AMOUNT] * minf(f, 0.35f) * open * open);
    for (int i = 0; i < l->nlamp; i++) {
        float nl = dot3(o->n, l->lamp[i].dir);
        if (nl <= 0 || shadow[i] <= 0)
            continue;
        mad3(rgb, rgb, l->lamp[i].rgb,
             g[AMOUNT] * shadow[i] * nl
             * minf(shade_lamp_gloss(o, &l->lamp[i], g[ROUGH], g[F0]), 12));
    }
}

/* Diffuse light (over pi); wrap: how far light creeps round per channel. */
static void shade_diffuse(float e[3], float shadow[LIGHT_LAMPS],
                          const struct scan_stage *s,
                          const struct scan_point *o, const float wrap[3])
{
    const struct light *l = &s->figure->light;

    for (int k = 0; k < 3; k++)
        e[k] = maxf(harmonic2_diffuse(&l->sky[k], o->n), 0.01f)
               * o->bright[k];
    for (int i = 0; i < l->nlamp; i++) {
        float nl = dot3(o->n, l->lamp[i].dir);
        shadow[i] = 0;
        if (nl < -0.4f)
            continue;
        shadow[i] = scan_shadow_at(s, i, o->p, o->n);
        for (int k = 0; k < 3; k++) {
            float w = wrap[k], d = maxf((nl + w) / (1 + w), 0);
            /* light bleeds into the edge of a shadow, red the farthest */
            float t = clampf(shadow[i] + w * 2.2f * shadow[i]
                             * (1 - shadow[i]), 0, 1);
            e[k] += l->lamp[i].rgb[k] * 0.3183f * t
                    * (w > 0 ? d * d * (1 - w) + d * w : d);
        }
    }
}

static const float no_wrap[3] = {0, 0, 0};

/* ---- skin --------------------------------------------------------------- */

/* Bilinear in the person's texture: albedo linear, slope of the height. */
static void shade_skin_sample(float c[3], float slope[2], const uint8_t *skin,
                              float u, float v)
{
    float x = clampf(u * SKIN_SIZE - 0.5f, 0, SKIN_SIZE - 1.001f);
    float y = clampf((1 - v) * SKIN_SIZE - 0.5f, 0, SKIN_SIZE - 1.001f);
    int x0 = (int)x, y0 = (int)y;
    float fx = x - (float)x0, fy = y - (float)y0;
    const uint8_t *a = skin + 4 * (y0 * SKIN_SIZE + x0), *b = a + 4;
    const uint8_t *d = a + 4 * SKIN_SIZE, *e = d + 4;
    float w[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};

    for (int k = 0; k < 3; k++) {
        float m = (w[0] * a[k] + w[1] * b[k] + w[2] * d[k] + w[3] * e[k])
                  * (1 / 255.0f);
        c[k] = m * m;
    }
    slope[0] = lerpf((float)(b[3] - a[3]), (float)(e[3] - d[3]), fy);
    slope[1] = -lerpf((float)(d[3] - a[3]), (float)(e[3] - b[3]), fx);
}

/* Tilt the normal by a slope along the texture's axes, which follow the
 * head's: u to its left, v up. */
static void shade_tilt(float n[3], const float rot[9], const float slope[2],
                       float amount)
{
    float up[3] = {rot[1], rot[4], rot[7]}, t[3], b[3];

    cross3(t, up, n);
    unit3(t);
    cross3(b, n, t);
    mad3(n, n, t, -amount * slope[0]);
    mad3(n, n, b, -amount * slope[1]);
    unit3(n);
}

/* Scattered light with the skin's relief, and its shine. */
static void shade_skin(float rgb[3], const struct scan_stage *s,
                       struct scan_point *o, bool textured)
{
    const struct figure *f = s->figure;
    const struct traits *t = &f->assets->traits;
    float c[3], e[3], shadow[LIGHT_LAMPS], slope[2] = {0, 0};

    copy3(c, f->tone);
    if (textured) {
        shade_skin_sample(c, slope, f->skin, o->u, o->v);
        shade_tilt(o->n, s->view.rot, slope, 0.004f);
    }
    shade_diffuse(e, shadow, s, o, t->wrap_skin);
    for (int k = 0; k < 3; k++)
        rgb[k] = c[k] * e[k];
    for (int k = 0; k < 2; k++) {       /* broad and oily */
        const float *g = t->gloss_skin[k];
        float own[3] = {g[AMOUNT] * f->look.gloss, g[ROUGH], g[F0]};
        shade_add_gloss(rgb, s, o, own, shadow);
    }
}

/* ---- eyes --------------------------------------------------------------- */

/* The eye's own frame in the camera's: columns right, up, axis. */
static void shade_eye_frame(float m[9], float centre[3],
                            const struct scan_stage *s, int e)
{
    const struct figure *f = s->figure;
    float exp[ARKIT_EXP], jaw[3], lid[2], eye[6], r[9], a[3], t[9];

    arkit_to_motion(exp, ARKIT_EXP, jaw, lid, eye, s->act->weight);
    rodrigues33(r, eye + 3 * e);
    rot3(a, r, f->assets->face.axis[e]);
    float right[3] = {r[0], r[3], r[6]}, up[3];
    cross3(up, a, right);
    unit3(up);
    cross3(right, up, a);
    columns33(t, right, up, a);
    mat3_mul(m, s->view.rot, t);
    rot3(centre, s->view.rot, f->eye[e]);
    mad3(centre, centre, s->view.trans, 1);
}

/* Colour of the iris at (x, y) in iris radii, or of the white at angle radii
 * outside it. */
static void shade_eye_color(float c[3], const struct figure *f, float x,
                            float y, float pupil)
{
    const struct scan_person *l = &f->look;
    float r = sqrtf(x * x + y * y), rgba[4];

    /* the pictures' pupil is 0.3 of the iris; widen or narrow it */
    float t = r < 1 ? r < pupil ? r * 0.30f / pupil
                                : 0.30f + (r - pupil) * 0.70f / (1 - pupil)
                    : r;
    float g = r > 1e-5f ? t / r : 1;
    bitmap_sample(rgba, &f->assets->iris[l->iris < 0 ? 0 : l->iris],
                 0.70f + 0.115f * x * g, 0.70f + 0.115f * y * g);
    for (int k = 0; k < 3; k++)
        c[k] = shade_square(rgba[k]);
    if (l->iris_tint[0] >= 0) {
        float lum = 0.3f * c[0] + 0.6f * c[1] + 0.1f * c[2];
        float own = ramp(1.06f, 0.92f, r);
        for (int k = 0; k < 3; k++)
            c[k] = lerpf(c[k], l->iris_tint[k] * lum * 7.5f, own);
    }
    float dark = 0.25f + 0.75f * ramp(pupil, pupil + 0.1f, r);
    dark *= 1 - 0.45f * ramp(0.72f, 0.97f, r) * ramp(1.12f, 0.98f, r);
    for (int k = 0; k < 3; k++)
        c[k] *= r < 1.15f ? dark : 1;
}

/* Sclera, iris behind the cornea and what it mirrors. */
static void shade_eye(float rgb[3], const struct scan_stage *s,
                      struct scan_point *o, int e)
{
    const struct figure *f = s->figure;
    float m[9], centre[3], d[3], p[3], v[3], c[3], light[3];
    float shadow[LIGHT_LAMPS], radius = 0.0300f * f->look.iris_size;
    float pupil = 0.36f + 0.12f * s->act->pupil;

    shade_eye_frame(m, centre, s, e);
    sub3(d, o->p, centre);
    for (int k = 0; k < 3; k++) {
        p[k] = m[k] * d[0] + m[3 + k] * d[1] + m[6 + k] * d[2];
        v[k] = -(m[k] * o->view[0] + m[3 + k] * o->view[1]
                 + m[6 + k] * o->view[2]);
    }
    float r = sqrtf(p[0] * p[0] + p[1] * p[1]), x = p[0], y = p[1];
    if (p[2] > 0 && r < 1.2f * radius) {
        /* bent by the cornea, down to the iris behind it */
        float deep = maxf(p[2] - 0.0685f, 0), n[3], bent[3];
        for (int k = 0; k < 3; k++)
            n[k] = m[k] * o->n[0] + m[3 + k] * o->n[1] + m[6 + k] * o->n[2];
        float eta = 1 / 1.336f, ci = -dot3(v, n);
        float k2 = 1 - eta * eta * (1 - ci * ci);
        for (int k = 0; k < 3; k++)
            bent[k] = eta * v[k] + (eta * ci - sqrtf(maxf(k2, 0))) * n[k];
        if (bent[2] < -0.1f) {
            x += bent[0] / -bent[2] * deep;
            y += bent[1] / -bent[2] * deep;
        }
    }
    shade_eye_color(c, f, x / radius, y / radius, pupil);
    shade_diffuse(light, shadow, s, o, f->assets->traits.wrap_eye);
    for (int k = 0; k < 3; k++)
        rgb[k] = c[k] * light[k] * (r > radius ? 0.88f : 1);
    shade_add_gloss(rgb, s, o, f->assets->traits.gloss_eye, shadow);
}

/* ---- the rest ----------------------------------------------------------- */

static void shade_plain(float rgb[3], const struct scan_stage *s,
                        struct scan_point *o, const float color[3],
                        const float *g, const float wrap[3])
{
    float e[3], shadow[LIGHT_LAMPS];

    shade_diffuse(e, shadow, s, o, wrap);
    for (int k = 0; k < 3; k++)
        rgb[k] = color[k] * e[k];
    if (g)
        shade_add_gloss(rgb, s, o, g, shadow);
}

/* The part's picture over its mean, in the part's colour. */
static float shade_piece_color(float c[3], const struct figure_part *p, float u,
                               float v)
{
    float t[4];

    copy3(c, p->tint);
    if (!p->piece || !p->piece->picture.rgba)
        return 1;
    bitmap_sample(t, &p->piece->picture, u, v);
    float lum = 0, mean = 0;
    static const float w[3] = {0.3f, 0.59f, 0.11f};
    for (int k = 0; k < 3; k++) {
        lum += w[k] * shade_square(t[k]);
        mean += w[k] * p->piece->mean[k];
    }
    float g = powf(clampf(lum / maxf(mean, 0.004f), 0.05f, 6), 0.55f);
    for (int k = 0; k < 3; k++)
        c[k] = p->own ? shade_square(t[k]) : clampf(c[k] * g, 0, 0.95f);
    return t[3];
}

void scan_shade(float rgb[3], const struct scan_stage *s,
                struct scan_point *o)
{
    const struct figure *f = s->figure;
    const struct traits *t = &f->assets->traits;
    const struct figure_part *p = &f->parts[f->part[o->face]];
    float c[3];

    if (dot3(o->n, o->view) < 0
        && (p->stuff > STUFF_SCALP || p->ride == RIDE_FREE))
        mad3(o->n, (float[3]){0, 0, 0}, o->n, -1);
    switch (f->stuff[o->face]) {
    case STUFF_SKIN: shade_skin(rgb, s, o, true); break;
    case STUFF_SCALP:
    case STUFF_BODY:
    case STUFF_HAND: shade_skin(rgb, s, o, false); break;
    case STUFF_EYE_LEFT: shade_eye(rgb, s, o, 0); break;
    case STUFF_EYE_RIGHT: shade_eye(rgb, s, o, 1); break;
    case STUFF_TEETH:
        shade_plain(rgb, s, o, f->look.tooth, t->gloss_tooth,
                    t->wrap_skin);
        break;
    case STUFF_GUM:
    case STUFF_SOCKET:
        shade_plain(rgb, s, o, f->look.gum, t->gloss_gum, t->wrap_skin);
        break;
    case STUFF_FRAME:
    case STUFF_METAL:
        shade_plain(rgb, s, o, p->tint, t->gloss_metal, no_wrap);
        break;
    default:
        shade_piece_color(c, p, o->u, o->v);
        shade_plain(rgb, s, o, c, NULL, no_wrap);
    }
}

/* Hair: two highlights along the strands, diffuse light all around. */
static void shade_hair(float rgb[3], const struct scan_stage *s,
                       struct scan_point *o, const float color[3])
{
    const struct figure *f = s->figure;
    const struct light *l = &f->light;
    const float *m = s->view.rot;
    float t[3] = {m[1], m[4], m[7]}, e[3];

    /* strands hang: along the surface, downwards */
    mad3(t, t, o->n, -dot3(t, o->n));
    unit3(t);
    for (int k = 0; k < 3; k++)
        e[k] = maxf(harmonic2_diffuse(&l->sky[k], o->n), 0.01f)
               * o->bright[k];
    float shine[3] = {0, 0, 0}, r[3], c[3];
    for (int i = 0; i < l->nlamp; i++) {
        const struct lamp *a = &l->lamp[i];
        float tl = dot3(t, a->dir), tv = dot3(t, o->view);
        float sl = sqrtf(maxf(1 - tl * tl, 0));
        float shadow = scan_shadow_at(s, i, o->p, o->n);
        float nl = clampf(0.5f + 0.5f * dot3(o->n, a->dir), 0, 1);
        float g1 = tl + tv - 0.10f, g2 = tl + tv + 0.18f;
        float h1 = 1 / shade_square(1 + 40 * g1 * g1);
        float h2 = 1 / shade_square(1 + 14 * g2 * g2);
        for (int k = 0; k < 3; k++) {
            e[k] += a->rgb[k] * 0.3183f * shadow * sl * nl * 0.8f;
            shine[k] += a->rgb[k] * shadow * nl * sl
                        * (0.030f * h1 + 0.35f * color[k] * h2);
        }
    }
    /* the sky's highlight: mirrored about the strand's cross-section */
    float tv = dot3(t, o->view);
    for (int k = 0; k < 3; k++)
        r[k] = o->n[k] * 1.2f - t[k] * tv;
    light_mirror(c, l, r, 2.4f);
    for (int k = 0; k < 3; k++)
        rgb[k] = color[k] * e[k] + f->look.hair_gloss
                 * (shine[k] + c[k] * o->bright[k] * o->bright[k]
                               * (0.012f + 0.10f * color[k]));
}

/* A lens: clear glass with what it mirrors, or dark. */
static float shade_lens(float rgb[3], const struct scan_stage *s,
                        struct scan_point *o)
{
    const struct figure *f = s->figure;
    float nv = maxf(dot3(o->n, o->view), 0), r[3], c[3];
    const bool sun = f->look.glasses == GLASSES_SUN;
    float a = sun ? 0.88f : 0.05f;

    for (int k = 0; k < 3; k++)
        r[k] = 2 * nv * o->n[k] - o->view[k];
    light_mirror(c, &f->light, r, 0);
    float g = shade_fresnel(sun ? 0.05f : 0.035f, nv);
    for (int k = 0; k < 3; k++)
        rgb[k] = minf(c[k], 40) * g / a
                 + (sun ? 0.01f : 0.02f);
    return a;
}

/* Lashes stand in rows: u runs along the lid, v from root to tip. */
static float shade_lash_cover(const struct scan_point *o, float thick)
{
    float x = o->u * 46 + 2.5f * sinf(9 * o->u) * o->v, f = x - floorf(x);
    float d = fabsf(f - 0.5f) / (0.26f * thick * (1.05f - o->v));

    return o->v > 0.98f ? 0 : clampf(1.5f - d, 0, 1) * 0.75f;
}

/* Opacity of a layer of short hair: tufts and single hairs, fewer the farther
 * out. */
static float shade_fur_cover(const struct scan_point *o)
{
    float layer = floorf(o->extra), dense = (o->extra - layer) / 0.99f;
    float x = o->u * 420, y = o->v * 420 + 1.5f * layer;
    float p[3] = {x * 0.9f, y * 0.5f, layer * 0.35f}, n[4];
    float q[3] = {x * 0.22f, y * 0.16f, 3};

    noise4(n, p);
    float fine = n[0] + 0.6f * n[1];
    noise4(n, q);
    return clampf(dense * (1.1f - 0.22f * layer)
                  * (0.55f + 0.6f * fine + 0.25f * n[0]), 0, 1);
}

/* Opacity of a brow: hairs that lean outwards. */
static float shade_brow_cover(const struct scan_stage *s,
                              const struct scan_point *o)
{
    const struct figure *f = s->figure;
    float side = o->u > 0.5f ? -1 : 1, dense = brow_density(f->brow, o->u, o->v);
    float x = o->u * 512 * side, y = o->v * 512, n[4];
    float p[3] = {0.16f * x - 0.08f * y, 0.7f * y + 0.35f * x, side};

    if (dense <= 0)
        return 0;
    noise4(n, p);
    dense *= 1 + 0.4f * (1 - dense) * n[0] + 0.15f * n[1];
    return clampf(dense * f->look.brow_weight, 0, 1);
}

float scan_shade_veil(float rgb[3], const struct scan_stage *s,
                      struct scan_point *o)
{
    const struct figure *f = s->figure;
    const struct figure_part *p = &f->parts[f->part[o->face]];
    float c[3], shadow[LIGHT_LAMPS], e[3],
        a = shade_piece_color(c, p, o->u, o->v);
    const struct traits *t = &f->assets->traits;

    if (a <= 0.004f)
        return 0;
    if (dot3(o->n, o->view) < 0 && p->stuff != STUFF_HAIR)
        mad3(o->n, (float[3]){0, 0, 0}, o->n, -1);
    switch (p->stuff) {
    case STUFF_LASH:
        rgb[0] = rgb[1] = rgb[2] = 0.012f;
        return shade_lash_cover(o, f->look.lash);
    case STUFF_TEAR:
        shade_diffuse(e, shadow, s, o, no_wrap);
        rgb[0] = rgb[1] = rgb[2] = 0;
        shade_add_gloss(rgb, s, o, t->gloss_tear, shadow);
        for (int k = 0; k < 3; k++)
            rgb[k] = rgb[k] / 0.15f + 0.3f * e[k];
        return 0.15f;
    case STUFF_BROW:
        a = shade_brow_cover(s, o);
        if (a > 0)
            shade_plain(rgb, s, o, c, NULL, t->wrap_skin);
        return a;
    case STUFF_FUR:
        a = shade_fur_cover(o);
        shade_hair(rgb, s, o, c);
        return a;
    case STUFF_GLASS:
        return shade_lens(rgb, s, o);
    default:
        shade_hair(rgb, s, o, c);
        return a;
    }
}
