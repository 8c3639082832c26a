/* Each trait from a sequence of its own, named by what it is. */
#include "lib/lab/people/persona.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/vec.h"

static float persona_normal(struct random *r)
{
    return clampf((float)random_normal(r), -2.5f, 2.5f);
}
/* sRGB 0..255 to linear light */
static void persona_linear(float out[3], const float srgb[3])
{
    for (int k = 0; k < 3; k++) {
        float v = srgb[k] / 255;
        out[k] = v <= 0.04045f ? v / 12.92f
                               : powf((v + 0.055f) / 1.055f, 2.4f);
    }
}
/* Linear colour at place t (0..1) of a row of n sRGB colours. */
static void persona_palette(float out[3], const float (*row)[3], int n, float t)
{
    float a[3], b[3], x = clampf(t, 0, 1) * (float)(n - 1);
    int i = (int)x;

    i = i > n - 2 ? n - 2 : i;
    persona_linear(a, row[i]);
    persona_linear(b, row[i + 1]);
    lerp3(out, a, b, x - (float)i);
}
static void persona_jitter(struct random *r, float c[3], float s)
{
    float all = 1 + s * persona_normal(r);

    for (int k = 0; k < 3; k++)
        c[k] = clampf(c[k] * (all + 0.35f * s * persona_normal(r)), 0.003f,
                      0.95f);
}
/* Any colour: hue anywhere, saturation and brightness within bounds. */
static void persona_any_color(struct random *r, float c[3], float sat, float lo,
                              float hi)
{
    float h = random_float(r, 0, 6),
          s = sat * random_float(r, 0, 1) * random_float(r, 0.3, 1);
    float v = random_float(r, lo, hi);

    for (int k = 0; k < 3; k++) {
        float d = fabsf(fmodf(h + 2 * (float)k, 6) - 3) - 1;
        c[k] = v * lerpf(1, clampf(d, 0, 1), s);
        c[k] = powf(clampf(c[k], 0.01f, 1), 2.2f);
    }
}

static void persona_sample_shape(struct persona *p, uint64_t key, size_t nshape)
{
    struct random r;

    random_init(&r, key, "shape");
    p->nbeta = nshape < PERSONA_SHAPE_MAX ? nshape : PERSONA_SHAPE_MAX;
    for (size_t i = 0; i < p->nbeta; i++)
        p->beta[i] = persona_normal(&r) * (i < 50 ? 0.9f : 0.4f);
}

static const float skin_row[7][3] = {
    { 232, 190, 170 }, { 222, 174, 150 }, { 208, 156, 130 },
    { 186, 132, 104 }, { 150, 102, 76 },  { 110, 72, 54 }, { 78, 51, 41 }
};

/* Tone, blotches, freckles, pores, lips and make-up. */
static void persona_sample_skin(struct persona *p, uint64_t key)
{
    struct random r;
    struct shade_skin *s = &p->skin;

    random_init(&r, key, "skin");
    p->tone = clampf(random_float(&r, 0, 1) * random_float(&r, 0.35, 1.1), 0,
                     1);
    persona_palette(s->base, skin_row, 7, p->tone);
    persona_jitter(&r, s->base, 0.05f);
    for (int k = 0; k < 3; k++)
        s->shift[k] = random_float(&r, 0, 4000) - 2000;
    s->blotch = random_float(&r, 0.06, 0.22);
    s->freckle = random_chance(&r, 0.2) && p->tone < 0.35f
                     ? random_float(&r, 0.2, 0.8)
                     : 0;
    s->pores = random_float(&r, 0.02, 0.055) + 0.04f * p->age;
    s->oil = random_float(&r, 0.4, 1.3);
    s->wrinkle = p->age;
    float red[3] = { 184, 88, 86 }, lip[3], blend = random_float(&r, 0.3, 0.8);
    persona_linear(lip, red);
    for (int k = 0; k < 3; k++)
        s->lip[k] = lerpf(lip[k], s->base[k] * (k ? 0.50f : 0.90f), blend);
    s->gloss = random_float(&r, 0.3, 1.2);
    p->makeup = p->male < 0.5f && random_chance(&r, 0.4)
                    ? random_float(&r, 0.3, 1)
                    : 0;
    if (p->makeup > 0) {
        float stick[3] = { random_float(&r, 130, 210), random_float(&r, 25, 90),
                           random_float(&r, 45, 100) }, c[3];
        persona_linear(c, stick);
        lerp3(s->lip, s->lip, c, p->makeup * 0.75f);
    }
}

static const float hair_row[8][3] = {
    { 18, 15, 14 }, { 34, 25, 20 }, { 52, 37, 27 }, { 82, 58, 40 },
    { 112, 82, 54 }, { 152, 116, 76 }, { 188, 156, 108 }, { 206, 180, 138 }
};

/* A cut by sex, a colour by age and skin. */
static void persona_sample_hair(struct persona *p, uint64_t key)
{
    static const float male[HAIR_STYLES] = { 4, 10, 24, 20, 16, 5, 2, 2, 6, 4,
                                             1, 9 };
    static const float female[HAIR_STYLES] = { 1, 1, 5, 5, 2, 18, 24, 20, 8,
                                               5, 14, 0 };
    struct hair_look *h = &p->hair;
    struct random r;

    random_init(&r, key, "hair");
    float total = 0, pick = random_float(&r, 0, 1);
    const float *odds = p->male > 0.5f ? male : female;
    for (int i = 0; i < HAIR_STYLES; i++)
        total += odds[i];
    for (int i = 0; i < HAIR_STYLES; i++) {
        h->style = (enum hair_style)i;
        pick -= odds[i] / total;
        if (pick < 0)
            break;
    }
    float light = random_float(&r, 0, 1)
                  * clampf(1.15f - 1.8f * p->tone, 0.12f, 1);
    persona_palette(h->color, hair_row, 8, light);
    float red[3], gray[3], rs[3] = { 118, 58, 30 }, gs[3] = { 168, 166, 164 };
    persona_linear(red, rs);
    persona_linear(gray, gs);
    if (random_chance(&r, 0.08) && p->tone < 0.4f)
        lerp3(h->color, h->color, red, random_float(&r, 0.4, 1));
    h->gray = clampf((p->age - 0.55f) * 2.2f * random_float(&r, 0.2, 1.2), 0,
                     0.95f);
    lerp3(h->color, h->color, gray, h->gray);
    persona_jitter(&r, h->color, 0.08f);
    h->spread = random_float(&r, 0.18, 0.4);
    h->gloss = random_float(&r, 0.4, 1.4);
    h->length = random_float(&r, 0.7, 1.35);
    h->volume = random_float(&r, 0.6, 1.4);
    h->curl = random_float(&r, 0, 1);
    h->part = random_chance(&r, 0.35) ? random_float(&r, -0.03, 0.03)
                                      : (random_chance(&r, 0.5) ? 1 : -1)
                                            * random_float(&r, .1, .2);
    h->fringe = random_chance(&r, p->male > 0.5f ? 0.15 : 0.3);
    copy3(p->skin.hair, h->color);
    p->skin.shaved = h->style == HAIR_SHAVED ? random_float(&r, 0.55, 1) : 0;
}

/* A man's beard, moustache and stubble. */
static void persona_sample_beard(struct persona *p, struct random *r)
{
    p->skin.stubble = random_float(r, 0.1, 1) * random_float(r, 0.3, 0.9);
    int kind = (int)random_below(r, 10);
    if (kind < 3) {
        p->beard = random_float(r, 0.5, 1);
        p->moustache = 1;
        p->beard_length = random_float(r, 0.015, 0.05);
        p->skin.stubble = 0.85f;
    } else if (kind < 5) {
        p->beard = p->moustache = random_float(r, 0.3, 0.8);
        p->beard_length = random_float(r, 0.006, 0.014);
        p->skin.stubble = 0.6f;
    } else if (kind == 5) {
        p->moustache = random_float(r, 0.6, 1);
        p->beard_length = random_float(r, 0.02, 0.04);
    }
}

/* Brows, lashes, beard, mouth and glasses. */
static void persona_sample_face(struct persona *p, uint64_t key)
{
    struct random r;

    random_init(&r, key, "face");
    p->brow_weight = random_float(&r, 0.5, 1) * lerpf(0.75f, 1.1f, p->male);
    p->brow_arch = random_float(&r, -0.3, 1);
    for (int k = 0; k < 3; k++) {
        float c = lerpf(p->hair.color[k], 0.02f, 0.35f);
        p->brow_color[k] = p->skin.brow[k] = c;
        p->beard_color[k] = p->hair.color[k] * 0.9f;
    }
    p->lash = random_float(&r, 0.5, 0.9) + (p->male < 0.5f ? 0.5f : 0)
              * random_float(&r, 0.3, 1);
    if (p->male > 0.5f)
        persona_sample_beard(p, &r);
    float yellow = random_float(&r, 0, 0.25);
    float tooth[3] = { 0.74f, 0.69f - 0.1f * yellow, 0.58f - 0.5f * yellow };
    float gum[3] = { 0.40f, 0.12f, 0.12f }, tongue[3] = { 0.42f, .13f, .13f };
    copy3(p->tooth, tooth);
    copy3(p->gum, gum);
    copy3(p->tongue, tongue);
    p->glasses = random_chance(&r, 0.2)
                     ? (enum glasses)(GLASSES_ROUND + random_below(&r, 3))
                     : GLASSES_NONE;
    p->frame_width = p->glasses == GLASSES_THIN ? random_float(&r, 0.006, 0.009)
                                     : random_float(&r, 0.01, 0.024);
    if (random_chance(&r, 0.6))
        p->frame_color[0] = p->frame_color[1] = p->frame_color[2] = 0.015f;
    else
        persona_any_color(&r, p->frame_color, 0.8f, 0.1f, 0.6f);
}

static const float iris_row[7][3] = {
    { 58, 36, 22 }, { 84, 54, 30 }, { 116, 82, 44 }, { 112, 106, 62 },
    { 98, 118, 98 }, { 104, 132, 148 }, { 88, 124, 164 }
};

/* Iris from dark to light, darker with darker skin. */
static void persona_sample_eyes(struct persona *p, uint64_t key)
{
    struct random r;
    struct shade_eye *e = &p->eye;

    random_init(&r, key, "eyes");
    float t = p->tone > 0.4f || random_chance(&r, 0.4)
                  ? random_float(&r, 0, 0.3)
                  : random_float(&r, 0.2, 1);
    persona_palette(e->iris, iris_row, 7, t);
    persona_jitter(&r, e->iris, 0.12f);
    for (int k = 0; k < 3; k++) {
        e->ring[k] = e->iris[k] * (k == 0 ? 0.6f : 0.65f);
        e->shift[k] = random_float(&r, 0, 4000) - 2000;
    }
    e->iris_radius = random_float(&r, 0.47, 0.53);
    e->pupil = random_float(&r, 0.15, 0.27);
    float white = random_float(&r, 0.62, 0.78);
    e->white[0] = white;
    e->white[1] = white * 0.95f;
    e->white[2] = white * 0.92f;
    e->vein = random_float(&r, 0.2, 1);
}

/* Collar, weave and colours, and the shoulders under them. */
static void persona_sample_clothes(struct persona *p, uint64_t key)
{
    struct random r;
    struct shade_cloth *c = &p->cloth;

    random_init(&r, key, "clothes");
    p->collar = (enum collar)random_below(&r, COLLARS);
    if (p->collar == COLLAR_WIDE && p->male > 0.5f)
        p->collar = COLLAR_CREW;
    *c = (struct shade_cloth){ .weave = CLOTH_PLAIN };
    if (random_chance(&r, 0.5))
        c->weave = (enum cloth_weave)random_below(&r, CLOTH_WEAVES);
    if (c->weave == CLOTH_PLAID && p->collar != COLLAR_SHIRT)
        c->weave = CLOTH_KNIT;
    persona_any_color(&r, c->base, random_chance(&r, 0.5) ? 0.25f : 0.9f, 0.08f,
                      0.85f);
    persona_any_color(&r, c->second, 0.7f, 0.1f, 0.9f);
    if (c->weave == CLOTH_PLAIN || c->weave == CLOTH_KNIT)
        for (int k = 0; k < 3; k++)
            c->second[k] = c->base[k] * 1.25f;
    c->scale = c->weave == CLOTH_KNIT ? random_float(&r, 9, 16)
                                      : random_float(&r, 4, 9);
    c->bump = random_float(&r, 0.15, 0.45);
    c->gloss = random_float(&r, 0, 0.15);
    c->grain = random_float(&r, 0.02, 0.12);
    for (int k = 0; k < 3; k++)
        c->shift[k] = random_float(&r, 0, 4000) - 2000;
    p->shoulder = random_float(&r, 0.95, 1.1) * lerpf(0.98f, 1.16f, p->male);
    p->build = random_float(&r, 0.85, 1.2);
}

/* A direction to a lamp: azimuth 0 is straight ahead. */
static void persona_light_direction(float dir[3], float azimuth, float height)
{
    dir[0] = sinf(azimuth) * cosf(height);
    dir[1] = -sinf(height);
    dir[2] = -cosf(azimuth) * cosf(height);
}

/* Warm to cool white of the given brightness. */
static void persona_white_light(float rgb[3], float warmth, float power)
{
    rgb[0] = power * (1 + 0.22f * warmth);
    rgb[1] = power;
    rgb[2] = power * (1 - 0.30f * warmth);
}

/* Scale all light so that a face to the camera receives `want`: what a
 * camera's exposure does. */
static void persona_meter(struct shade_env *e, float want)
{
    float got = 0.7f * e->cube[4][1] + 0.15f * (e->cube[0][1] + e->cube[1][1]);

    for (int i = 0; i < SHADE_LIGHTS; i++) {
        const float *d = e->light[i].dir;
        float face = fmaxf(-0.85f * d[2] - 0.25f * d[1] + 0.3f * fabsf(d[0]),
                           0);
        got += e->light[i].rgb[1] * face;
    }
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < SHADE_LIGHTS; i++)
            e->light[i].rgb[k] *= want / got;
        for (int i = 0; i < 6; i++)
            e->cube[i][k] *= want / got;
    }
}

/* A direction from within a range of heights, then sideways: to `side`, or to
 * either side (0). */
static void persona_sample_direction(float dir[3], struct random *r, float side,
                                     double from, double to, double low,
                                     double high)
{
    const float height = random_float(r, low, high);

    if (side == 0)
        side = random_chance(r, 0.5) ? 1 : -1;
    persona_light_direction(dir, side * random_float(r, from, to), height);
}

/* The light that comes back from the room, by its six sides. */
static void persona_sample_room(struct shade_env *e, struct random *r)
{
    static const float faces[6] = { 0.9f, 0.9f, 1.5f, 0.5f, 1.1f, 0.8f };
    const float amb = random_float(r, 0.2, 0.6);
    const float warm = random_float(r, -0.6, 0.6);

    for (int k = 0; k < 6; k++) {
        const float power = amb * faces[k] * random_float(r, 0.7, 1.3);

        persona_white_light(e->cube[k], warm + random_float(r, -0.2, 0.2),
                            power);
    }
    /* -y is up: the sky; +y gives back the warm floor and the clothes */
    persona_white_light(e->cube[3], warm + 0.4f,
                        amb * random_float(r, 0.25, 0.6));
}

/* A key light, a fill from the other side, often a rim from behind, and the
 * room about them. */
static void persona_sample_light(struct persona *p, struct random *r)
{
    struct shade_env *e = &p->env;
    float side = random_chance(r, 0.5) ? 1 : -1,
          key = random_float(r, 0.5, 2.1);
    const bool studio = random_chance(r, 0.35);
    float power;

    persona_sample_direction(e->light[0].dir, r, side, 0.1,
                             studio ? 0.7 : 1.35, 0.15, 1.0);
    persona_white_light(e->light[0].rgb, random_float(r, -0.5, 0.9), key);
    persona_sample_direction(e->light[1].dir, r, -side, 0.4, 1.4, -0.1, 0.6);
    power = key * random_float(r, 0, .45);
    persona_white_light(e->light[1].rgb, random_float(r, -0.8, 0.5), power);
    persona_sample_direction(e->light[2].dir, r, 0, 2.1, 2.7, 0.1, 0.7);
    power = random_chance(r, 0.5) ? key * random_float(r, 0.2, 1.2) : 0;
    persona_white_light(e->light[2].rgb, random_float(r, -0.8, 0.8), power);
    persona_sample_room(e, r);
    persona_meter(e, (1.0f + 0.3f * p->tone) * expf(persona_normal(r) * 0.16f));
}

void persona_relight(struct persona *p, int k)
{
    struct random r;

    random_init(&r, p->key + (uint64_t)k * 77, "sheet light");
    persona_sample_light(p, &r);
    persona_light_direction(p->env.light[0].dir, -1.4f + 2.8f * (float)k / 11,
                            k % 3 == 2 ? 0.1f : 0.5f);
}

/* What the camera does, as much of it as effects says. */
static void persona_sample_lens(struct persona *p, uint64_t key, float effects)
{
    struct random r;
    struct lens_look *l = &p->lens;

    random_init(&r, key, "lens");
    *l = (struct lens_look){ .gamma = 1, .contrast = 1, .low = 1,
                             .exposure = 1, .saturation = 1,
                             .balance = { 1, 1, 1 } };
    float e = effects, warm = persona_normal(&r) * 0.06f * e;
    l->exposure = expf(persona_normal(&r) * 0.16f * e);
    l->gamma = expf(persona_normal(&r) * 0.08f * e);
    l->contrast = 1 + 0.10f * e * persona_normal(&r);
    l->saturation = clampf(0.92f + 0.13f * e * persona_normal(&r), 0.3f, 1.3f);
    l->balance[0] = expf(warm);
    l->balance[2] = expf(-warm + persona_normal(&r) * 0.03f * e);
    l->noise = random_float(&r, 0, 1) * random_float(&r, 0, 0.03) * e;
    l->blur = random_chance(&r, 0.3) ? random_float(&r, 0, 0.9) * e : 0;
    l->vignette = random_float(&r, 0, 0.35) * e;
    l->shutter = random_chance(&r, 0.4) ? random_float(&r, 0, 0.03) * e : 0;
    l->jpeg = random_chance(&r, 0.45 * e) ? (int)random_float(&r, 45, 95) : 0;
    l->low = random_chance(&r, 0.15 * e) ? random_float(&r, 0.4, 0.8) : 1;
    l->occluder = OCCLUDER_NONE;
    if (random_chance(&r, 0.10 * e))
        l->occluder = (enum occluder)(OCCLUDER_HAND + random_below(&r, 3));
}

void persona_sample(struct persona *p, uint64_t seed, uint64_t index,
                   size_t nshape, float effects)
{
    struct random r;

    memset(p, 0, sizeof *p);
    random_init(&r, seed, "synth.person");
    p->key = random_mix(r.key ^ random_mix(index));
    random_init(&r, p->key, "kind");
    p->age = random_float(&r, 0, 1) * random_float(&r, 0.3, 1);
    p->male = random_chance(&r, 0.5) ? random_float(&r, 0.6, 1)
                                     : random_float(&r, 0, 0.4);
    persona_sample_shape(p, p->key, nshape);
    persona_sample_skin(p, p->key);
    persona_sample_hair(p, p->key);
    persona_sample_face(p, p->key);
    persona_sample_eyes(p, p->key);
    persona_sample_clothes(p, p->key);
    random_init(&r, p->key, "light");
    persona_sample_light(p, &r);
    persona_sample_lens(p, p->key, effects);
    random_init(&r, p->key, "framing");
    p->backdrop = (enum scenery)random_below(&r, SCENERIES);
    persona_any_color(&r, p->wall, 0.4f, 0.3f, 1.0f);
    persona_any_color(&r, p->accent, 0.8f, 0.1f, 0.9f);
    p->rest[0] = persona_normal(&r) * 0.06f;
    p->rest[1] = persona_normal(&r) * 0.05f - 0.02f;
    p->rest[2] = clampf(11.2f * expf(persona_normal(&r) * 0.12f), 8.6f, 14.5f);
    p->yaw = persona_normal(&r) * 0.14f;
    p->pitch = persona_normal(&r) * 0.07f;
    p->roll = persona_normal(&r) * 0.05f;
    p->lively = random_float(&r, 0.7, 1.25);
}
