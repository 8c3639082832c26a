/* Bayes' rule over ways to wear hair and cloth (material.h). */
#include "lib/avatar/material.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define NEAREST 0.02f
#define ALIKE 20        /* vertices whose colours say the same, since one shade
                         * covers many: tests/bench/README.md, "Hidden hair stands
                         * off" */
#define SURE 3          /* log odds of a colour at most: 5 decides the same */

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

float material_limited(float chance)
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

struct material_share material_find(const float *beside, const float *seen,
                                    const float *odds,
                                    const struct head_avatar *a)
{
    double log_of[HEAD_STYLES][HEAD_STYLES], max = -INFINITY, sum = 0;
    struct material_share share = {0};

    for (size_t s = 0; s < HEAD_STYLES; s++)
        for (size_t t = 0; t < HEAD_STYLES; t++) {
            double *to = &log_of[s][t];

            *to = log((double)a->hair_share[s] + 1e-9) +
                  log((double)a->cloth_share[t] + 1e-9) + (double)beside[s];
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

/* ---- a person's own colours ---------------------------------------------- */

enum { FEATURES = 3 };          /* of a colour: brightness, shares of red and green */

/* What is known of a material's colours: weight, means and variances. */
struct material_look {
    float total, mean[FEATURES], variance[FEATURES];
};

static void material_features(float f[FEATURES], const float rgb[3])
{
    const float sum = rgb[0] + rgb[1] + rgb[2] + 0.03f;

    f[0] = logf(sum);
    for (int k = 1; k < FEATURES; k++)
        f[k] = (rgb[k - 1] + 0.01f) / sum;
}

/* The chance of each material at vertex v, by the chances there and the odds. */
static void material_posterior(float out[MATERIALS], const float *chance,
                               const float *odds, size_t v, size_t N)
{
    float sum = 1e-9f;

    for (size_t m = 0; m < MATERIALS; m++)
        sum += out[m] = chance[m * N + v] * odds[MATERIALS * v + m];
    for (size_t m = 0; m < MATERIALS; m++)
        out[m] /= sum;
}

/* look (MATERIALS): of the colours pixel (V,4), by how far each vertex is held and
 * how likely it is of which. */
static void material_looks(struct material_look *look, const float *chance,
                           const float *odds, const float *pixel,
                           const float *held, const struct densify *d)
{
    static const float least[FEATURES] = {0.25f, 0.02f, 0.02f};

    memset(look, 0, MATERIALS * sizeof *look);
    for (size_t v = 0; v < d->V; v++) {
        float part[MATERIALS], f[FEATURES];

        material_posterior(part, chance, odds, v, d->V + d->E);
        material_features(f, pixel + 4 * v);
        for (int m = 0; m < MATERIALS; m++) {
            const float w = held[v] * part[m];

            look[m].total += w;
            for (int k = 0; k < FEATURES; k++) {
                look[m].mean[k] += w * f[k];
                look[m].variance[k] += w * f[k] * f[k];
            }
        }
    }
    for (int m = 0; m < MATERIALS; m++)
        for (int k = 0; k < FEATURES; k++) {
            float *mean = look[m].mean + k, *variance = look[m].variance + k;

            *mean /= look[m].total + 1e-6f;
            *variance = fmaxf(*variance / (look[m].total + 1e-6f) -
                              *mean * *mean, 0) + least[k] * least[k];
        }
}

/* log of how likely a colour's features are of a material, but for a constant. */
static float material_log(const float f[FEATURES],
                          const struct material_look *look)
{
    float sum = 0;

    for (int k = 0; k < FEATURES; k++) {
        const float off = f[k] - look->mean[k];

        sum -= off * off / look->variance[k] + logf(look->variance[k]);
    }
    return sum / 2;
}

/* odds (V+E,MATERIALS), by what people's colours are, become those by this person's:
 * a material's are about the mean of where all people have it and the odds say so (a
 * step of EM), and normal. */
static void material_own_odds(float *odds, float *chance,
                              const struct white_point_colors *seen,
                              const float *held, const struct head_avatar *a,
                              const struct densify *d)
{
    const struct material_share all = material_all(a);
    struct material_look look[MATERIALS];

    material_expect(chance, &all, a, d);
    material_looks(look, chance, odds, seen->pixel, held, d);
    for (size_t i = 0; i < d->V + d->E; i++) {
        float f[FEATURES];

        material_features(f, seen->pixel + 4 * i);
        const float skin = material_log(f, look + MATERIAL_SKIN);
        for (size_t m = MATERIAL_HAIR; m < MATERIALS; m++)
            if (look[m].total > ALIKE && look[MATERIAL_SKIN].total > ALIKE)
                odds[MATERIALS * i + m] = expf(
                    fminf(fmaxf(material_log(f, look + m) - skin, -SURE),
                          SURE));
    }
}

/* ---- a person -------------------------------------------------------------- */

struct material_share material_person(float *odds, float *chance,
                                      const float *beside,
                                      const struct white_point_colors *seen,
                                      const float *held, const struct head *h,
                                      const struct densify *d)
{
    const size_t N = d->V + d->E;
    float face[3];

    for (size_t i = 0; i < MATERIALS * N; i++)
        odds[i] = 1;
    if (white_point_mean(face, seen, h, REGION_FACE, 0) <= 1)
        return material_all(&h->avatar);
    for (size_t k = 0; k < N; k++)
        material_odds(odds + MATERIALS * k, seen->pixel + 4 * k, face,
                      &h->avatar);
    material_own_odds(odds, chance, seen, held, &h->avatar, d);
    return material_find(beside, held, odds, &h->avatar);
}

void material_layers(float *trust, float *chance, float *odds,
                     const float *beside,
                     const struct white_point_colors *seen, const float *held,
                     const struct head *h, const struct densify *d)
{
    const size_t N = d->V + d->E;
    const struct material_share share = material_person(odds, chance, beside,
                                                        seen, held, h, d);

    material_expect(chance, &share, &h->avatar, d);
    for (size_t k = 0; k < N; k++) {
        float part[MATERIALS];

        material_posterior(part, chance, odds, k, N);
        for (size_t m = 0; m < MATERIALS; m++)
            trust[m * N + k] = seen->trust[k] * part[m];
    }
}
