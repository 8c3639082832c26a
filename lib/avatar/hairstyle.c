/* Bayes' rule over ways to wear hair (hairstyle.h). */
#include "lib/avatar/hairstyle.h"

#include <math.h>
#include <stdbool.h>

#include "lib/avatar/branch.h"

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

float hairstyle_likeness(const float rgb[3], const float face[3],
                         const struct head_avatar *a)
{
    const float sum = rgb[0] + rgb[1] + rgb[2] + 1e-3f;
    const float face_sum = face[0] + face[1] + face[2] + 1e-3f;
    const float light = fminf(fmaxf(logf(sum / face_sum), -3), 1);
    const float *w = a->hair_look;
    float hue = 0;

    for (int c = 0; c < 3; c++)
        hue += fabsf(rgb[c] / sum - face[c] / face_sum);
    hue = fminf(hue, 0.3f);
    return 1 / (1 + expf(-(w[0] + (w[1] + w[2] * hue) * hue +
                           (w[3] + w[4] * light) * light)));
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
                             logf(p * (1 - like[v]) + (1 - p) * like[v]);
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
    const float yes = hair * (1 - like), no = (1 - hair) * like;

    return yes + no > 0 ? yes / (yes + no) : hair;
}

void hairstyle_layers(const struct hairstyle_layers *to,
                      const struct white_point_colors *seen, const float *held,
                      const struct head *h, const struct densify *d)
{
    const size_t N = d->V + d->E;
    float face[3], share[HAIR_STYLES], *likeness = to->skin;
    const bool known = white_point_mean(face, seen, h, REGION_FACE, 0) > 1;

    for (size_t k = 0; k < N; k++)
        likeness[k] = known ? hairstyle_likeness(seen->pixel + 4 * k, face,
                                                 &h->avatar) : 0.5f;
    if (known) {
        hairstyle_find(share, held, likeness, &h->avatar);
        hairstyle_expect(to->hair, share, &h->avatar, d);
    }
    for (size_t k = 0; k < N; k++) {
        const float hair = hairstyle_posterior(to->hair[k], likeness[k]);
        size_t end[2];

        densify_ends(end, d, k);
        to->strands[k] = seen->trust[k] * hair;
        to->skin[k] = seen->trust[k] * (1 - hair);
        if (known && h->region && h->region[end[0]] == REGION_NECK &&
            h->region[end[1]] == REGION_NECK)
            to->skin[k] *= branch_likeness(seen->pixel + 4 * k, face);
    }
}
