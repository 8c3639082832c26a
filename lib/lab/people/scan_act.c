/* What a person does at any time: expressions of the kinds that were seen,
 * speech, blinks, gaze and turns. */
#include "lib/lab/people/scan_act.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/noise.h"
#include "lib/base/vec3.h"

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

/* The same of an event of the traits: period, chance, width. */
static float act_event(uint64_t t, double time, const double event[3])
{
    return act_pulse(t, time, event[0], (float)event[1], (float)event[2]);
}

/* Place between slots i - 1 and i (0..1): holds, then moves within a share of
 * the time; how: period, share. */
static float act_moving(uint64_t t, double time, const double how[2],
                        int64_t *i)
{
    const float move = (float)how[1];
    double x = time / how[0] + 1000 + (double)noise_slot(t, -11);

    *i = (int64_t)floor(x);
    float start = noise_slot(t ^ 0x51, *i) * (1 - move);
    return ramp(start, start + move, (float)(x - (double)*i));
}

/* ---- whole expressions -------------------------------------------------- */

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

/* A made-up expression, its parts of random size. */
static void act_add_made(float *w, const struct traits *t, struct random *r,
                         float size, float lean)
{
    const struct trait_moves *q
        = &t->expression[random_below(r, (uint32_t)t->expressions)];

    for (int k = 0; k < q->n; k++)
        act_add_both(w, q->move[k].component,
                     q->move[k].value[0] * size
                     * trait_range(r, t->expression_made), lean);
}

/* A few single components. */
static void act_add_single(float *w, const struct traits *t, struct random *r,
                           float lean)
{
    int n = 1 + (int)random_below(r, 4);

    for (int k = 0; k < n; k++) {
        int c = (int)random_below(r, ARKIT_COUNT);
        float v = trait_range(r, t->expression_single);
        if (arkit_is_rig(c) && c < ARKIT_EYE_SQUINT_L)
            continue;
        if (!arkit_is_left(c) && c > 0 && arkit_is_left(c - 1)
            && random_chance(r, t->expression_paired))
            c--;
        act_add_both(w, c, v, arkit_is_left(c) ? lean : 0);
    }
}

/* The expression of slot i. */
static void act_draw_expression(float *w, const struct act_model *m,
                                const struct act_look *l, int64_t i)
{
    const struct traits *t = l->traits;
    struct random r;
    float lean;

    memset(w, 0, ARKIT_COUNT * sizeof *w);
    random_init(&r, act_track(l, "expression", 0) + (uint64_t)i, "slot");
    float kind = (float)random_uniform(&r);
    float size = l->lively * trait_range(&r, t->expression_size);
    lean = l->lean * random_float(&r, 0, 1);
    if (random_chance(&r, t->expression_one_sided))
        lean = random_uniform(&r) < 0.5 ? 1 : -1;
    if (kind < t->expression_share[0]) {
        act_add_kind(w, m, &r, size);
    } else if (kind < t->expression_share[1]) {
        act_add_kind(w, m, &r, t->expression_small * size);
    } else if (kind < t->expression_share[2]) {
        act_add_made(w, t, &r, size, lean);
        act_add_kind(w, m, &r, t->expression_with_made);
    } else {
        act_add_single(w, t, &r, lean);
    }
}

/* ---- speech, eyes, head -------------------------------------------------- */

/* What a row of the visemes says, in this order. */
enum { JAW, FUNNEL, PUCKER, SMILE, LOWER, UPPER, PRESS, ROLL, STRETCH };

/* Syllables within phrases, mouths blended from one to the next. */
static void act_add_speech(float *w, const struct act_look *l, double time)
{
    const struct traits *a = l->traits;
    uint64_t t = act_track(l, "speech", 0);
    float phrase = act_pulse(t, time, a->speech[0], l->talk,
                             (float)a->speech[1]);
    double rate = a->syllable[0]
                  + a->syllable[1] * (double)noise_slot(t, -3);
    double x = time / rate + 1000;
    int64_t i = (int64_t)floor(x);
    float f = ramp(0, 1, (float)(x - (double)i));
    const float lean = a->viseme_lean * l->lean;

    if (phrase <= 0)
        return;
    for (int k = 0; k < 2; k++) {
        int64_t s = i + k;
        float g = phrase * (k ? f : 1 - f)
                  * (a->loudness[0]
                     + a->loudness[1] * noise_slot(t ^ 7, s));
        const float *v = a->viseme[random_mix((t ^ 3) + (uint64_t)s) % 10];
        w[ARKIT_JAW_OPENED] += g * v[JAW];
        w[ARKIT_MOUTH_FUNNEL] += g * v[FUNNEL];
        w[ARKIT_MOUTH_PUCKER] += g * v[PUCKER];
        act_add_both(w, ARKIT_MOUTH_SMILE_L, g * v[SMILE] * 0.6f, 0);
        act_add_both(w, ARKIT_MOUTH_LOWER_DOWN_L, g * v[LOWER], lean);
        act_add_both(w, ARKIT_MOUTH_UPPER_UP_L, g * v[UPPER], lean);
        act_add_both(w, ARKIT_MOUTH_PRESS_L, g * v[PRESS], 0);
        w[ARKIT_MOUTH_ROLL_LOWER] += g * v[ROLL];
        w[ARKIT_MOUTH_ROLL_UPPER] += g * v[ROLL] * 0.5f;
        act_add_both(w, ARKIT_MOUTH_STRETCH_L, g * v[STRETCH] * 0.7f, 0);
    }
    w[ARKIT_BROW_INNER_UP_L] += a->speech_brow * phrase
                                * maxf(noise_time(t ^ 31, time, 0.8), 0);
    w[ARKIT_BROW_INNER_UP_R] = maxf(w[ARKIT_BROW_INNER_UP_R],
                                     w[ARKIT_BROW_INNER_UP_L]);
}

/* Looks jump, keep, and take the lids along. */
static void act_add_gaze(struct act *a, const struct act_look *l, double time)
{
    const struct traits *q = l->traits;
    const float *limit = q->gaze_limit;
    uint64_t t = act_track(l, "gaze", 0);
    float *w = a->weight, to[2], keep[2];
    int64_t i;
    float f = act_moving(t, time, q->gaze, &i);

    for (int k = 0; k < 2; k++) {
        /* half of the looks go to the camera, the rest mostly near it */
        float where = noise_slot(t ^ 77, i - 1 + k);
        bool camera = where < q->gaze_share[0];
        float far = where > q->gaze_share[1] ? 1 : q->gaze_near;
        float yaw = far * (2 * noise_slot(t ^ 1, i - 1 + k) - 1);
        float pitch = far * (2 * noise_slot(t ^ 2, i - 1 + k) - 1);
        to[k] = camera ? -q->gaze_camera * a->yaw : limit[0] * yaw;
        keep[k] = camera ? -q->gaze_camera * a->pitch
                         : limit[pitch > 0 ? 1 : 2] * pitch;
    }
    float yaw = clampf(lerpf(to[0], to[1], f), -limit[0], limit[0]);
    float pitch = clampf(lerpf(keep[0], keep[1], f), -limit[2], limit[1]);
    float verge = q->gaze_verge[0] + q->gaze_verge[1] * noise_slot(t, -5);
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
    const struct traits *q = l->traits;
    float blink = act_event(act_track(l, "blink", 0), time, q->blink_event);
    float doze = q->doze_size
                 * act_event(act_track(l, "doze", 0), time, q->doze_event);
    float droop = q->droop * noise_slot(act_track(l, "droop", 0), 0);
    float held = minf(3 * act_event(act_track(l, "held", 0), time,
                                    q->shut_event), 1);

    for (int e = 0; e < 2; e++) {
        float wink = act_event(act_track(l, "wink", e), time, q->wink_event);
        float *lid = &w[ARKIT_EYE_BLINK_L + e];
        *lid = clampf(maxf(*lid * 0.5f + droop,
                            maxf(maxf(maxf(blink, held), doze), wink)), 0,
                      1);
        if (wink > 0) {
            w[ARKIT_CHEEK_SQUINT_L + e] += q->wink_squint[0] * wink;
            w[ARKIT_EYE_SQUINT_L + e] += q->wink_squint[1] * wink;
        }
    }
}

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
    const struct traits *q = l->traits;
    const double *event = q->accent_event;

    for (int i = 0; i < q->accent.n; i++) {
        const int k = q->accent.move[i].component;
        uint64_t t = act_track(l, "accent", i);
        float v = act_pulse(t, time, event[0], q->accent.move[i].value[0],
                            (float)event[2]);
        float f;
        int64_t n = act_period(&f, t, time, event[0]);
        float lean = act_event_side(t, n, q->accent_one_sided[0],
                                    q->accent_one_sided[1] * l->lean);
        bool pair = arkit_is_left(k);

        v *= q->accent.move[i].value[1]
             * (q->accent_size[0] + q->accent_size[1] * noise_slot(t ^ 13, n));
        for (int e = 0; e <= pair && v > 0; e++)
            act_raise(&w[k + e],
                      pair ? v * clampf(1 + (e ? -lean : lean), 0, 1) : v);
    }
}

/* What brows do, one thing at a time: a row of the traits. */
enum { SHARE, INNER, OUTER, DOWN, ONE_SIDED };

/* Brows move as a whole: inner and outer ends rise together, and what draws
 * them down lets neither up. */
static void act_add_brows(float *w, const struct act_look *l, double time)
{
    const struct traits *q = l->traits;
    uint64_t t = act_track(l, "brows", 0);
    float f, v = act_event(t, time, q->brow_event);
    int64_t n = act_period(&f, t, time, q->brow_event[0]);
    const float *way = q->brow_way[0];

    for (int k = 1; k < 4 && noise_slot(t ^ 21, n) > way[SHARE]; k++)
        way = q->brow_way[k];
    float lean = act_event_side(t, n, way[ONE_SIDED], q->brow_lean * l->lean);
    v *= q->brow_size[0] + q->brow_size[1] * noise_slot(t ^ 13, n);
    for (int e = 0; e < 2; e++) {
        float side = v * clampf(1 + (e ? -lean : lean), 0, 1);
        float *inner = &w[ARKIT_BROW_INNER_UP_L + e];
        float *outer = &w[ARKIT_BROW_OUTER_UP_L + e];
        float *down = &w[ARKIT_BROW_DOWN_L + e];

        if (way[DOWN] > 0) {
            *inner *= 1 - side;
            *outer *= 1 - side;
        } else {
            *down *= 1 - side;
        }
        act_raise(inner, side * way[INNER]);
        act_raise(outer, side * way[OUTER]);
        act_raise(down, side * way[DOWN]);
        /* who frowns narrows the eyes */
        act_raise(&w[ARKIT_EYE_SQUINT_L + e],
                  q->brow_squint * side * way[DOWN]);
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
    const double *event = l->traits->closed_lips_event;
    float f, v = act_event(t, time, event);
    int64_t n = act_period(&f, t, time, event[0]);
    float *jaw = &w[ARKIT_JAW_OPENED];

    *jaw += v * (l->traits->closed_lips_jaw * noise_slot(t ^ 1, n) - *jaw);
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
    const struct traits *q = l->traits;
    const float *limit = q->pose_limit;
    float from[ARKIT_COUNT], to[ARKIT_COUNT], pose[3];
    int64_t i;

    memset(a, 0, sizeof *a);
    for (int k = 0; k < 3; k++) {
        float slow = noise_time(act_track(l, "pose", k), time,
                                q->pose_time[0]);
        float fast = noise_time(act_track(l, "nod", k), time,
                                q->pose_time[1]);
        pose[k] = (k ? q->pose_size[k - 1] : l->turn) * l->lively
                  * (slow * fabsf(slow) * 0.6f + slow * 0.4f + 0.10f * fast);
        a->drift[k] = noise_time(act_track(l, "drift", k), time,
                                 q->drift_time);
    }
    a->yaw = clampf(l->yaw + pose[0], -limit[0], limit[0]);
    a->pitch = clampf(l->pitch + pose[1], -limit[1], limit[1]);
    a->roll = clampf(l->roll + pose[2], -limit[2], limit[2]);
    if (turn) {
        a->yaw = turn->yaw;
        a->pitch = turn->pitch;
        a->roll = turn->roll;
    }
    a->pupil = noise_time(act_track(l, "pupil", 0), time, q->pupil_time);
    float f = act_moving(act_track(l, "mood", 0), time, q->mood, &i);
    act_draw_expression(from, m, l, i - 1);
    act_draw_expression(to, m, l, i);
    for (int k = 0; k < ARKIT_COUNT; k++)
        a->weight[k]
            = lerpf(from[k], to[k], f)
              + q->tremble * maxf(noise_time(act_track(l, "tremble", k), time,
                                            q->tremble_time), 0);
    act_add_speech(a->weight, l, time);
    act_add_accents(a->weight, l, time);
    act_add_brows(a->weight, l, time);
    act_add_closed_lips(a->weight, l, time);
    act_add_blinks(a->weight, l, time);
    act_add_gaze(a, l, time);
    act_resolve_conflicts(a->weight);
}
