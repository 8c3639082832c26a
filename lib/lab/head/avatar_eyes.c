/* The template avatar's eyes: which skin lends closed lids its colour, and where
 * pupil, iris and white are.  Sizes of iris and pupil are an adult's, 11.7 and
 * 4.5 mm across, by their angle from the middle of the eye on the head model's
 * eyeballs. */
#include "lib/lab/head/avatar_make.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/avatar/branch.h"
#include "lib/base/vec3.h"

#define ABOUT_MM 16.0f      /* skin so far from a lid lends its colour */
#define LENT 0.8f           /* share of that colour at the margin */
#define PUPIL 9.0f          /* radius, degrees about the eyeball's middle */
#define IRIS 23.5f          /* likewise */
#define SOFT 2.0f           /* half the width of the borders, degrees */

/* A common eye in white light, brown: pupil, iris, white. */
static const float eyes_common[9] = {
    0.03f, 0.03f, 0.03f, 0.32f, 0.21f, 0.13f, 0.86f, 0.82f, 0.79f
};

/* ---- lids ------------------------------------------------------------------ */

/* How far vertex or midpoint k comes down when both eyes close, head units. */
static float eyes_descent(size_t k, const struct head *h,
                          const struct densify *d)
{
    const float *l = h->l_eyelid + 1, *r = h->r_eyelid + 1;
    size_t end[2];

    densify_ends(end, d, k);
    return -0.5f * (l[3 * end[0]] + r[3 * end[0]] +
                    l[3 * end[1]] + r[3 * end[1]]);
}

/* about_eye of one side: skin about x (3), neither brows nor eyes. */
static void eyes_about(float *about, const float x[3], const struct head *h)
{
    const float far = ABOUT_MM * 1e-3f * h->scale;

    for (size_t v = 0; v < h->V; v++) {
        const float *at = h->v_template + 3 * v;
        const int region = h->region ? h->region[v] : REGION_FACE;
        float d2 = 0;

        for (int c = 0; c < 3; c++)
            d2 += (at[c] - x[c]) * (at[c] - x[c]);
        if (d2 <= 9 * far * far &&
            (region == REGION_FACE || region == REGION_SKIN))
            about[2 * v] = expf(-0.5f * d2 / (far * far));
    }
}

/* One side's lid, if there is one. */
static void eyes_make_lid(struct head_avatar *a, float side,
                          const struct head *h, const struct densify *d)
{
    float sum = 0, max = 0, middle[3] = {0};

    for (size_t v = 0; v < d->V; v++)
        if (a->lid[v] > 0 && a->side[v] == side) {
            sum += a->lid[v];
            for (int c = 0; c < 3; c++)
                middle[c] += a->lid[v] * h->v_template[3 * v + c];
            max = fmaxf(max, eyes_descent(v, h, d));
        }
    if (!(sum > 0))
        return;
    for (int c = 0; c < 3; c++)
        middle[c] /= sum;
    eyes_about(a->about_eye + (side > 0 ? 0 : 1), middle, h);
    for (size_t k = 0; k < a->points; k++)
        if (a->lid[k] > 0 && a->side[k] == side)
            a->lid_skin[k] = LENT * fmaxf(eyes_descent(k, h, d) / max, 0);
}

/* ---- eyeballs -------------------------------------------------------------- */

/* Unit vector (3) from the middle of an eyeball to x. */
static void eyes_direction(float out[3], const float x[3],
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
static void eyes_axis(float axis[3], const struct head *h, bool left)
{
    const float *front = NULL;

    for (size_t v = 0; v < h->V; v++) {
        const float *x = h->v_template + 3 * v;

        if (h->region && h->region[v] == REGION_EYEBALL &&
            (x[0] > 0) == left && (!front || x[2] > front[2]))
            front = x;
    }
    if (front)
        eyes_direction(axis, front, h, left);
}

/* Shares (3) of pupil, iris and white at x (3), a point of an eyeball that looks
 * along axis. */
static void eyes_parts(float part[3], const float x[3], const float axis[3],
                       const struct head *h)
{
    float out[3];

    eyes_direction(out, x, h, x[0] > 0);
    const float angle = acosf(clampf(dot3(out, axis), -1, 1)) *
                        (float)(180 / M_PI);
    const float iris = branch_ramp(angle, PUPIL, PUPIL + SOFT);
    const float white = branch_ramp(angle, IRIS - SOFT, IRIS + SOFT);

    part[0] = (1 - iris) * (1 - white);
    part[1] = iris * (1 - white);
    part[2] = white;
}

void avatar_eyes_make(struct head_avatar *a, const struct head *h,
                      const struct densify *d)
{
    float axis[2][3] = {{0, 0, 1}, {0, 0, 1}};

    for (int left = 0; left < 2; left++)
        eyes_axis(axis[left], h, left);
    memcpy(a->eye_color, eyes_common, sizeof eyes_common);
    for (size_t k = 0; k < a->points; k++) {
        size_t end[2];
        float x[3];

        densify_ends(end, d, k);
        for (size_t c = 0; c < 3; c++)
            x[c] = 0.5f * (h->v_template[3 * end[0] + c] +
                           h->v_template[3 * end[1] + c]);
        a->side[k] = h->v_template[3 * end[0]] > 0 ? 1 : -1;
        if (h->region && h->region[end[0]] == REGION_EYEBALL &&
            h->region[end[1]] == REGION_EYEBALL)
            eyes_parts(a->eyeball + 3 * k, x, axis[x[0] > 0], h);
    }
    for (int left = 0; left < 2; left++)
        eyes_make_lid(a, left ? 1 : -1, h, d);
}
