/* The colours of closed lids: at the crease what is above it, at the margin
 * the skin about the eye, in between a mixture.  (The crease lies in the
 * shadow of the brow; a lid of its colour alone is a bruise.) */
#include "lib/avatar/lid_skin.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/avatar/branch.h"

#define ABOUT_MM 16.0f      /* skin so far from a lid lends its colour */
#define LENT 0.8f           /* share of that colour at the margin */
#define LASHES 0.4f        /* lashes are at most so bright, of their lid */

/* One lid: where it is, and how far it comes down, head units. */
struct lid_skin_lid {
    bool left;              /* the subject's */
    float middle[3], most;
};

/* Whether vertex or midpoint k is of that lid. */
static bool lid_skin_is_on_lid(const struct lid_skin_lid *lid, size_t k,
                               const struct head *h,
                               const struct head_avatar *w,
                               const struct densify *d)
{
    size_t end[2];

    densify_ends(end, d, k);
    return w->lid[k] > 0 && (h->v_template[3 * end[0]] > 0) == lid->left;
}

/* How far vertex or midpoint k comes down when both eyes close, head units. */
static float lid_skin_descent(size_t k, const struct head *h,
                              const struct densify *d)
{
    const float *l = h->l_eyelid + 1, *r = h->r_eyelid + 1;
    size_t end[2];

    densify_ends(end, d, k);
    return -0.5f * (l[3 * end[0]] + r[3 * end[0]] +
                    l[3 * end[1]] + r[3 * end[1]]);
}

/* Find a lid; false: the head has none. */
static bool lid_skin_find(struct lid_skin_lid *lid, const float *verts,
                          const struct head *h, const struct head_avatar *w,
                          const struct densify *d)
{
    float sum = 0;

    lid->most = 0;
    memset(lid->middle, 0, sizeof lid->middle);
    for (size_t v = 0; v < d->V; v++)
        if (lid_skin_is_on_lid(lid, v, h, w, d)) {
            sum += w->lid[v];
            for (int c = 0; c < 3; c++)
                lid->middle[c] += w->lid[v] * verts[3 * v + c];
            lid->most = fmaxf(lid->most, lid_skin_descent(v, h, d));
        }
    for (int c = 0; c < 3; c++)
        lid->middle[c] /= fmaxf(sum, 1e-6f);
    return sum > 0;
}

/* weight (V): how far vertices about x (3) say what skin is there; neither
 * brows nor eyes do. */
static void lid_skin_weights_near(float *weight, const float x[3],
                                  const struct lid_skin_source *s,
                                  const struct head *h)
{
    const float far = ABOUT_MM * 1e-3f * h->scale;

    for (size_t v = 0; v < h->V; v++) {
        const float *at = s->verts + 3 * v;
        const int region = h->region ? h->region[v] : REGION_FACE;
        float d2 = 0;

        for (int c = 0; c < 3; c++)
            d2 += (at[c] - x[c]) * (at[c] - x[c]);
        weight[v] = 0;
        if (d2 <= 9 * far * far &&
            (region == REGION_FACE || region == REGION_SKIN))
            weight[v] = s->trust[v] * expf(-0.5f * d2 / (far * far));
    }
}

/* Skin, and on the margin, which does not come out of the crease, lashes. */
static void lid_skin_paint(float *rgb, const struct lid_skin_lid *lid,
                           const float skin[3],
                           const struct lid_skin_source *s,
                           const struct head *h, const struct head_avatar *w,
                           const struct densify *d)
{
    for (size_t k = 0; k < d->V + d->E; k++) {
        float down, lash;

        if (!lid_skin_is_on_lid(lid, k, h, w, d))
            continue;
        down = fmaxf(lid_skin_descent(k, h, d) / lid->most, 0);
        lash = w->lid[k] - w->fold[k];
        for (int c = 0; c < 3; c++) {
            float *own = rgb + 3 * k + c;

            *own += LENT * down * (skin[c] - *own);
            *own += lash * (fminf(s->pixel[4 * k + c], LASHES * *own) - *own);
        }
    }
}

void lid_skin(float *rgb, const struct lid_skin_source *s,
              const struct head *h, const struct head_avatar *w,
              const struct densify *d, float *tmp)
{
    for (int left = 0; left < 2; left++) {
        struct lid_skin_lid lid = {.left = left};
        float skin[3];

        if (!lid_skin_find(&lid, s->verts, h, w, d))
            continue;
        lid_skin_weights_near(tmp, lid.middle, s, h);
        if (branch_mean_color(skin, s->pixel, tmp, h->V, 0) < 1)
            continue;
        branch_mean_color(skin, s->pixel, tmp, h->V,
                          (skin[0] + skin[1] + skin[2]) / 3);
        lid_skin_paint(rgb, &lid, skin, s, h, w, d);
    }
}
