/* What a person does at any time: expressions of the kinds that were seen,
 * speech, blinks, gaze and turns. */
#include "lib/lab/people/scan_act.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/motion.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

/* ---- tracks of time ------------------------------------------------------ */

static uint64_t act_track(const struct act_look *l, const char *name, int i)
{
    return random_mix((l->key ^ random_name(name)) + (uint64_t)i);
}

/* The slot of `period` seconds that events of track t lie in, and how far
 * through it the time is (0..1). */
static int64_t act_period(float *through, uint64_t t, double time,
                          double period)
{
    double x = time / period + 1000 + (double)noise_slot(t, -9);
    int64_t i = (int64_t)floor(x);

    *through = (float)(x - (double)i);
    return i;
}

#define PULSE_FULL 0.6f         /* of an event: faces get there in half a
                                 * second and stay longer */

/* An event now and then: rises to 1, stays, and falls again.  chance is that
 * of a slot of `period` seconds to have one, width its share of the slot. */
static float act_pulse(uint64_t t, double time, double period, float chance,
                       float width)
{
    float f;
    int64_t i = act_period(&f, t, time, period);

    if (noise_slot(t, i) > chance)
        return 0;
    /* within its slot, so that none breaks off */
    float half = minf(0.5f * width * (0.7f + 0.6f * noise_slot(t ^ 9, i)),
                      0.5f);
    float mid = half + (1 - 2 * half) * noise_slot(t ^ 5, i);
    float d = fabsf(f - mid) / half;
    return d < 1 ? ramp(1, PULSE_FULL, d) : 0;
}

/* Place between slots i - 1 and i (0..1): holds, then moves within `move`. */
static float act_moving(uint64_t t, double time, double period, float move,
                        int64_t *i)
{
    double x = time / period + 1000 + (double)noise_slot(t, -11);

    *i = (int64_t)floor(x);
    float start = noise_slot(t ^ 0x51, *i) * (1 - move);
    return ramp(start, start + move, (float)(x - (double)*i));
}

/* ---- whole expressions -------------------------------------------------- */

/* A made-up expression: weights of a few components, both sides alike. */
struct recipe {
    struct { uint8_t k; float w; } part[7];     /* w 0 ends */
};
/* k: the left component of a pair stands for both. */
static const struct recipe recipes[] = {
    {{{ARKIT_MOUTH_SMILE_L, 0.9f}, {ARKIT_CHEEK_SQUINT_L, 0.6f},
      {ARKIT_JAW_OPENED, 0.15f}, {ARKIT_MOUTH_UPPER_UP_L, 0.35f}}},
    {{{ARKIT_MOUTH_SMILE_L, 1.0f}, {ARKIT_CHEEK_SQUINT_L, 0.9f},
      {ARKIT_JAW_OPENED, 0.45f}, {ARKIT_MOUTH_UPPER_UP_L, 0.5f},
      {ARKIT_EYE_SQUINT_L, 0.5f}, {ARKIT_MOUTH_LOWER_DOWN_L, 0.4f}}},
    {{{ARKIT_MOUTH_SMILE_L, 0.6f}, {ARKIT_MOUTH_DIMPLE_L, 0.4f},
      {ARKIT_MOUTH_PRESS_L, 0.3f}}},
    {{{ARKIT_BROW_INNER_UP_L, 0.9f}, {ARKIT_BROW_OUTER_UP_L, 0.9f},
      {ARKIT_EYE_WIDE_L, 0.8f}, {ARKIT_JAW_OPENED, 0.55f}}},
    {{{ARKIT_BROW_DOWN_L, 0.95f}, {ARKIT_EYE_SQUINT_L, 0.5f},
      {ARKIT_MOUTH_PRESS_L, 0.5f}, {ARKIT_NOSE_SNEER_L, 0.3f}}},
    {{{ARKIT_BROW_INNER_UP_L, 0.9f}, {ARKIT_MOUTH_FROWN_L, 0.8f},
      {ARKIT_MOUTH_SHRUG_LOWER, 0.5f}}},
    {{{ARKIT_NOSE_SNEER_L, 0.9f}, {ARKIT_MOUTH_UPPER_UP_L, 0.6f},
      {ARKIT_BROW_DOWN_L, 0.6f}, {ARKIT_EYE_SQUINT_L, 0.4f}}},
    {{{ARKIT_MOUTH_PUCKER, 0.95f}, {ARKIT_MOUTH_FUNNEL, 0.2f}}},
    {{{ARKIT_MOUTH_FUNNEL, 0.9f}, {ARKIT_JAW_OPENED, 0.3f}}},
    {{{ARKIT_CHEEK_PUFF_L, 0.9f}, {ARKIT_MOUTH_PUCKER, 0.3f}}},
    {{{ARKIT_MOUTH_ROLL_LOWER, 0.8f}, {ARKIT_MOUTH_ROLL_UPPER, 0.8f},
      {ARKIT_MOUTH_PRESS_L, 0.4f}}},
    {{{ARKIT_MOUTH_STRETCH_L, 0.8f}, {ARKIT_JAW_OPENED, 0.3f},
      {ARKIT_BROW_INNER_UP_L, 0.6f}, {ARKIT_EYE_WIDE_L, 0.6f}}},
    {{{ARKIT_JAW_OPENED, 1.0f}, {ARKIT_EYE_SQUINT_L, 0.4f}}},
    {{{ARKIT_BROW_INNER_UP_L, 0.8f}, {ARKIT_BROW_OUTER_UP_L, 0.7f}}},
    {{{ARKIT_EYE_SQUINT_L, 0.9f}, {ARKIT_CHEEK_SQUINT_L, 0.5f}}},
    {{{ARKIT_MOUTH_SHRUG_UPPER, 0.6f}, {ARKIT_MOUTH_SHRUG_LOWER, 0.8f}}},
};

/* w[k] += v, on both sides with one-sidedness `lean` (-1..1). */
static void act_add_both(float *w, int k, float v, float lean)
{
    w[k] += v * clampf(1 + lean, 0, 1.2f);
    if (arkit_is_left(k))
        w[k + 1] += v * clampf(1 - lean, 0, 1.2f);
}

/* One of the kinds of expression that were seen, drawn by its share. */
static void act_add_kind(float *w, const struct act_model *m, struct random *r,
                         float gain)
{
    float u = (float)random_uniform(r);
    int c = 0;

    if (!m->kinds)              /* no photographs at hand */
        return;

    while (c < m->kinds - 1 && u > m->share[c])
        c++;
    for (int k = 0; k < ARKIT_COUNT; k++) {
        float v = m->mean[c][k]
                  + m->spread[c][k] * clampf((float)random_normal(r), -2, 2);
        w[k] += gain * maxf(v, 0);
    }
}

/* The expression of slot i. */
static void act_draw_expression(float *w, const struct act_model *m,
                                const struct act_look *l, int64_t i)
{
    struct random r;
    float lean;

    memset(w, 0, ARKIT_COUNT * sizeof *w);
    random_init(&r, act_track(l, "expression", 0) + (uint64_t)i, "slot");
    float kind = (float)random_uniform(&r);
    float size = l->lively * (float)random_range(&r, 0.5, 1.3);
    lean = l->lean * (float)random_range(&r, 0, 1);
    if (random_uniform(&r) < 0.12)
        lean = random_uniform(&r) < 0.5 ? 1 : -1;
    if (kind < 0.38f) {
        act_add_kind(w, m, &r, size);
    } else if (kind < 0.50f) {
        act_add_kind(w, m, &r, 0.3f * size);
    } else if (kind < 0.76f) {
        uint32_t n = sizeof recipes / sizeof *recipes;
        const struct recipe *q = &recipes[random_below(&r, n)];
        for (int k = 0; k < 7 && q->part[k].w > 0; k++)
            act_add_both(w, q->part[k].k,
                         q->part[k].w * size
                         * (float)random_range(&r, 0.6, 1.1), lean);
        act_add_kind(w, m, &r, 0.25f);
    } else {
        int n = 1 + (int)random_below(&r, 4);
        for (int k = 0; k < n; k++) {
            int c = (int)random_below(&r, ARKIT_COUNT);
            float v = (float)random_range(&r, 0.3, 1);
            if (arkit_is_rig(c) && c < ARKIT_EYE_SQUINT_L)
                continue;
            if (!arkit_is_left(c) && c > 0 && arkit_is_left(c - 1)
                && random_uniform(&r) < 0.6)
                c--;
            act_add_both(w, c, v, arkit_is_left(c) ? lean : 0);
        }
    }
}

/* ---- speech, eyes, head -------------------------------------------------- */

struct viseme {
    float jaw, funnel, pucker, smile, lower, upper, press, roll, stretch;
};
static const struct viseme visemes[] = {
    {0.50f, 0, 0, 0.05f, 0.15f, 0.10f, 0, 0, 0.05f},    /* a */
    {0.22f, 0, 0, 0.30f, 0.25f, 0.12f, 0, 0, 0.15f},    /* e */
    {0.12f, 0, 0, 0.40f, 0.22f, 0.12f, 0, 0, 0.25f},    /* i */
    {0.30f, 0.55f, 0.25f, 0, 0, 0, 0, 0, 0},            /* o */
    {0.12f, 0.35f, 0.75f, 0, 0, 0, 0, 0, 0},            /* u */
    {0.02f, 0, 0, 0, 0, 0, 0.45f, 0.35f, 0},            /* m b p */
    {0.06f, 0, 0, 0.05f, 0, 0.22f, 0, 0.45f, 0},        /* f v */
    {0.10f, 0.15f, 0.10f, 0.1f, 0.28f, 0.22f, 0, 0, 0.1f},      /* s t */
    {0.16f, 0.40f, 0.35f, 0, 0.2f, 0.15f, 0, 0, 0},     /* sh r */
    {0.20f, 0, 0, 0.08f, 0.18f, 0.12f, 0, 0, 0},        /* l n k */
};

/* Syllables within phrases, mouths blended from one to the next. */
static void act_add_speech(float *w, const struct act_look *l, double time)
{
    uint64_t t = act_track(l, "speech", 0);
    float phrase = act_pulse(t, time, 3.3, l->talk, 1.3f);
    double rate = 0.12 + 0.06 * (double)noise_slot(t, -3);
    double x = time / rate + 1000;
    int64_t i = (int64_t)floor(x);
    float f = ramp(0, 1, (float)(x - (double)i));
    uint32_t n = sizeof visemes / sizeof *visemes;

    if (phrase <= 0)
        return;
    for (int k = 0; k < 2; k++) {
        int64_t s = i + k;
        float g = phrase * (k ? f : 1 - f)
                  * (0.6f + 0.6f * noise_slot(t ^ 7, s));
        const struct viseme *v
            = &visemes[random_mix((t ^ 3) + (uint64_t)s) % n];
        w[ARKIT_JAW_OPENED] += g * v->jaw;
        w[ARKIT_MOUTH_FUNNEL] += g * v->funnel;
        w[ARKIT_MOUTH_PUCKER] += g * v->pucker;
        act_add_both(w, ARKIT_MOUTH_SMILE_L, g * v->smile * 0.6f, 0);
        act_add_both(w, ARKIT_MOUTH_LOWER_DOWN_L, g * v->lower, 0.3f * l->lean);
        act_add_both(w, ARKIT_MOUTH_UPPER_UP_L, g * v->upper, 0.3f * l->lean);
        act_add_both(w, ARKIT_MOUTH_PRESS_L, g * v->press, 0);
        w[ARKIT_MOUTH_ROLL_LOWER] += g * v->roll;
        w[ARKIT_MOUTH_ROLL_UPPER] += g * v->roll * 0.5f;
        act_add_both(w, ARKIT_MOUTH_STRETCH_L, g * v->stretch * 0.7f, 0);
    }
    w[ARKIT_BROW_INNER_UP_L] += 0.2f * phrase
                                * maxf(noise_time(t ^ 31, time, 0.8), 0);
    w[ARKIT_BROW_INNER_UP_R] = maxf(w[ARKIT_BROW_INNER_UP_R],
                                     w[ARKIT_BROW_INNER_UP_L]);
}

/* Looks jump, keep, and take the lids along. */
static void act_add_gaze(struct act *a, const struct act_look *l, double time)
{
    uint64_t t = act_track(l, "gaze", 0);
    float *w = a->weight, to[2], keep[2];
    int64_t i;
    float f = act_moving(t, time, 1.1, 0.06f, &i);

    for (int k = 0; k < 2; k++) {
        /* half of the looks go to the camera, the rest mostly near it */
        float where = noise_slot(t ^ 77, i - 1 + k);
        bool camera = where < 0.5f;
        float far = where > 0.8f ? 1 : 0.45f;
        float yaw = far * (2 * noise_slot(t ^ 1, i - 1 + k) - 1);
        float pitch = far * (2 * noise_slot(t ^ 2, i - 1 + k) - 1);
        to[k] = camera ? -0.9f * a->yaw : 0.52f * yaw;
        keep[k] = camera ? -0.9f * a->pitch
                         : pitch > 0 ? 0.5f * pitch : 0.42f * pitch;
    }
    float yaw = clampf(lerpf(to[0], to[1], f), -0.52f, 0.52f);
    float pitch = clampf(lerpf(keep[0], keep[1], f), -0.42f, 0.5f);
    float verge = 0.012f + 0.03f * noise_slot(t, -5);
    for (int e = 0; e < 2; e++) {
        float y = yaw + (e ? verge : -verge);
        float out = e ? -y : y;
        w[ARKIT_EYE_LOOK_OUT_L + e] = maxf(out, 0) / (float)ARKIT_EYE_OUT;
        w[ARKIT_EYE_LOOK_IN_L + e] = maxf(-out, 0) / (float)ARKIT_EYE_IN;
        w[ARKIT_EYE_LOOK_DOWN_L + e] = maxf(pitch, 0)
                                       / (float)ARKIT_EYE_DOWN;
        w[ARKIT_EYE_LOOK_UP_L + e] = maxf(-pitch, 0) / (float)ARKIT_EYE_UP;
    }
}

/* Blinks, eyes that stay shut or now and then fall half shut, and winks.  Lids
 * that stay shut get there as fast as blinking ones: eyes are open or shut
 * nearly always, and open in most pictures. */
static void act_add_blinks(float *w, const struct act_look *l, double time)
{
    float blink = act_pulse(act_track(l, "blink", 0), time, 2.1, 0.6f, 0.15f);
    float doze = 0.7f
                 * act_pulse(act_track(l, "doze", 0), time, 5.1, 0.03f, 0.8f);
    float droop = 0.06f * noise_slot(act_track(l, "droop", 0), 0);
    float held = minf(3 * act_pulse(act_track(l, "held", 0), time, 6.1, 0.2f,
                                    0.35f), 1);

    for (int e = 0; e < 2; e++) {
        float wink = act_pulse(act_track(l, "wink", e), time, 6.7, 0.16f,
                               0.25f);
        float *lid = &w[ARKIT_EYE_BLINK_L + e];
        *lid = clampf(maxf(*lid * 0.5f + droop,
                            maxf(maxf(maxf(blink, held), doze), wink)), 0,
                      1);
        if (wink > 0) {
            w[ARKIT_CHEEK_SQUINT_L + e] += 0.7f * wink;
            w[ARKIT_EYE_SQUINT_L + e] += 0.3f * wink;
        }
    }
}

/* What comes on top of a mood, each in its own time. */
static const struct { uint8_t k; float chance, top; } accents[] = {
    {ARKIT_MOUTH_SMILE_L, 0.38f, 1},
    {ARKIT_MOUTH_PUCKER, 0.22f, 1}, {ARKIT_JAW_OPENED, 0.26f, 0.85f},
    {ARKIT_EYE_SQUINT_L, 0.14f, 1}, {ARKIT_EYE_WIDE_L, 0.12f, 1},
    {ARKIT_MOUTH_FUNNEL, 0.08f, 1}, {ARKIT_MOUTH_FROWN_L, 0.10f, 0.9f},
    {ARKIT_NOSE_SNEER_L, 0.08f, 0.9f}, {ARKIT_MOUTH_STRETCH_L, 0.08f, 0.8f},
    {ARKIT_MOUTH_UPPER_UP_L, 0.08f, 0.8f}, {ARKIT_CHEEK_PUFF_L, 0.06f, 0.9f},
    {ARKIT_MOUTH_ROLL_LOWER, 0.07f, 0.8f}, {ARKIT_JAW_FORWARD, 0.04f, 0.8f},
    {ARKIT_MOUTH_LEFT, 0.12f, 1}, {ARKIT_MOUTH_RIGHT, 0.12f, 1},
    {ARKIT_JAW_LEFT, 0.05f, 0.8f}, {ARKIT_JAW_RIGHT, 0.05f, 0.8f},
    {ARKIT_MOUTH_PRESS_L, 0.08f, 0.8f}, {ARKIT_MOUTH_DIMPLE_L, 0.06f, 0.7f}
};
#define ACCENT_PERIOD 2.7       /* seconds */

/* *w goes the share v of what it lacks to 1. */
static void act_raise(float *w, float v)
{
    *w += (1 - clampf(*w, 0, 1)) * v;
}

/* Whether event i of a track is of one side only, with this chance: 1 the
 * left, -1 the right; else what the person always is. */
static float act_event_side(uint64_t t, int64_t i, float chance, float own)
{
    if (noise_slot(t ^ 11, i) >= chance)
        return own;
    return noise_slot(t ^ 12, i) < 0.5f ? 1 : -1;
}

/* Single movements on top, nearly half of them of one side: a motion encoder
 * that sees few of these takes all faces for even. */
static void act_add_accents(float *w, const struct act_look *l, double time)
{
    for (size_t i = 0; i < sizeof accents / sizeof *accents; i++) {
        uint64_t t = act_track(l, "accent", (int)i);
        float v = act_pulse(t, time, ACCENT_PERIOD, accents[i].chance, 1.1f);
        float f;
        int64_t n = act_period(&f, t, time, ACCENT_PERIOD);
        float lean = act_event_side(t, n, 0.45f, 0.4f * l->lean);
        bool pair = arkit_is_left(accents[i].k);

        v *= accents[i].top * (0.45f + 0.55f * noise_slot(t ^ 13, n));
        for (int e = 0; e <= pair && v > 0; e++)
            act_raise(&w[accents[i].k + e],
                      pair ? v * clampf(1 + (e ? -lean : lean), 0, 1) : v);
    }
}

/* What brows do, one thing at a time; share is cumulative. */
static const struct brow_way {
    float share, inner, outer, down, single;    /* single: of one side */
} brow_ways[] = {
    {0.34f, 0.9f, 1, 0, 0.2f},          /* raised */
    {0.48f, 1, 0.1f, 0, 0.2f},          /* worried: the inner ends alone */
    {0.60f, 0.1f, 1, 0, 0.5f},          /* the outer ends, often one: cocked */
    {1, 0, 0, 1, 0}                     /* drawn down */
};

/* Brows move as a whole: inner and outer ends rise together, and what draws
 * them down lets neither up. */
static void act_add_brows(float *w, const struct act_look *l, double time)
{
    uint64_t t = act_track(l, "brows", 0);
    float f, v = act_pulse(t, time, ACCENT_PERIOD, 0.95f, 1.3f);
    int64_t n = act_period(&f, t, time, ACCENT_PERIOD);
    const struct brow_way *way = brow_ways;

    while (noise_slot(t ^ 21, n) > way->share)
        way++;
    float lean = act_event_side(t, n, way->single, 0.3f * l->lean);
    v *= 0.5f + 0.5f * noise_slot(t ^ 13, n);
    for (int e = 0; e < 2; e++) {
        float side = v * clampf(1 + (e ? -lean : lean), 0, 1);
        float *inner = &w[ARKIT_BROW_INNER_UP_L + e];
        float *outer = &w[ARKIT_BROW_OUTER_UP_L + e];
        float *down = &w[ARKIT_BROW_DOWN_L + e];

        if (way->down > 0) {
            *inner *= 1 - side;
            *outer *= 1 - side;
        } else {
            *down *= 1 - side;
        }
        act_raise(inner, side * way->inner);
        act_raise(outer, side * way->outer);
        act_raise(down, side * way->down);
        /* who frowns narrows the eyes */
        act_raise(&w[ARKIT_EYE_SQUINT_L + e], 0.6f * side * way->down);
    }
}

/* Lips that stay closed, pressed, rolled in or pushed up, while the jaw drops
 * behind them: a motion encoder that never sees it takes every dropped chin
 * for an open mouth. */
static void act_add_closed_lips(float *w, const struct act_look *l,
                                double time)
{
    static const uint8_t open[] = {
        ARKIT_MOUTH_LOWER_DOWN_L, ARKIT_MOUTH_LOWER_DOWN_R,
        ARKIT_MOUTH_UPPER_UP_L, ARKIT_MOUTH_UPPER_UP_R, ARKIT_MOUTH_FUNNEL
    };
    static const uint8_t shut[] = {
        ARKIT_MOUTH_ROLL_LOWER, ARKIT_MOUTH_ROLL_UPPER,
        ARKIT_MOUTH_SHRUG_LOWER, ARKIT_MOUTH_SHRUG_UPPER,
        ARKIT_MOUTH_PRESS_L, ARKIT_MOUTH_PUCKER
    };
    uint64_t t = act_track(l, "closed lips", 0);
    float f, v = act_pulse(t, time, ACCENT_PERIOD, 0.22f, 1.2f);
    int64_t n = act_period(&f, t, time, ACCENT_PERIOD);
    float *jaw = &w[ARKIT_JAW_OPENED];

    *jaw += v * (0.75f * noise_slot(t ^ 1, n) - *jaw);
    w[ARKIT_MOUTH_CLOSE] += v * (*jaw - w[ARKIT_MOUTH_CLOSE]);
    for (size_t k = 0; k < sizeof open; k++)
        w[open[k]] *= 1 - v;
    for (size_t k = 0; k < sizeof shut; k++) {
        float far = maxf(2 * noise_slot(t ^ (2 + k), n) - 1, 0);

        act_raise(&w[shut[k]], v * far);
        if (arkit_is_left(shut[k]))
            act_raise(&w[shut[k] + 1], v * far);
    }
}

/* A mouth is wide or round, and its corners go up or down: of two that undo
 * each other the stronger stays. */
static void act_resolve_mouth(float *w)
{
    for (int e = 0; e < 2; e++) {
        float *smile = &w[ARKIT_MOUTH_SMILE_L + e];
        float *frown = &w[ARKIT_MOUTH_FROWN_L + e];
        float up = *smile, down = *frown;

        *smile *= 1 - down;
        *frown *= 1 - up;
    }
    float round = minf(w[ARKIT_MOUTH_PUCKER] + w[ARKIT_MOUTH_FUNNEL], 1);
    float wide = 0.5f * (w[ARKIT_MOUTH_SMILE_L] + w[ARKIT_MOUTH_SMILE_R]);
    w[ARKIT_MOUTH_PUCKER] *= 1 - wide;
    w[ARKIT_MOUTH_FUNNEL] *= 1 - wide;
    for (int e = 0; e < 2; e++) {
        w[ARKIT_MOUTH_SMILE_L + e] *= 1 - round;
        w[ARKIT_MOUTH_STRETCH_L + e] *= 1 - round;
        w[ARKIT_MOUTH_DIMPLE_L + e] *= 1 - round;
        w[ARKIT_MOUTH_PRESS_L + e] *= 1 - round;
    }
    /* lips are pushed out or rolled in */
    w[ARKIT_MOUTH_ROLL_LOWER] *= 1 - round;
    w[ARKIT_MOUTH_ROLL_UPPER] *= 1 - round;
}

/* Weights within 0..1, and none that undo or cross each other. */
static void act_resolve_conflicts(float *w)
{
    for (int k = 0; k < ARKIT_COUNT; k++)
        w[k] = clampf(w[k], 0, 1);
    for (int e = 0; e < 2; e++) {
        float shut = w[ARKIT_EYE_BLINK_L + e];
        w[ARKIT_EYE_WIDE_L + e] *= 1 - shut;
        w[ARKIT_EYE_SQUINT_L + e] *= 1 - 0.6f * shut;
        w[ARKIT_CHEEK_SQUINT_L + e] *= 1 - 0.3f * shut;
        w[ARKIT_EYE_BLINK_L + e]
            = minf(shut, 1 - 0.85f * w[ARKIT_EYE_LOOK_DOWN_L + e] * 0.6f);
        w[ARKIT_BROW_INNER_UP_L + e]
            *= 1 - 0.5f * w[ARKIT_BROW_DOWN_L + e];
        w[ARKIT_BROW_OUTER_UP_L + e]
            *= 1 - 0.7f * w[ARKIT_BROW_DOWN_L + e];
    }
    w[ARKIT_MOUTH_CLOSE] = minf(w[ARKIT_MOUTH_CLOSE], w[ARKIT_JAW_OPENED]);
    float side = w[ARKIT_JAW_LEFT] - w[ARKIT_JAW_RIGHT];
    w[ARKIT_JAW_LEFT] = maxf(side, 0);
    w[ARKIT_JAW_RIGHT] = maxf(-side, 0);
    act_resolve_mouth(w);
}

void act_at(struct act *a, const struct act_model *m,
            const struct act_look *l, double time,
            const struct synth_turn *turn)
{
    static const float size[3] = {1, 0.40f, 0.32f};
    float from[ARKIT_COUNT], to[ARKIT_COUNT], pose[3];
    int64_t i;

    memset(a, 0, sizeof *a);
    for (int k = 0; k < 3; k++) {
        float slow = noise_time(act_track(l, "pose", k), time, 2.2);
        float fast = noise_time(act_track(l, "nod", k), time, 0.7);
        pose[k] = (k ? size[k] : l->turn) * l->lively
                  * (slow * fabsf(slow) * 0.6f + slow * 0.4f + 0.10f * fast);
        a->drift[k] = noise_time(act_track(l, "drift", k), time, 3.1);
    }
    a->yaw = clampf(l->yaw + pose[0], -1.05f, 1.05f);
    a->pitch = clampf(l->pitch + pose[1], -0.44f, 0.44f);
    a->roll = clampf(l->roll + pose[2], -0.35f, 0.35f);
    if (turn) {
        a->yaw = turn->yaw;
        a->pitch = turn->pitch;
        a->roll = turn->roll;
    }
    a->pupil = noise_time(act_track(l, "pupil", 0), time, 4);
    float f = act_moving(act_track(l, "mood", 0), time, 1.3, 0.35f, &i);
    act_draw_expression(from, m, l, i - 1);
    act_draw_expression(to, m, l, i);
    for (int k = 0; k < ARKIT_COUNT; k++)
        a->weight[k]
            = lerpf(from[k], to[k], f)
              + 0.05f
                    * maxf(noise_time(act_track(l, "tremble", k), time, 0.9),
                            0);
    act_add_speech(a->weight, l, time);
    act_add_accents(a->weight, l, time);
    act_add_brows(a->weight, l, time);
    act_add_closed_lips(a->weight, l, time);
    act_add_blinks(a->weight, l, time);
    act_add_gaze(a, l, time);
    act_resolve_conflicts(a->weight);
}
