/* Bayes' rule over ways to wear hair and cloth (material.h). */
#include "lib/avatar/material.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define NEAREST 0.02f           /* a chance is no nearer to 0 or 1 */
#define ALIKE 4                 /* vertices that say the same: a lock is 1 cm */

struct material_share material_all(const struct head_avatar *a)
{
    struct material_share all;

    memcpy(all.hair, a->hair_share, sizeof all.hair);
    memcpy(all.cloth, a->cloth_share, sizeof all.cloth);
    return all;
}

void material_expect(float *chance, const struct material_share *share,
                     const struct head_avatar *a, const struct densify *d)
{
    const size_t N = d->V + d->E;
    float *skin = chance, *hair = skin + N, *cloth = hair + N;

    for (size_t v = 0; v < d->V; v++) {
        hair[v] = cloth[v] = 0;
        for (size_t s = 0; s < HEAD_STYLES; s++) {
            hair[v] += share->hair[s] * a->hair[HEAD_STYLES * v + s];
            cloth[v] += share->cloth[s] * a->cloth[HEAD_STYLES * v + s];
        }
        cloth[v] *= 1 - hair[v];
        skin[v] = 1 - hair[v] - cloth[v];
    }
    for (int m = 0; m < MATERIALS; m++)
        densify_midpoints(chance + (size_t)m * N + d->V,
                          chance + (size_t)m * N, d, 1);
}

void material_odds(float odds[MATERIALS], const float rgb[3],
                   const float face[3], const struct head_avatar *a)
{
    const float sum = rgb[0] + rgb[1] + rgb[2] + 1e-3f;
    const float face_sum = face[0] + face[1] + face[2] + 1e-3f;
    const float light = fminf(fmaxf(logf(sum / face_sum), -3), 1);
    float hue = 0;

    for (int c = 0; c < 3; c++)
        hue += fabsf(rgb[c] / sum - face[c] / face_sum);
    hue = fminf(hue, 0.3f);
    odds[MATERIAL_SKIN] = 1;
    for (int m = MATERIAL_HAIR; m < MATERIALS; m++) {
        const float *w = a->look + HEAD_LOOKS * (m - MATERIAL_HAIR);

        odds[m] = expf(-(w[0] + (w[1] + w[2] * hue) * hue +
                         (w[3] + w[4] * light) * light));
    }
}

static float material_limited(float chance)
{
    return fminf(fmaxf(chance, NEAREST), 1 - NEAREST);
}

/* log of how likely what vertex v shows is in ways s to wear hair and t, cloth. */
static float material_likelihood(const float odds[MATERIALS], size_t v,
                                 size_t s, size_t t,
                                 const struct head_avatar *a)
{
    const float hair = material_limited(a->hair[HEAD_STYLES * v + s]);
    const float cloth = material_limited(a->cloth[HEAD_STYLES * v + t]);

    return logf(hair * odds[MATERIAL_HAIR] +
                (1 - hair) * (cloth * odds[MATERIAL_CLOTH] + 1 - cloth));
}

struct material_share material_find(const float *seen, const float *odds,
                                    const struct head_avatar *a)
{
    double log_of[HEAD_STYLES][HEAD_STYLES], max = -INFINITY, sum = 0;
    struct material_share share = {0};

    for (size_t s = 0; s < HEAD_STYLES; s++)
        for (size_t t = 0; t < HEAD_STYLES; t++) {
            double *to = &log_of[s][t];

            *to = log((double)a->hair_share[s] + 1e-9) +
                  log((double)a->cloth_share[t] + 1e-9);
            for (size_t v = 0; v < a->V; v++)
                if (seen[v] > 0)
                    *to += (double)(seen[v] / ALIKE *
                                    material_likelihood(odds + MATERIALS * v, v,
                                                        s, t, a));
            max = fmax(max, *to);
        }
    for (size_t s = 0; s < HEAD_STYLES; s++)
        for (size_t t = 0; t < HEAD_STYLES; t++)
            sum += exp(log_of[s][t] - max);
    for (size_t s = 0; s < HEAD_STYLES; s++)
        for (size_t t = 0; t < HEAD_STYLES; t++) {
            const float part = (float)(exp(log_of[s][t] - max) / sum);

            share.hair[s] += part;
            share.cloth[t] += part;
        }
    return share;
}

void material_layers(float *trust, float *chance, float *tmp,
                     const struct white_point_colors *seen, const float *held,
                     const struct head *h, const struct densify *d)
{
    const size_t N = d->V + d->E;
    float face[3], *odds = tmp;
    const bool known = white_point_mean(face, seen, h, REGION_FACE, 0) > 1;

    for (size_t i = 0; i < MATERIALS * N; i++)
        odds[i] = 1;
    for (size_t k = 0; known && k < N; k++)
        material_odds(odds + MATERIALS * k, seen->pixel + 4 * k, face,
                      &h->avatar);
    if (known) {
        const struct material_share share = material_find(held, odds,
                                                          &h->avatar);
        material_expect(chance, &share, &h->avatar, d);
    }
    for (size_t k = 0; k < N; k++) {
        float sum = 1e-9f;

        for (size_t m = 0; m < MATERIALS; m++)
            sum += chance[m * N + k] * odds[MATERIALS * k + m];
        for (size_t m = 0; m < MATERIALS; m++)
            trust[m * N + k] = seen->trust[k] * chance[m * N + k] *
                               odds[MATERIALS * k + m] / sum;
    }
}
