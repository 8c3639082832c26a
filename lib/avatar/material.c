/* Bayes' rule over ways to wear hair and cloth (material.h). */
#include "lib/avatar/material.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/base/vec3.h"

/* Each half and twice: tests/bench/README.md, "The constants of hidden hair". */
#define NEAREST 0.02f   /* to 0 and 1: a few tens of people say no more */
#define CORRELATED 20   /* vertices whose colours say the same, since one shade
                         * covers many; as many must show a material */
#define LOG_ODDS_MAX 3  /* of a colour */
#define STEPS 2         /* of EM */

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

float material_limited(float chance)
{
    return clampf(chance, NEAREST, 1 - NEAREST);
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

struct material_share material_find(const float *likelihood, const float *seen,
                                    const float *odds,
                                    const struct head_avatar *a)
{
    double log_of[HEAD_STYLES][HEAD_STYLES], max = -INFINITY, sum = 0;
    struct material_share share = {0};

    for (size_t s = 0; s < HEAD_STYLES; s++)
        for (size_t t = 0; t < HEAD_STYLES; t++) {
            double *to = &log_of[s][t];

            *to = log((double)a->hair_share[s] + 1e-9) +
                  log((double)a->cloth_share[t] + 1e-9) + (double)likelihood[s];
            for (size_t v = 0; v < a->V; v++)
                if (seen[v] > 0)
                    *to += (double)(seen[v] / CORRELATED *
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

static void material_features(float f[MATERIAL_FEATURES], const float rgb[3])
{
    const float sum = rgb[0] + rgb[1] + rgb[2] + 0.03f;

    f[0] = logf(sum);
    for (int k = 1; k < MATERIAL_FEATURES; k++)
        f[k] = (rgb[k - 1] + 0.01f) / sum;
}

/* log of how likely a colour's features are of a material, but for a constant. */
static float material_log(const float f[MATERIAL_FEATURES],
                          const struct material_colors *colors)
{
    float sum = 0;

    for (int k = 0; k < MATERIAL_FEATURES; k++) {
        const float off = f[k] - colors->mean[k];

        sum -= off * off / colors->variance[k] + colors->log_variance[k];
    }
    return sum / 2;
}

void material_odds(float odds[MATERIALS], const float rgb[3],
                   const struct material_colors *colors)
{
    float f[MATERIAL_FEATURES];

    material_features(f, rgb);
    const float skin = material_log(f, colors + MATERIAL_SKIN);
    for (int m = 0; m < MATERIALS; m++) {
        const bool known = m != MATERIAL_SKIN && colors[m].total > CORRELATED &&
                           colors[MATERIAL_SKIN].total > CORRELATED;

        odds[m] = known ? expf(clampf(material_log(f, colors + m) - skin,
                                      -LOG_ODDS_MAX, LOG_ODDS_MAX)) : 1;
    }
}

/* The chance of each material at vertex v, by the chances there and the odds. */
static void material_posterior(float out[MATERIALS], const float *chance,
                               const float odds[MATERIALS], size_t v, size_t N)
{
    float sum = 1e-9f;

    for (size_t m = 0; m < MATERIALS; m++)
        sum += out[m] = chance[m * N + v] * odds[m];
    for (size_t m = 0; m < MATERIALS; m++)
        out[m] /= sum;
}

/* to (MATERIALS): weighted means and variances, by the colours before (from). */
static void material_step(struct material_colors *to,
                          const struct material_colors *from, const float *chance,
                          const struct white_point_colors *seen,
                          const float *held, const struct densify *d)
{
    /* standard deviations, of shading and of a shade's hue */
    static const float min_deviation[MATERIAL_FEATURES] = {0.25f, 0.02f, 0.02f};

    memset(to, 0, MATERIALS * sizeof *to);
    for (size_t v = 0; v < d->V; v++) {
        float part[MATERIALS], odds[MATERIALS], f[MATERIAL_FEATURES];

        material_odds(odds, seen->pixel + 4 * v, from);
        material_posterior(part, chance, odds, v, d->V + d->E);
        material_features(f, seen->pixel + 4 * v);
        for (int m = 0; m < MATERIALS; m++) {
            const float w = held[v] * part[m];

            to[m].total += w;
            for (int k = 0; k < MATERIAL_FEATURES; k++) {
                to[m].mean[k] += w * f[k];
                to[m].variance[k] += w * f[k] * f[k];
            }
        }
    }
    for (int m = 0; m < MATERIALS; m++)
        for (int k = 0; k < MATERIAL_FEATURES; k++) {
            float *mean = to[m].mean + k, *variance = to[m].variance + k;

            *mean /= to[m].total + 1e-6f;
            *variance = fmaxf(*variance / (to[m].total + 1e-6f) -
                              *mean * *mean, 0) +
                        min_deviation[k] * min_deviation[k];
            to[m].log_variance[k] = logf(*variance);
        }
}

void material_learn(struct material_colors *colors, float *chance,
                    const struct white_point_colors *seen, const float *held,
                    const struct head_avatar *a, const struct densify *d)
{
    const struct material_share all = material_all(a);
    struct material_colors from[MATERIALS] = {0};

    material_expect(chance, &all, a, d);
    for (int step = 0; step < STEPS; step++) {
        material_step(colors, from, chance, seen, held, d);
        memcpy(from, colors, sizeof from);
    }
}

/* ---- a person -------------------------------------------------------------- */

struct material_share material_person(float *odds,
                                      const struct material_colors *colors,
                                      const float *likelihood,
                                      const struct white_point_colors *seen,
                                      const float *held,
                                      const struct head_avatar *a,
                                      const struct densify *d)
{
    for (size_t k = 0; k < d->V + d->E; k++)
        material_odds(odds + MATERIALS * k, seen->pixel + 4 * k, colors);
    return material_find(likelihood, held, odds, a);
}

/* A point's chances (MATERIALS, N apart) by their squares: what is half skin and half
 * hair has a colour that neither has, and is less often right than the likelier. */
static void material_decide(float *chance, size_t N)
{
    float sum = 1e-9f;

    for (size_t m = 0; m < MATERIALS; m++)
        sum += chance[m * N] * chance[m * N];
    for (size_t m = 0; m < MATERIALS; m++)
        chance[m * N] *= chance[m * N] / sum;
}

void material_layers(struct material_colors *colors, float *trust, float *chance,
                     float *odds, const float *likelihood,
                     const struct white_point_colors *seen, const float *held,
                     const struct head_avatar *a, const struct densify *d)
{
    const size_t N = d->V + d->E;

    material_learn(colors, chance, seen, held, a, d);
    const struct material_share share = material_person(odds, colors, likelihood,
                                                        seen, held, a, d);

    material_expect(chance, &share, a, d);
    for (size_t k = 0; k < N; k++) {
        float part[MATERIALS];

        material_posterior(part, chance, odds + MATERIALS * k, k, N);
        for (size_t m = 0; m < MATERIALS; m++)
            trust[m * N + k] = seen->trust[k] * part[m];
        material_decide(chance + k, N);
    }
}
