/* Each trait from a sequence of its own, named by what it is. */
#include "lib/lab/people/scan_person.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/vec3.h"

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

    for (int k = 0; k < 3; k++)
        out[k] = clampf(srgb_decode(srgb[k]) *
                            (all + 0.3f * s * person_normal(r, 2)),
                        0.002f, 0.95f);
}
/* Ranges of three channels, drawn. */
static void person_ranges(struct random *r, float c[3], const double t[3][2])
{
    for (int k = 0; k < 3; k++)
        c[k] = trait_range(r, t[k]);
}
/* About 0 by a spread. */
static float person_spread(struct random *r, float spread)
{
    return spread * person_normal(r, 2);
}
/* Any colour: hue anywhere, saturation and brightness within t's bounds. */
static void person_any_color(struct random *r, float c[3], const float t[3])
{
    float h = random_float(r, 0, 6), s = t[0] * random_float(r, 0, 1),
          v = random_float(r, (double)t[1], (double)t[2]);

    for (int k = 0; k < 3; k++) {
        float d = fabsf(fmodf(h + 2 * (float)k, 6) - 3) - 1;
        c[k] = powf(clampf(v * lerpf(1, clampf(d, 0, 1), s), 0.02f, 1), 2.2f);
    }
}

/* Components of the photographs' skin statistics, and a tone. */
static void person_draw_skin(struct scan_person *p, const struct traits *t)
{
    struct random r;
    struct skin_look *s = &p->skin;
    float stick[3], lid[3];

    random_init(&r, p->key, "skin");
    for (int k = 0; k < SKIN_PARTS; k++)
        s->z[k] = person_normal(&r, t->skin_part_limit);
    s->key = random_u64(&r);
    /* darker people are rarer in the photographs than in the world */
    s->tone = person_spread(&r, t->skin_tone);
    s->tone -= trait_maybe(&r, t->skin_darker);
    s->red = person_spread(&r, t->skin_red);
    s->age = p->age;
    s->grain = trait_range(&r, t->skin_grain) + t->skin_grain_age * p->age;
    s->freckle = random_chance(&r, t->freckle[0]) && s->tone > t->freckle_tone
                     ? trait_range(&r, t->freckle + 1) : 0;
    s->mole = trait_maybe(&r, t->mole);
    s->stubble = p->male > 0.5f ? trait_maybe(&r, t->stubble) : 0;
    bool made_up = p->male < 0.5f && random_chance(&r, t->made_up);
    person_ranges(&r, stick, t->lipstick_rgb);
    person_ranges(&r, lid, t->lid_rgb);
    person_color(&r, s->lip, stick, t->made_up_spread);
    person_color(&r, s->lid, lid, t->made_up_spread);
    s->lipstick = made_up ? trait_range(&r, t->lipstick) : 0;
    s->shadow = made_up ? trait_maybe(&r, t->lid) : 0;
    s->blush = made_up ? trait_range(&r, t->blush) : 0;
    p->gloss = trait_range(&r, t->gloss);
    p->wet = trait_range(&r, t->wet) + (made_up ? t->made_up_wet : 0);
}

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
static void person_draw_hair_color(struct scan_person *p, struct random *r,
                                   const struct traits *t)
{
    bool dark = p->skin.tone < t->hair_dark_tone
                && random_chance(r, t->hair_dark);

    person_color(r, p->hair_color, t->hair_rgb[random_below(r, dark ? 3 : 9)],
                 t->hair_spread);
    p->hair_gray = random_chance(r, (double)p->age * t->hair_gray_age)
                       ? trait_range(r, t->hair_gray) * p->age : 0;
    if (random_chance(r, t->hair_dyed))
        person_any_color(r, p->hair_color, t->hair_dyed_color);
    lerp3(p->hair_color, p->hair_color, t->hair_gray_linear, p->hair_gray);
    p->hair_gloss = trait_range(r, t->hair_gloss);
}

/* Brows of the photographs' kinds, a little uneven. */
static void person_draw_brows(struct scan_person *p, const struct traits *t)
{
    struct random r;

    random_init(&r, p->key, "brows");
    p->brow_weight = trait_range(&r, t->brow_weight);
    for (int k = 0; k < BROW_PARTS; k++) {
        float both = person_normal(&r, 2);

        for (int e = 0; e < 2; e++)
            p->brow[e][k] = both + person_spread(&r, t->brow_uneven);
    }
}

/* Beard and moustache, in the brows' colour, which is the hair's. */
static void person_draw_beard(struct scan_person *p, struct random *r,
                              const struct traits *t)
{
    const bool male = p->male > 0.5f;

    for (int k = 0; k < 3; k++)
        p->brow_color[k] = clampf(p->hair_color[k], t->brow_linear[0],
                                  t->brow_linear[1])
                           * trait_range(r, t->brow_shade);
    p->beard = male ? trait_maybe(r, t->beard) : 0;
    p->moustache = male && random_chance(r, t->moustache[p->beard <= 0])
                       ? trait_range(r, t->moustache_size) : 0;
    p->beard_length = trait_range(r, t->beard_length);
}

/* Colour, cut, hat, brows and beard. */
static void person_draw_hair(struct scan_person *p, const struct scan_assets *a)
{
    const struct traits *t = &a->traits;
    const bool male = p->male > 0.5f;
    struct random r;

    random_init(&r, p->key, "hair");
    person_draw_hair_color(p, &r, t);
    p->hair = person_one_of(&r, a->hair.n, t->hair_none[!male]);
    /* long hair and short hair change hands now and then */
    for (int k = 0; k < 12 && p->hair >= 0; k++) {
        const struct piece *q = &a->hair.piece[p->hair];
        bool is_short = !strncmp(q->name, "short", 5);
        if ((is_short == male || random_chance(&r, t->hair_unusual))
            && (!person_hides_brow(q, &a->face)
                || random_chance(&r, t->hair_over_brow)))
            break;
        p->hair = person_one_of(&r, a->hair.n, 0);
    }
    p->buzz = p->hair < 0 ? random_float(&r, 0, 1) : 0;
    p->hat = person_one_of(&r, a->hat.n, t->hat_none);
    p->cap = p->hat < 0 && random_chance(&r, t->cap)
                 ? 1 + (int)random_below(&r, 2) : 0;
    if (p->hat >= 0 || p->cap)
        p->hair = male || random_chance(&r, t->cap_hides_hair) ? -1 : p->hair;
    person_any_color(&r, p->cap_color, t->cap_color);
    person_draw_beard(p, &r, t);
}

/* Irises, lashes, teeth, glasses and what is worn. */
static void person_draw_features(struct scan_person *p,
                                 const struct scan_assets *a)
{
    const struct traits *t = &a->traits;
    struct random r;
    float brown[3];

    random_init(&r, p->key, "features");
    p->iris = person_one_of(&r, a->niris, 0);
    p->iris_size = trait_range(&r, t->iris_size);
    /* most of the world's eyes are brown; the pictures' are mostly blue */
    person_ranges(&r, brown, t->brown_rgb);
    person_color(&r, p->iris_tint, brown, t->brown_spread);
    if (!random_chance(&r, t->brown[p->skin.tone >= t->brown_tone]))
        p->iris_tint[0] = -1;   /* as pictured */
    p->lash = trait_range(&r, t->lash)
              + (p->skin.lipstick > 0 ? t->made_up_lash : 0);
    lerp3(p->tooth, t->tooth_linear[0], t->tooth_linear[1],
          random_float(&r, 0, 1));
    person_ranges(&r, p->gum, t->gum);
    p->glasses = random_chance(&r, t->glasses)
                     ? (enum glasses)(GLASSES_ROUND + random_below(&r, 3))
                     : GLASSES_NONE;
    if (random_chance(&r, t->sunglasses))
        p->glasses = GLASSES_SUN;
    person_any_color(&r, p->glass_color, t->glasses_color);
    if (random_chance(&r, t->glasses_black))
        p->glass_color[0] = p->glass_color[1] = p->glass_color[2] = 0.02f;
    p->earring = p->male < 0.5f && random_chance(&r, t->earring);
    p->cloth = person_one_of(&r, a->cloth.n, 0);
    p->cloth_own = random_chance(&r, t->cloth_own);
    person_any_color(&r, p->cloth_color, t->cloth_color);
}

/* Exposure, colour, blur, noise and codec; all but the first weaker where
 * effects is, and none at 0.  A poor camera is poor in all of them, and most
 * are good; white is missed towards amber or blue. */
static void person_draw_picture(struct scan_camera *c, struct random *r,
                                const struct traits *t, float effects)
{
    const float e = effects;
    float poor = random_float(r, 0, 1), white;

    poor *= poor;
    c->exposure = trait_range(r, t->exposure);
    c->contrast = 1 + e * t->contrast * person_normal(r, 2);
    c->saturation = 1 + e * t->saturation * person_normal(r, 2);
    white = person_normal(r, 2);
    for (int k = 0; k < 3; k++)
        c->balance[k] = 1 + e * (t->white * (float)(1 - k) * white
                                 + person_spread(r, t->balance));
    c->blur = random_chance(r, t->blur[0]) ? e * trait_range(r, t->blur + 1)
              : random_chance(r, t->blur_poor)
                  ? e * lerpf(t->blur_poor_size[0], t->blur_poor_size[1], poor)
                  : 0;
    c->sharpen = e * trait_maybe(r, t->sharpen);
    c->shutter = e * (random_chance(r, t->shutter[0])
                          ? trait_range(r, t->shutter + 1)
                          : trait_range(r, t->shutter_long));
    c->noise = e * random_float(r, t->noise[0],
                                t->noise[1] + t->noise[2] * (double)poor);
    c->vignette = e * trait_maybe(r, t->vignette);
    c->low = e > 0 && random_chance(r, t->coarse)
                 ? lerpf(t->coarse_scale[0], t->coarse_scale[1], poor) : 1;
    c->jpeg = e > 0 && random_chance(r, t->jpeg)
                  ? (int)lerpf(t->jpeg_quality[0], t->jpeg_quality[1],
                               poor * trait_range(r, t->coded)) : 0;
    c->codec = e > 0 && random_chance(r, t->codec)
                   ? (int)lerpf(t->codec_quantiser[0], t->codec_quantiser[1],
                                poor * trait_range(r, t->coded)) : 0;
    c->drift = e * trait_maybe(r, t->drift);
}

/* Where the camera is, what its pictures are like, and what is behind and
 * before the person. */
static void person_draw_camera(struct scan_person *p, bool far_only,
                               const struct traits *t, float effects)
{
    struct random r;
    struct scan_camera *c = &p->camera;

    random_init(&r, p->key, "camera");
    float far = random_float(&r, 0, 1);
    p->rest[2] = 12 * expf(person_spread(&r, t->distance) + 0.04f);
    c->distance = p->rest[2];
    if (far_only)
        ;
    else if (far < t->near_share[0])    /* an arm's length, or a desk's */
        c->distance = minf(c->distance, 5 * trait_range(&r, t->desk));
    else if (far < t->near_share[1])
        c->distance = 5 * trait_range(&r, t->telephone);
    p->rest[0] = person_spread(&r, t->aside) * p->rest[2] / 12;
    p->rest[1] = (person_spread(&r, t->above[0]) + t->above[1]) * p->rest[2]
                 / 12;
    person_draw_picture(c, &r, t, effects);
    c->depth = random_chance(&r, t->defocus[0])
                   ? trait_range(&r, t->defocus + 1) : 0.05f;
    c->backdrop = random_chance(&r, t->room) ? BACKDROP_ROOM : BACKDROP_WALL;
    c->view = trait_range(&r, t->view);
    c->tilt = person_spread(&r, t->tilt);
    person_any_color(&r, c->wall,
                     t->wall_color[!random_chance(&r, t->wall_plain)]);
    p->front = FRONT_NONE;
    if (effects > 0 && random_chance(&r, t->front))
        p->front = random_chance(&r, t->front_hand) ? FRONT_HAND
                   : random_chance(&r, t->front_microphone)
                       ? FRONT_MICROPHONE : FRONT_CUP;
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

/* The scans' components, with the proportions of people in photographs: the
 * mean is half of what makes resting faces of the scans, as a landmarker sees
 * them, as wide, as long and as wide of mouth as those of the 82 calm
 * photographs (least squares, ridge 0.02); half, since 82 people are few. */
static void person_draw_shape(struct scan_person *p,
                              const struct scan_face *f, const struct traits *t)
{
    struct random r;

    random_init(&r, p->key, "shape");
    for (int k = 0; k < SCAN_IDENTITIES; k++)
        p->beta[k] = 0.01f * t->identity_mean[k]
                     + person_normal(&r, t->identity_limit);
    person_close_lips(p->beta, f, trait_range(&r, t->lip_gap));
}

/* How lively, how talkative, how far they turn. */
static void person_draw_act(struct scan_person *p, const struct traits *t)
{
    struct random r;
    struct act_look *l = &p->act;

    random_init(&r, p->key, "act");
    l->traits = t;
    l->key = random_u64(&r);
    l->lively = trait_range(&r, t->lively);
    l->turn = random_chance(&r, t->turn_far[0])
                  ? trait_range(&r, t->turn_far + 1) : trait_range(&r, t->turn);
    l->yaw = t->rest[0] * l->turn * person_normal(&r, 2);
    l->pitch = person_spread(&r, t->rest[1]);
    l->roll = person_spread(&r, t->rest[2]);
    l->lean = person_spread(&r, t->lean);
    l->talk = trait_maybe(&r, t->talk);
}

void scan_person_draw(struct scan_person *p, const struct scan_assets *a,
                      uint64_t seed, uint64_t index, float effects)
{
    const struct traits *t = &a->traits;
    struct random r;

    memset(p, 0, sizeof *p);
    p->key = random_mix(random_mix(seed ^ random_name("scan person")) + index);
    random_init(&r, p->key, "who");
    p->male = random_float(&r, 0, 1);
    p->age = random_float(&r, 0, 1) * trait_range(&r, t->age);
    person_draw_shape(p, &a->face, t);
    person_draw_skin(p, t);
    person_draw_hair(p, a);
    person_draw_brows(p, t);
    person_draw_features(p, a);
    person_draw_light(p, a);
    person_draw_act(p, t);
    person_draw_camera(p, a->plain, t, effects);
}
