/* Values per slot of time from the person's key, joined by splines; pose,
 * gaze, lids, jaw and expression out of them. */
#include "lib/lab/people/motion.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/lab/people/noise.h"
#include "lib/lab/people/vec.h"

/* The person's own track of a name. */
static uint64_t motion_key(const struct persona *p, uint64_t name)
{
    return random_mix(p->key ^ name);
}

/* Random number 0..1 of track `name` in slot i. */
static float motion_slot(const struct persona *p, uint64_t name, int64_t i)
{
    return noise_slot(motion_key(p, name), i);
}

/* Smooth noise in -1..1 that takes a new value every `period` seconds. */
static float motion_noise(const struct persona *p, uint64_t name, double time,
                          double period)
{
    return noise_time(motion_key(p, name), time, period);
}

/* In 0..1: holds a value for `period` seconds and then moves on within `move`
 * of them. */
static float motion_jump(const struct persona *p, uint64_t name, double time,
                         double period, double move)
{
    double x = time / period + 1000;
    int64_t i = (int64_t)floor(x);
    float f = (float)(x - (double)i);
    float start = motion_slot(p, name ^ 0x51, i) * (1 - (float)move);

    return lerpf(motion_slot(p, name, i - 1), motion_slot(p, name, i),
                 ramp(start, start + (float)move, f));
}

/* An event now and then: rises to 1 and falls again.  chance is that of a
 * slot of `period` seconds to have one, width its share of the slot. */
static float motion_pulse(const struct persona *p, uint64_t name, double time,
                          double period, float chance, float width)
{
    double x = time / period + 1000;
    int64_t i = (int64_t)floor(x);
    float f = (float)(x - (double)i);

    if (motion_slot(p, name, i) > chance)
        return 0;
    float half = 0.5f * width * (0.7f + 0.6f * motion_slot(p, name ^ 9, i));
    float mid = half + (1 - 2 * half) * motion_slot(p, name ^ 5, i);
    float d = fabsf(f - mid) / half;
    return d < 1 ? ramp(1, 0.25f, d) : 0;
}

static uint64_t motion_track(const char *name, int i)
{
    return random_mix(random_name(name) + (uint64_t)i);
}

/* The first directions come and go as whole expressions: each is strong in
 * few slots only; the next ones tremble a little. */
static void motion_sample_expression(struct synth_motion *m,
                                     const struct persona *p, double time,
                                     size_t nexp)
{
    for (size_t i = 0; i < nexp && i < MOTION_EXP_MAX; i++) {
        uint64_t name = motion_track("exp", (int)i);
        float v = 0;
        if (i < 28) {
            float on = motion_pulse(p, name, time, 2.8, 0.20f, 1.0f);
            float size
                = 2 * motion_slot(p, name ^ 3, (int64_t)(time / 2.8 + 1000))
                  - 1;
            size = (size < 0 ? -1 : 1) * (0.35f + 1.15f * fabsf(size));
            v = on * size * p->lively
                + 0.10f * motion_noise(p, name ^ 1, time, 1.1);
        } else if (i < 40) {
            v = 0.25f * motion_noise(p, name, time, 1.7);
        }
        m->exp[i] = clampf(v, -2, 2);
    }
}

/* Speech: syllables at four to six a second inside phrases. */
static void motion_sample_jaw(struct synth_motion *m, const struct persona *p,
                              double time)
{
    uint64_t name = motion_track("speech", 0);
    float phrase = motion_pulse(p, name, time, 3.1, 0.65f, 1.0f);
    float rate = 0.17f + 0.08f * motion_slot(p, name, -3);
    float syllable = 0.5f + 0.5f * motion_noise(p, name ^ 2, time, rate);
    float open = 0.22f * phrase * syllable * p->lively;

    open += 0.42f
            * motion_pulse(p, motion_track("yawn", 0), time, 4.3, 0.28f, 0.7f)
            * (0.4f + 0.6f * motion_slot(p, name, (int64_t)(time / 4.3)));
    m->jaw[0] = clampf(open, 0, 0.42f);
    m->jaw[1] = 0.06f * motion_noise(p, motion_track("jaw", 1), time, 0.9)
                * ramp(0, 0.1f, open);
    m->jaw[2] = 0.02f * motion_noise(p, motion_track("jaw", 2), time, 0.9)
                * ramp(0, 0.1f, open);
    /* the lips shape the sounds: the first directions, quickly */
    for (int i = 0; i < 8; i++)
        m->exp[i] += 0.45f * phrase
                     * motion_noise(p, motion_track("viseme", i), time, rate);
}

/* Gaze jumps from one target to the next, now and then to the camera. */
static void motion_sample_eyes(struct synth_motion *m, const struct persona *p,
                               double time)
{
    float yaw = 2 * motion_jump(p, motion_track("gaze", 0), time, 0.9, 0.07)
                - 1;
    float pitch = 2 * motion_jump(p, motion_track("gaze", 1), time, 0.9, 0.07)
                  - 1;
    float camera = motion_jump(p, motion_track("gaze", 2), time, 1.9, 0.05);
    float keep = camera > 0.5f ? 1 : 0.25f;

    /* often the eyes hold the camera while the head turns */
    yaw = 0.42f * yaw * keep - (camera > 0.5f ? 0 : 0.55f * m->yaw);
    pitch = 0.24f * pitch * keep - (camera > 0.5f ? 0 : 0.5f * m->pitch);
    yaw = clampf(yaw, -0.45f, 0.45f);
    pitch = clampf(pitch, -0.3f, 0.3f);
    float verge = 0.03f * motion_slot(p, motion_track("verge", 0), 0);
    m->eye[0] = m->eye[3] = pitch;
    m->eye[1] = yaw - verge;
    m->eye[4] = yaw + verge;
    float blink = motion_pulse(p, motion_track("blink", 0), time, 2.3, 0.75f,
                               0.13f);
    float doze = 0.5f
                 * motion_pulse(p, motion_track("doze", 0), time, 5.1, 0.25f,
                                0.8f);
    float down = clampf(pitch * 0.9f, -0.1f, 0.3f);
    float base = clampf(
        0.13f + 0.08f * motion_noise(p, motion_track("lid", 0), time, 2)
            + down,
        0, 1);
    float both = base + (1 - base) * fmaxf(blink, doze);
    for (int k = 0; k < 2; k++) {
        float wink = motion_pulse(p, motion_track("wink", k), time, 6.7, 0.22f,
                                  0.2f);
        m->lid[k] = clampf(fmaxf(both, wink), 0, 1);
    }
}

void synth_face_rotation(float rot[9], float yaw, float pitch, float roll)
{
    static const float front[9] = { 1, 0, 0, 0, -1, 0, 0, 0, -1 };
    float a[9], b[9], c[9], t[9];

    axis33(a, 1, yaw);
    axis33(b, 0, pitch);
    axis33(c, 2, roll);
    mul33(t, a, b);
    mul33(b, c, t);
    mul33(rot, front, b);
}

/* Shoulders at place `at`; the head turns about the top of the neck. */
static void motion_place_body(struct synth_motion *m, const float at[3])
{
    static const float pivot[3] = { 0, -0.50f, -0.16f };
    float a[3], b[3];

    synth_face_rotation(m->rot, m->yaw, m->pitch, m->roll);
    rot3(a, m->body, pivot);
    rot3(b, m->rot, pivot);
    for (int k = 0; k < 3; k++) {
        m->body_trans[k] = at[k];
        m->trans[k] = at[k] + a[k] - b[k];
    }
}

void synth_still(struct synth_motion *m, const struct persona *p)
{
    m->yaw = m->pitch = m->roll = 0;
    synth_face_rotation(m->body, 0, 0, 0);
    motion_place_body(m, p->rest);
}

void synth_motion(struct synth_motion *m, const struct persona *p, double time,
                  size_t nexp, const struct synth_turn *turn)
{
    float pose[3], size[3] = { 0.62f, 0.34f, 0.27f }, drift[3];

    memset(m, 0, sizeof *m);
    for (int k = 0; k < 3; k++) {
        float slow = motion_noise(p, motion_track("pose", k), time, 2.2);
        float fast = motion_noise(p, motion_track("nod", k), time, 0.7);
        pose[k] = size[k] * p->lively * (slow * fabsf(slow) * 0.6f
                                         + slow * 0.4f + 0.12f * fast);
        drift[k] = motion_noise(p, motion_track("drift", k), time, 3.1);
    }
    m->yaw = clampf(p->yaw + pose[0], -MOTION_YAW, MOTION_YAW);
    m->pitch = clampf(p->pitch + pose[1], -MOTION_PITCH, MOTION_PITCH);
    m->roll = clampf(p->roll + pose[2], -MOTION_ROLL, MOTION_ROLL);
    if (turn) {
        m->yaw = turn->yaw;
        m->pitch = turn->pitch;
        m->roll = turn->roll;
    }
    synth_face_rotation(m->body, 0.35f * p->yaw + 0.22f * m->yaw,
                        0.06f * m->pitch, 0.1f * m->roll);
    /* the shoulders drift a little */
    for (int k = 0; k < 3; k++)
        drift[k] = p->rest[k]
                   + drift[k] * (k < 2 ? 0.035f : 0.02f * p->rest[2]);
    motion_place_body(m, drift);
    motion_sample_expression(m, p, time, nexp);
    motion_sample_jaw(m, p, time);
    for (size_t i = 0; i < 8 && i < nexp; i++)
        m->exp[i] = clampf(m->exp[i], -2.2f, 2.2f);
    motion_sample_eyes(m, p, time);
}
