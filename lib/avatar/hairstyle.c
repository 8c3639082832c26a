/* Bayes' rule over ways to wear hair (hairstyle.h). */
#include "lib/avatar/hairstyle.h"

#include <math.h>
#include <string.h>

#include "lib/avatar/branch.h"

#define LIKE_SKIN 0.05f         /* of hair, and of a bald scalp, is like the
                                 * face, and */
#define UNLIKE_SKIN 0.3f        /* of skin is not */
#define NEAREST 0.02f           /* a chance is no nearer to 0 or 1 */
#define ALIKE 4                 /* vertices that say the same: a lock is 1 cm */

void hairstyle_expect(float *hair, const float share[HAIR_STYLES],
                      const struct head_avatar *a, const struct densify *d)
{
    for (size_t v = 0; v < d->V; v++) {
        hair[v] = 0;
        for (size_t s = 0; s < HAIR_STYLES; s++)
            hair[v] += share[s] * a->hair[HAIR_STYLES * v + s];
    }
    densify_midpoints(hair + d->V, hair, d, 1);
}

static float hairstyle_as_hair(float like)
{
    return 1 - like + LIKE_SKIN * like;
}

static float hairstyle_as_skin(float like)
{
    return like + UNLIKE_SKIN * (1 - like);
}

void hairstyle_find(float share[HAIR_STYLES], const float *seen,
                    const float *like, const struct head_avatar *a)
{
    double log_of[HAIR_STYLES], most = -INFINITY, sum = 0;

    for (size_t s = 0; s < HAIR_STYLES; s++) {
        log_of[s] = log((double)a->hair_share[s] + 1e-9);
        for (size_t v = 0; v < a->V; v++) {
            const float p = fminf(fmaxf(a->hair[HAIR_STYLES * v + s], NEAREST),
                                  1 - NEAREST);

            if (seen[v] > 0)
                log_of[s] += seen[v] / ALIKE *
                             logf(p * hairstyle_as_hair(like[v]) +
                                  (1 - p) * hairstyle_as_skin(like[v]));
        }
        most = fmax(most, log_of[s]);
    }
    for (size_t s = 0; s < HAIR_STYLES; s++)
        sum += exp(log_of[s] - most);
    for (size_t s = 0; s < HAIR_STYLES; s++)
        share[s] = (float)(exp(log_of[s] - most) / sum);
}

float hairstyle_posterior(float hair, float like)
{
    const float yes = hair * hairstyle_as_hair(like);
    const float no = (1 - hair) * hairstyle_as_skin(like);

    return yes / (yes + no);
}

void hairstyle_layers(const struct hairstyle_layers *to,
                      const struct white_point_colors *seen, const float *held,
                      const struct head *h, const struct densify *d)
{
    const size_t N = d->V + d->E;
    float skin[3], share[HAIR_STYLES], *likeness = to->skin;

    memset(likeness, 0, N * sizeof *likeness);
    if (white_point_mean(skin, seen, h, REGION_FACE, 0) > 1) {
        for (size_t k = 0; k < N; k++)
            likeness[k] = branch_likeness(seen->pixel + 4 * k, skin);
        hairstyle_find(share, held, likeness, &h->avatar);
        hairstyle_expect(to->hair, share, &h->avatar, d);
    }
    for (size_t k = 0; k < N; k++) {
        const float like = likeness[k];
        const float hair = hairstyle_posterior(to->hair[k], like);
        size_t end[2];

        densify_ends(end, d, k);
        to->strands[k] = seen->trust[k] * hair;
        to->skin[k] = seen->trust[k] * (1 - hair);
        if (h->region && h->region[end[0]] == REGION_NECK &&
            h->region[end[1]] == REGION_NECK)
            to->skin[k] *= like;
    }
}
