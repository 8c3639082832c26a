/* Eyeballs behind shut lids (shut_eye.h).  Sizes of iris and pupil are an
 * adult's, 11.7 and 4.5 mm across, by their angle from the middle of the eye on
 * the head model's eyeballs. */
#include "lib/avatar/shut_eye.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/avatar/branch.h"

#define OPEN 0.6f           /* share of the lid's way: open up to here, */
#define SHUT 0.85f          /* shut from here on */
#define PUPIL 9.0f          /* radius, degrees about the eyeball's middle */
#define IRIS 23.5f          /* likewise */
#define SOFT 2.0f           /* half the width of the borders, degrees */

/* What an eye's parts look like. */
struct shut_eye_look {
    float pupil[3], iris[3], sclera[3];
};

/* A common eye in white light: brown. */
static const struct shut_eye_look shut_eye_common = {
    {0.03f, 0.03f, 0.03f}, {0.32f, 0.21f, 0.13f}, {0.86f, 0.82f, 0.79f}
};

/* The share of the way lid (V,3) that the vertices have gone from rest, by
 * least squares. */
static float shut_eye_closure(const float *posed, const float *rest,
                              const float *lid, size_t V)
{
    double gone = 0, all = 1e-12;

    for (size_t i = 0; i < 3 * V; i++) {
        gone += (double)lid[i] * (posed[i] - rest[i]);
        all += (double)lid[i] * lid[i];
    }
    return (float)(gone / all);
}

struct shut_eye shut_eye_find(const float *posed, const float *rest,
                              const struct head *h)
{
    return (struct shut_eye){
        branch_ramp(shut_eye_closure(posed, rest, h->l_eyelid, h->V),
                    OPEN, SHUT),
        branch_ramp(shut_eye_closure(posed, rest, h->r_eyelid, h->V),
                    OPEN, SHUT)
    };
}

/* Whether vertex or midpoint k is of an eyeball; x (3) of the mean head. */
static bool shut_eye_is_ball(float x[3], size_t k, const struct head *h,
                             const struct densify *d)
{
    size_t end[2];

    densify_ends(end, d, k);
    for (size_t c = 0; c < 3; c++)
        x[c] = 0.5f * (h->v_template[3 * end[0] + c] +
                       h->v_template[3 * end[1] + c]);
    return h->region && h->region[end[0]] == REGION_EYEBALL &&
           h->region[end[1]] == REGION_EYEBALL;
}

void shut_eye_stretch(float *spacing, const struct shut_eye *s,
                      const float *stretch, const struct head *h,
                      const struct densify *d)
{
    float x[3];

    for (size_t k = 0; k < d->V + d->E; k++) {
        shut_eye_is_ball(x, k, h, d);
        spacing[k] *= 1 + (stretch[k] - 1) *
                          (1 - (x[0] > 0 ? s->left : s->right));
    }
}

void shut_eye_hide(float *seen, const struct shut_eye *s, const struct head *h,
                   const struct densify *d)
{
    float x[3];

    for (size_t k = 0; k < d->V + d->E; k++)
        if (shut_eye_is_ball(x, k, h, d))
            seen[k] *= 1 - (x[0] > 0 ? s->left : s->right);
}

/* Unit vector (3) from the middle of an eyeball to x. */
static void shut_eye_direction(float out[3], const float x[3],
                               const struct head *h, bool left)
{
    const float *c = h->joint_template +
                     3 * (left ? JOINT_EYE_LEFT : JOINT_EYE_RIGHT);
    float square = 1e-12f;

    for (int i = 0; i < 3; i++) {
        out[i] = x[i] - c[i];
        square += out[i] * out[i];
    }
    for (int i = 0; i < 3; i++)
        out[i] /= sqrtf(square);
}

/* Where an eye looks: to its foremost vertex. */
static void shut_eye_axis(float axis[3], const struct head *h, bool left)
{
    const float *most = NULL;

    for (size_t v = 0; v < h->V; v++) {
        const float *x = h->v_template + 3 * v;

        if (h->region && h->region[v] == REGION_EYEBALL &&
            (x[0] > 0) == left && (!most || x[2] > most[2]))
            most = x;
    }
    if (most)
        shut_eye_direction(axis, most, h, left);
}

/* Degrees between x (3), a point of an eyeball, and the axis that it looks
 * along. */
static float shut_eye_angle(const float x[3], const float axis[3],
                            const struct head *h)
{
    float out[3];

    shut_eye_direction(out, x, h, x[0] > 0);
    const float cosine = out[0] * axis[0] + out[1] * axis[1] +
                         out[2] * axis[2];
    return acosf(fminf(fmaxf(cosine, -1), 1)) * 57.29578f;
}

/* rgb (3) is the mean of what the photograph shows of an eyeball between two
 * angles; left alone when that is too little to tell. */
static void shut_eye_mean(float rgb[3], float low, float high, bool left,
                          const float axis[3], const float *pixel,
                          const float *trust, const struct head *h,
                          const struct densify *d)
{
    float sum[4] = {0}, x[3];

    for (size_t k = 0; k < d->V + d->E; k++) {
        if (!shut_eye_is_ball(x, k, h, d) || (x[0] > 0) != left)
            continue;
        const float angle = shut_eye_angle(x, axis, h);
        const float w = angle > low && angle < high ? trust[k] : 0;

        for (int c = 0; c < 3; c++)
            sum[c] += w * pixel[4 * k + c];
        sum[3] += w;
    }
    for (int c = 0; c < 3 && sum[3] > 2; c++)
        rgb[c] = sum[c] / sum[3];
}

/* Of the left eye or the right: a common one in this light, with the other
 * eye's colours where that one is open. */
static struct shut_eye_look shut_eye_choose(bool left, float axis[2][3],
                                            const struct shut_eye *s,
                                            const struct shut_eye_light *by,
                                            const struct head *h,
                                            const struct densify *d)
{
    struct shut_eye_look look = shut_eye_common;

    for (int c = 0; c < 3; c++) {
        look.pupil[c] *= by->white[c];
        look.iris[c] *= by->white[c];
        look.sclera[c] *= by->white[c];
    }
    if ((left ? s->right : s->left) > 0)
        return look;
    shut_eye_mean(look.iris, PUPIL + SOFT, IRIS - SOFT, !left, axis[!left],
                  by->pixel, by->trust, h, d);
    shut_eye_mean(look.sclera, IRIS + SOFT, 60, !left, axis[!left], by->pixel,
                  by->trust, h, d);
    return look;
}

void shut_eye_paint(float *rgb, const struct shut_eye *s,
                    const struct shut_eye_light *by, const struct head *h,
                    const struct densify *d)
{
    struct shut_eye_look look[2];
    float x[3], axis[2][3] = {{0, 0, 1}, {0, 0, 1}};

    if (!(s->left > 0 || s->right > 0))
        return;
    for (int left = 0; left < 2; left++)
        shut_eye_axis(axis[left], h, left);
    for (int left = 0; left < 2; left++)
        look[left] = shut_eye_choose(left, axis, s, by, h, d);
    for (size_t k = 0; k < d->V + d->E; k++) {
        if (!shut_eye_is_ball(x, k, h, d))
            continue;
        const bool left = x[0] > 0;
        const float shut = left ? s->left : s->right;
        const float angle = shut_eye_angle(x, axis[left], h);
        const float iris = branch_ramp(angle, PUPIL, PUPIL + SOFT);
        const float sclera = branch_ramp(angle, IRIS - SOFT, IRIS + SOFT);

        for (int c = 0; c < 3; c++) {
            float own = look[left].pupil[c];

            own += iris * (look[left].iris[c] - own);
            own += sclera * (look[left].sclera[c] - own);
            rgb[3 * k + c] += shut * (own - rgb[3 * k + c]);
        }
    }
}
