/* Each trait from a sequence of its own, named by what it is. */
#include "lib/lab/people/scan_person.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/vec.h"

static float person_normal(struct random *r, float limit)
{
    return clampf((float)random_normal(r), -limit, limit);
}
/* One of n, or -1 with the chance of none. */
static int person_one_of(struct random *r, size_t n, double none)
{
    bool without = random_chance(r, none);
    uint32_t k = random_below(r, n ? (uint32_t)n : 1);

    return without || !n ? -1 : (int)k;
}
/* sRGB 0..255 to linear light, scaled by 1 +- s as a whole and by channel. */
static void person_color(struct random *r, float out[3], const float srgb[3],
                         float s)
{
    float all = 1 + s * person_normal(r, 2);

    for (int k = 0; k < 3; k++) {
        float v = srgb[k] / 255;
        v = v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
        out[k] = clampf(v * (all + 0.3f * s * person_normal(r, 2)), 0.002f,
                        0.95f);
    }
}
/* Any colour: hue anywhere, saturation and brightness within bounds. */
static void person_any_color(struct random *r, float c[3], float sat, float lo,
                             float hi)
{
    float h = random_float(r, 0, 6), s = sat * random_float(r, 0, 1),
          v = random_float(r, lo, hi);

    for (int k = 0; k < 3; k++) {
        float d = fabsf(fmodf(h + 2 * (float)k, 6) - 3) - 1;
        c[k] = powf(clampf(v * lerpf(1, clampf(d, 0, 1), s), 0.02f, 1), 2.2f);
    }
}

/* Components of the photographs' skin statistics, and a tone. */
static void person_draw_skin(struct scan_person *p)
{
    struct random r;
    struct skin_look *s = &p->skin;

    random_init(&r, p->key, "skin");
    for (int k = 0; k < SKIN_PARTS; k++)
        s->z[k] = person_normal(&r, 2.2f);
    s->key = random_u64(&r);
    /* darker people are rarer in the photographs than in the world */
    s->tone = 0.16f * person_normal(&r, 2);
    if (random_chance(&r, 0.25))
        s->tone -= random_float(&r, 0.2, 1.1);
    s->red = 0.5f * person_normal(&r, 2);
    s->age = p->age;
    s->grain = random_float(&r, 0.6, 1.2) + 0.4f * p->age;
    s->freckle = random_chance(&r, 0.15) && s->tone > -0.3f
                     ? random_float(&r, 0.3, 1)
                     : 0;
    s->mole = random_chance(&r, 0.5) ? random_float(&r, 0.2, 1) : 0;
    s->stubble = p->male > 0.5f && random_chance(&r, 0.6)
                     ? random_float(&r, 0.1, 0.8)
                     : 0;
    bool made_up = p->male < 0.5f && random_chance(&r, 0.45);
    float stick[3] = {random_float(&r, 120, 210), random_float(&r, 20, 100),
                      random_float(&r, 40, 110)};
    float lid[3] = {random_float(&r, 40, 170), random_float(&r, 30, 120),
                    random_float(&r, 30, 140)};
    person_color(&r, s->lip, stick, 0.05f);
    person_color(&r, s->lid, lid, 0.05f);
    s->lipstick = made_up ? random_float(&r, 0.2, 0.9) : 0;
    s->shadow = made_up && random_chance(&r, 0.5) ? random_float(&r, 0.15, 0.7)
                                                  : 0;
    s->blush = made_up ? random_float(&r, 0, 0.5) : 0;
    p->gloss = random_float(&r, 0.5, 1.5);
    p->wet = random_float(&r, 0.6, 1.6) + (made_up ? 0.8f : 0);
}

static const float hair_rows[9][3] = {
    {20, 17, 16}, {30, 24, 21}, {44, 32, 25}, {62, 44, 33}, {86, 60, 42},
    {118, 86, 58}, {160, 124, 84}, {192, 162, 116}, {120, 56, 30}
};

/* Whether hair hangs over a brow of a face seen about from the front: most
 * faces in photographs show both. */
static bool person_hides_brow(const struct piece *hair,
                              const struct scan_face *face)
{
    uint64_t front = 0;
    int hidden = 0;

    for (int k = 0; k < SKY_DIRECTIONS; k++) {
        float d[3];

        sky_direction(d, k);
        if (d[2] > 0.9f)
            front |= (uint64_t)1 << k;
    }
    for (int k = 17; k < 27; k++) {
        hidden += (hair->shade[face->landmark[k]] & front) != 0;
    }
    return hidden > 1;
}

/* The darker the skin, the darker the hair, mostly; gray by age, and dyed now
 * and then. */
static void person_draw_hair_color(struct scan_person *p, struct random *r)
{
    const float gray[3] = {0.42f, 0.41f, 0.40f};
    int rows = p->skin.tone < -0.5f && random_chance(r, 0.85) ? 3 : 9;

    person_color(r, p->hair_color, hair_rows[random_below(r, (uint32_t)rows)],
                 0.12f);
    p->hair_gray = random_chance(r, p->age * 0.9)
                       ? random_float(r, 0.1, 1) * p->age
                       : 0;
    if (random_chance(r, 0.04))
        person_any_color(r, p->hair_color, 0.9f, 0.3f, 0.8f);
    lerp3(p->hair_color, p->hair_color, gray, p->hair_gray);
    p->hair_gloss = random_float(r, 0.3, 1.3);
}

/* Brows of the photographs' kinds, a little uneven. */
static void person_draw_brows(struct scan_person *p)
{
    struct random r;

    random_init(&r, p->key, "brows");
    p->brow_weight = random_float(&r, 0.55, 1.0);
    for (int k = 0; k < BROW_PARTS; k++) {
        float both = person_normal(&r, 2);

        for (int e = 0; e < 2; e++)
            p->brow[e][k] = both + 0.3f * person_normal(&r, 2);
    }
}

/* Beard and moustache, in the brows' colour, which is the hair's. */
static void person_draw_beard(struct scan_person *p, struct random *r)
{
    for (int k = 0; k < 3; k++)
        p->brow_color[k] = clampf(p->hair_color[k], 0.004f, 0.11f)
                           * random_float(r, 0.5, 0.9);
    p->beard = p->male > 0.5f && random_chance(r, 0.35)
                   ? random_float(r, 0.3, 1)
                   : 0;
    p->moustache = p->male > 0.5f
                           && random_chance(r, p->beard > 0 ? 0.85 : 0.08)
                       ? random_float(r, 0.4, 1)
                       : 0;
    p->beard_length = random_float(r, 0.1, 1);
}

/* Colour, cut, hat, brows and beard. */
static void person_draw_hair(struct scan_person *p, const struct scan_assets *a)
{
    struct random r;

    random_init(&r, p->key, "hair");
    person_draw_hair_color(p, &r);
    p->hair = person_one_of(&r, a->hair.n, p->male > 0.5f ? 0.12 : 0.02);
    /* long hair and short hair change hands now and then */
    for (int k = 0; k < 12 && p->hair >= 0; k++) {
        const struct piece *q = &a->hair.piece[p->hair];
        bool is_short = !strncmp(q->name, "short", 5);
        if ((is_short == (p->male > 0.5f) || random_chance(&r, 0.15))
            && (!person_hides_brow(q, &a->face) || random_chance(&r, 0.05)))
            break;
        p->hair = person_one_of(&r, a->hair.n, 0);
    }
    p->buzz = p->hair < 0 ? random_float(&r, 0, 1) : 0;
    p->hat = person_one_of(&r, a->hat.n, 0.955);
    p->cap = p->hat < 0 && random_chance(&r, 0.05)
                 ? 1 + (int)random_below(&r, 2)
                 : 0;
    if (p->hat >= 0 || p->cap)
        p->hair = p->male > 0.5f || random_chance(&r, 0.3) ? -1 : p->hair;
    person_any_color(&r, p->cap_color, 0.8f, 0.1f, 0.9f);
    person_draw_beard(p, &r);
}

/* Irises, lashes, teeth, glasses and what is worn. */
static void person_draw_features(struct scan_person *p,
                                 const struct scan_assets *a)
{
    struct random r;

    random_init(&r, p->key, "features");
    p->iris = person_one_of(&r, a->niris, 0);
    p->iris_size = random_float(&r, 0.94, 1.06);
    /* most of the world's eyes are brown; the pictures' are mostly blue */
    float brown[3] = {random_float(&r, 50, 110), random_float(&r, 32, 62),
                      random_float(&r, 14, 34)};
    person_color(&r, p->iris_tint, brown, 0.1f);
    if (!random_chance(&r, p->skin.tone < -0.4f ? 0.95 : 0.6))
        p->iris_tint[0] = -1;   /* as pictured */
    p->lash = random_float(&r, 0.35, 0.9) + (p->skin.lipstick > 0 ? 0.4f : 0);
    float t = random_float(&r, 0, 1);
    p->tooth[0] = lerpf(0.68f, 0.80f, t);
    p->tooth[1] = lerpf(0.60f, 0.77f, t);
    p->tooth[2] = lerpf(0.44f, 0.70f, t);
    p->gum[0] = random_float(&r, 0.36, 0.48);
    p->gum[1] = random_float(&r, 0.12, 0.19);
    p->gum[2] = random_float(&r, 0.12, 0.18);
    p->glasses = random_chance(&r, 0.2)
                     ? (enum glasses)(GLASSES_ROUND + random_below(&r, 3))
                     : GLASSES_NONE;
    if (random_chance(&r, 0.012))
        p->glasses = GLASSES_SUN;
    person_any_color(&r, p->glass_color, 0.5f, 0.05f, 0.5f);
    if (random_chance(&r, 0.5))
        p->glass_color[0] = p->glass_color[1] = p->glass_color[2] = 0.02f;
    p->earring = p->male < 0.5f && random_chance(&r, 0.3);
    p->cloth = person_one_of(&r, a->cloth.n, 0);
    p->cloth_own = random_chance(&r, 0.3);
    person_any_color(&r, p->cloth_color, 0.8f, 0.08f, 0.92f);
}

/* Exposure, colour, blur, noise and codec; all but the first weaker where
 * effects is, and none at 0.  A poor camera is poor in all of them, and most
 * are good; white is missed towards amber or blue. */
static void person_draw_picture(struct scan_camera *c, struct random *r,
                                float effects)
{
    const float e = effects;
    float poor = random_float(r, 0, 1), white;

    poor *= poor;
    c->exposure = random_float(r, 0.72, 1.28);
    c->contrast = 1 + e * 0.14f * person_normal(r, 2);
    c->saturation = 1 + e * 0.14f * person_normal(r, 2);
    white = person_normal(r, 2);
    for (int k = 0; k < 3; k++)
        c->balance[k] = 1 + e * (0.07f * (float)(1 - k) * white
                                 + 0.02f * person_normal(r, 2));
    c->blur = random_chance(r, 0.5)   ? e * random_float(r, 0, 0.5)
              : random_chance(r, 0.4) ? e * lerpf(0.3f, 1.6f, poor)
                                      : 0;
    c->sharpen = random_chance(r, 0.4) ? e * random_float(r, 0.2, 0.9) : 0;
    c->shutter = e * (random_chance(r, 0.6) ? random_float(r, 0, 0.012)
                                            : random_float(r, 0.01, 0.035));
    c->noise = e * random_float(r, 0.001, 0.006 + 0.029 * (double)poor);
    c->vignette = e * (random_chance(r, 0.4) ? random_float(r, 0, 0.5) : 0);
    c->low = e > 0 && random_chance(r, 0.35) ? lerpf(0.9f, 0.35f, poor) : 1;
    c->jpeg = e > 0 && random_chance(r, 0.5)
                  ? (int)lerpf(96, 30, poor * random_float(r, 0.5, 1)) : 0;
    c->codec = e > 0 && random_chance(r, 0.4)
                   ? (int)lerpf(20, 36, poor * random_float(r, 0.5, 1)) : 0;
    c->drift = e * (random_chance(r, 0.4) ? random_float(r, 0, 1) : 0);
}

/* Where the camera is, what its pictures are like, and what is behind and
 * before the person. */
static void person_draw_camera(struct scan_person *p, bool far_only,
                               float effects)
{
    struct random r;
    struct scan_camera *c = &p->camera;

    random_init(&r, p->key, "camera");
    float far = random_float(&r, 0, 1);
    p->rest[2] = 12 * expf(0.28f * person_normal(&r, 2) + 0.04f);
    c->distance = p->rest[2];
    if (far_only)
        ;
    else if (far < 0.45f)            /* an arm's length, or a desk's */
        c->distance = minf(c->distance, 5 * random_float(&r, 0.32, 1.6));
    else if (far < 0.5f)        /* a telephone at 15 to 32 cm from the face */
        c->distance = 5 * random_float(&r, 0.24, 0.36);
    p->rest[0] = 0.13f * person_normal(&r, 2) * p->rest[2] / 12;
    p->rest[1] = (0.10f * person_normal(&r, 2) - 0.02f) * p->rest[2] / 12;
    person_draw_picture(c, &r, effects);
    c->depth = random_chance(&r, 0.8) ? random_float(&r, 0.2, 1) : 0.05f;
    c->backdrop = random_chance(&r, 0.72) ? BACKDROP_ROOM : BACKDROP_WALL;
    c->view = random_float(&r, 0.35, 1.15);
    c->tilt = 0.12f * person_normal(&r, 2);
    person_any_color(&r, c->wall, random_chance(&r, 0.5) ? 0.12f : 0.7f, 0.15f,
                     0.95f);
    p->front = FRONT_NONE;
    if (effects > 0 && random_chance(&r, 0.09))
        p->front = random_chance(&r, 0.6) ? FRONT_HAND
                   : random_chance(&r, 0.5) ? FRONT_MICROPHONE : FRONT_CUP;
}

static void person_draw_light(struct scan_person *p,
                              const struct scan_assets *a)
{
    struct random r;

    random_init(&r, p->key, "light");
    p->light = person_one_of(&r, a->nlight, 0);
    p->turn = random_float(&r, 0, 6.2831853);
    for (int k = 0; k < 3; k++)
        p->gain[k] = 1;
}

/* Mean identity, hundredths of a deviation: half of what makes resting faces
 * of the scans, as a landmarker sees them, as wide, as long and as wide of mouth
 * as those of the 82 calm photographs (least squares, ridge 0.02); half, since
 * 82 people are few. */
static const int8_t mean_identity[SCAN_IDENTITIES] = {
    -8, 6, 15, -13, -7, -32, 5, -17, 14, 1, 14, 13, -5, 4, -27, 3, -6, -2, 3,
    -4, 3, -4, 1, -2, -9, -1, -2, -7, -1, -1, -7, -5, 3, -3, 5, 2, 5, 2, 3,
    -4, -7, 4, 9, -1, 4, -2, -1, 3, -4, -3, 0, 1, -1, -1, -3, -1, 0, 1, -1, 0,
    1, -3, 4, -1, 2, -1, 1, 0, 4, 3, -2, 0, -2, 0, -3, 1, 0, -4, 3, -2, 1, -2,
    2, 1, 2, -1, 1, 1, 1, 1, -1, 0, 1, -1, 0, 0, 0, -1, -1, 0
};

/* Height between upper and lower lip of a shape (FACE_VERTICES,3): at the
 * middle, and the mean beside it. */
static void person_lip_gap(float gap[2], const float *x, const int32_t *lmk)
{
    float at[3];

    for (int k = 0; k < 3; k++)
        at[k] = x[3 * lmk[61 + k] + 1] - x[3 * lmk[67 - k] + 1];
    gap[0] = at[1];
    gap[1] = 0.5f * (at[0] + at[2]);
}

/* The nearest identity whose resting lips are `gap` apart: identities alone
 * leave every other mouth ajar. */
static void person_close_lips(float *beta, const struct scan_face *f, float gap)
{
    const int32_t *lmk = f->landmark;
    float way[SCAN_IDENTITIES][2], lack[2], a = 0, b = 0, c = 0;

    person_lip_gap(lack, f->neutral, lmk);
    for (size_t k = 0; k < SCAN_IDENTITIES; k++) {
        float *w = way[k];

        person_lip_gap(w, f->identity + 3 * FACE_VERTICES * k, lmk);
        lack[0] += w[0] * beta[k];
        lack[1] += w[1] * beta[k];
        a += w[0] * w[0];
        b += w[0] * w[1];
        c += w[1] * w[1];
    }
    lack[0] = gap - lack[0];
    lack[1] = gap - lack[1];
    float det = a * c - b * b;
    float u = (c * lack[0] - b * lack[1]) / det;
    float v = (a * lack[1] - b * lack[0]) / det;
    for (size_t k = 0; k < SCAN_IDENTITIES; k++)
        beta[k] += u * way[k][0] + v * way[k][1];
}

/* The scans' components, with the proportions of people in photographs. */
static void person_draw_shape(struct scan_person *p,
                              const struct scan_face *f)
{
    struct random r;

    random_init(&r, p->key, "shape");
    for (int k = 0; k < SCAN_IDENTITIES; k++)
        p->beta[k] = 0.01f * mean_identity[k] + person_normal(&r, 2.5f);
    person_close_lips(p->beta, f, random_float(&r, 0, 0.001));
}

/* How lively, how talkative, how far they turn. */
static void person_draw_act(struct scan_person *p)
{
    struct random r;
    struct act_look *l = &p->act;

    random_init(&r, p->key, "act");
    l->key = random_u64(&r);
    l->lively = random_float(&r, 0.5, 1.25);
    l->turn = random_chance(&r, 0.35) ? random_float(&r, 0.5, 1.05)
                                      : random_float(&r, 0.15, 0.6);
    l->yaw = 0.35f * l->turn * person_normal(&r, 2);
    l->pitch = 0.07f * person_normal(&r, 2);
    l->roll = 0.05f * person_normal(&r, 2);
    l->lean = person_normal(&r, 2) * 0.4f;
    l->talk = random_chance(&r, 0.6) ? random_float(&r, 0.2, 0.9) : 0;
}

void scan_person_draw(struct scan_person *p, const struct scan_assets *a,
                      uint64_t seed, uint64_t index, float effects)
{
    struct random r;

    memset(p, 0, sizeof *p);
    p->key = random_mix(random_mix(seed ^ random_name("scan person")) + index);
    random_init(&r, p->key, "who");
    p->male = random_float(&r, 0, 1);
    p->age = random_float(&r, 0, 1) * random_float(&r, 0.4, 1);
    person_draw_shape(p, &a->face);
    person_draw_skin(p);
    person_draw_hair(p, a);
    person_draw_brows(p);
    person_draw_features(p, a);
    person_draw_light(p, a);
    person_draw_act(p);
    person_draw_camera(p, a->plain, effects);
}
