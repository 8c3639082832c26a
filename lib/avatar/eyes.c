/* Colours of closed lids and of shut eyes' eyeballs (eyes.h). */
#include "lib/avatar/eyes.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/avatar/branch.h"

#define OPEN 0.6f           /* share of the lid's way: open up to here, */
#define SHUT 0.85f          /* shut from here on */
#define LASHES 0.4f         /* lashes are at most so bright, of their lid */
#define TELLS 2             /* visible points of an iris that suffice */

enum { PUPIL, IRIS, WHITE, PARTS };

/* ---- which eyes are shut -------------------------------------------------- */

/* The share of the way lid (V,3) that the vertices have gone from rest, by
 * least squares. */
static float eyes_closure(const float *posed, const float *rest,
                          const float *lid, size_t V)
{
    double gone = 0, all = 1e-12;

    for (size_t i = 0; i < 3 * V; i++) {
        gone += (double)lid[i] * (posed[i] - rest[i]);
        all += (double)lid[i] * lid[i];
    }
    return (float)(gone / all);
}

void eyes_find_shut(float shut[2], const float *posed, const float *rest,
                    const struct head *h)
{
    const float *lid[2] = {h->l_eyelid, h->r_eyelid};

    for (int e = 0; e < 2; e++)
        shut[e] = branch_ramp(eyes_closure(posed, rest, lid[e], h->V), OPEN,
                              SHUT);
}

/* Whose point k is. */
static enum eyes_side eyes_side(const struct head_avatar *a, size_t k)
{
    return a->side[k] > 0 ? EYE_LEFT : EYE_RIGHT;
}

/* Whether it is of an eyeball. */
static float eyes_ball(const struct head_avatar *a, size_t k)
{
    const float *part = a->eyeball + PARTS * k;

    return part[PUPIL] + part[IRIS] + part[WHITE];
}

void eyes_stretch(float *spacing, const float shut[2],
                  const struct head_avatar *a)
{
    for (size_t k = 0; k < a->points; k++)
        spacing[k] *= 1 + (a->stretch[k] - 1) * (1 - shut[eyes_side(a, k)]);
}

void eyes_hide(float *seen, const float shut[2], const struct head_avatar *a)
{
    for (size_t k = 0; k < a->points; k++)
        if (eyes_ball(a, k) > 0)
            seen[k] *= 1 - shut[eyes_side(a, k)];
}

/* ---- lids ------------------------------------------------------------------ */

/* rgb (3): the brighter skin about an eye; false where too little is seen. */
static bool eyes_skin(float rgb[3], enum eyes_side e,
                      const struct eyes_photo *p, const struct head_avatar *a,
                      float *tmp)
{
    for (size_t v = 0; v < a->V; v++)
        tmp[v] = p->trust[v] * a->about_eye[2 * v + e];
    if (branch_mean_color(rgb, p->pixel, tmp, a->V, 0) < 1)
        return false;
    branch_mean_color(rgb, p->pixel, tmp, a->V, (rgb[0] + rgb[1] + rgb[2]) / 3);
    return true;
}

void eyes_paint_lids(float *rgb, const struct eyes_photo *p,
                     const struct head_avatar *a, float *tmp)
{
    float skin[2][3];
    const bool seen[2] = {eyes_skin(skin[0], EYE_LEFT, p, a, tmp),
                          eyes_skin(skin[1], EYE_RIGHT, p, a, tmp)};

    for (size_t k = 0; k < a->points; k++) {
        const enum eyes_side e = eyes_side(a, k);
        const float lash = a->lid[k] - a->fold[k];

        if (!(a->lid[k] > 0) || !seen[e])
            continue;
        for (int c = 0; c < 3; c++) {
            float *own = rgb + 3 * k + c;

            *own += a->lid_skin[k] * (skin[e][c] - *own);
            *own += lash * (fminf(p->pixel[4 * k + c], LASHES * *own) - *own);
        }
    }
}

/* ---- eyeballs -------------------------------------------------------------- */

/* colors (3,3) of an eye: the template's in this light, with iris and white of the
 * other eye where that one is open and shows enough of them. */
static void eyes_colors(float colors[3 * PARTS], enum eyes_side e,
                        const float shut[2], const struct eyes_photo *p,
                        const struct head_avatar *a, float *tmp)
{
    for (int i = 0; i < 3 * PARTS; i++)
        colors[i] = a->eye_color[i] * p->white[i % 3];
    for (int part = IRIS; part < PARTS && !(shut[!e] > 0); part++) {
        float mean[3];

        for (size_t k = 0; k < a->points; k++)
            tmp[k] = eyes_side(a, k) != e &&
                     a->eyeball[PARTS * k + (size_t)part] > 0.99f
                         ? p->trust[k] : 0;
        if (branch_mean_color(mean, p->pixel, tmp, a->points, 0) > TELLS)
            memcpy(colors + 3 * part, mean, sizeof mean);
    }
}

void eyes_paint_balls(float *rgb, const float shut[2],
                      const struct eyes_photo *p, const struct head_avatar *a,
                      float *tmp)
{
    float colors[2][3 * PARTS];

    if (!(shut[EYE_LEFT] > 0 || shut[EYE_RIGHT] > 0))
        return;
    for (int e = 0; e < 2; e++)
        eyes_colors(colors[e], e, shut, p, a, tmp);
    for (size_t k = 0; k < a->points; k++) {
        const enum eyes_side e = eyes_side(a, k);
        const float *part = a->eyeball + PARTS * k;

        if (!(eyes_ball(a, k) > 0))
            continue;
        for (int c = 0; c < 3; c++) {
            const float own = part[PUPIL] * colors[e][c] +
                              part[IRIS] * colors[e][3 + c] +
                              part[WHITE] * colors[e][6 + c];

            rgb[3 * k + c] += shut[e] * (own - rgb[3 * k + c]);
        }
    }
}
