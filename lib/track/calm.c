/* The face at rest in one picture (calm.h): robust estimates, number by number
 * and of the opening of the lips. */
#include "lib/track/calm.h"

#include <math.h>
#include <string.h>

/* Number k of E_m's output in m; NULL: not the face's. */
static float *calm_number(struct motion *m, size_t nexp, size_t k)
{
    if (k >= MOTION_EXP && k < MOTION_EXP + nexp && k < MOTION_JAW)
        return &m->exp[k - MOTION_EXP];
    if (k >= MOTION_JAW && k < MOTION_LID)
        return &m->pose.jaw[k - MOTION_JAW];
    if (k >= MOTION_LID && k < MOTION_EYE)
        return &m->pose.lid[k - MOTION_LID];
    return NULL;
}

static float calm_mean(const float *rest, size_t k)
{
    return 0.5f * (rest[MOTION_OUT + k] + rest[k]);
}

static float calm_half(const float *rest, size_t k)
{
    return 0.5f * (rest[MOTION_OUT + k] - rest[k]);
}

/* How far apart m's lips are. */
static float calm_gap(struct landmarks *lips, const struct motion *m)
{
    float at[3 * HEAD_LANDMARKS];
    struct head_motion pose = m->pose;

    pose.exp = m->exp;
    landmarks_pose(at, lips, &pose);
    return at[3 * HEAD_LIP_UPPER + 1] - at[3 * HEAD_LIP_LOWER + 1];
}

void calm_init(struct calm *c, const float *rest, struct landmarks *lips)
{
    const size_t nexp = lips->part.head.nexp;
    struct motion m = {0};
    float square = 0;

    memset(c, 0, sizeof *c);
    c->rest = rest;
    c->nexp = nexp;
    if (!rest)
        return;
    for (size_t k = 0; k < MOTION_OUT; k++)
        if (calm_number(&m, nexp, k))
            *calm_number(&m, nexp, k) = calm_mean(rest, k);
    const float mean = calm_gap(lips, &m);
    for (size_t k = 0; k < MOTION_OUT; k++) {
        float *x = calm_number(&m, nexp, k);

        if (!x)
            continue;
        *x += calm_half(rest, k);
        c->parts[k] = calm_gap(lips, &m) - mean;
        *x = calm_mean(rest, k);
        square += c->parts[k] * c->parts[k];
    }
    for (size_t k = 0; k < MOTION_OUT && square > 0; k++)
        c->parts[k] /= sqrtf(square);
}

/* m's numbers are to be within their ranges; returned is how far the lips are
 * apart, those of calm faces by -1 to 1, and *left how far they still are. */
static float calm_cut(struct motion *m, float *left, const struct calm *c)
{
    float apart = 0;

    *left = 0;
    for (size_t k = 0; k < MOTION_OUT; k++) {
        float *x = calm_number(m, c->nexp, k);

        if (!x)
            continue;
        const float mean = calm_mean(c->rest, k), half = calm_half(c->rest, k);
        const float cut = fminf(fmaxf(*x, mean - half), mean + half);

        if (half > 0) {
            apart += c->parts[k] * (*x - mean) / half;
            *left += c->parts[k] * (cut - mean) / half;
        }
        *x = cut;
    }
    return apart;
}

void calm_face(struct motion *m, const struct calm *c)
{
    if (!c->rest)
        return;
    float left;
    const float apart = calm_cut(m, &left, c);
    /* Hampel's redescending weight (1974): whole within the range, none from
     * twice it on */
    const float weight = fminf(fmaxf(2 - fabsf(apart), 0), 1);

    for (size_t k = 0; k < MOTION_OUT; k++) {
        float *x = calm_number(m, c->nexp, k);

        if (x)
            *x -= (1 - weight) * left * c->parts[k] * calm_half(c->rest, k);
    }
}
