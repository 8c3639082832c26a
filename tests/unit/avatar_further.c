/* Sums over further pictures against the same in double, and what they are for:
 * the picture that saw a point best says its colour (further.h). */
#include <math.h>
#include <string.h>

#include "lib/avatar/further.h"
#include "lib/base/random.h"
#include "tests/check.h"

enum { N = 301, PICTURES = 3 };

struct view {
    float pixel[4 * N], trust[N], facing[N];
};

static void further_random(struct view *v, struct random *r)
{
    for (size_t i = 0; i < 4 * N; i++)
        v->pixel[i] = (float)random_uniform(r);
    for (size_t k = 0; k < N; k++) {
        v->facing[k] = (float)(2 * random_uniform(r) - 1);
        v->trust[k] = v->facing[k] > 0 ? (float)random_uniform(r) : 0;
    }
}

static struct further_picture further_of(const struct view *v)
{
    return (struct further_picture){v->pixel, v->trust, v->facing};
}

static void further_known(float *known, const struct view *v)
{
    for (size_t k = 0; k < N; k++) {
        memcpy(known + 4 * k, v->pixel + 4 * k, 3 * sizeof *known);
        known[4 * k + 3] = v->trust[k];
    }
}

/* The colour of point k in channel c, and the trust, from all pictures. */
static double further_reference(double *trust, const struct view *v, size_t k,
                                size_t c)
{
    double sum = 0, weights = 0;

    *trust = 0;
    for (size_t i = 0; i < PICTURES; i++) {
        const double t = (double)v[i].trust[k];
        const double w = pow(t * fmax((double)v[i].facing[k], 0), 2);
        double gain[2] = {10, 10};

        for (size_t j = 0; j < N; j++) {
            const double both = (double)v[0].trust[j] * (double)v[i].trust[j];

            gain[0] += both * (double)v[0].pixel[4 * j + c];
            gain[1] += both * (double)v[i].pixel[4 * j + c];
        }
        sum += w * fmin(sqrt(gain[0] / gain[1]) *
                        (double)v[i].pixel[4 * k + c], 1);
        weights += w;
        *trust = fmax(*trust, w > 0 ? t : 0);
    }
    return weights > 0 ? sum / weights : (double)v[0].pixel[4 * k + c];
}

static void further_matches(void)
{
    static struct view v[PICTURES];
    static float known[4 * N], sums[FURTHER_SUMS * N], rgb[3 * N];
    struct random r;
    double off = 0, doubt = 0;

    random_init(&r, 7, "further");
    for (size_t i = 0; i < PICTURES; i++)
        further_random(v + i, &r);
    further_known(known, v);
    for (size_t i = 1; i < PICTURES; i++) {
        const struct further_picture p = further_of(v + i);
        float gain[3];

        further_gain(gain, &p, known, N);
        further_add(sums, &p, gain, N);
    }
    struct view all = v[0];
    for (size_t i = 0; i < 3 * N; i++)
        rgb[i] = all.pixel[i / 3 * 4 + i % 3];
    further_take(all.pixel, all.trust, rgb, all.facing, sums, N);
    for (size_t i = 0; i < 3 * N; i++) {
        double trust;
        const double want = further_reference(&trust, v, i / 3, i % 3);

        off = fmax(off, fabs((double)rgb[i] - want));
        off = fmax(off, fabs((double)all.pixel[i / 3 * 4 + i % 3] - want));
        doubt = fmax(doubt, fabs((double)all.trust[i / 3] - trust));
    }
    check("colours, as in double", off, 1e-5);
    check("trust, as in double", doubt, 1e-6);
}

/* A picture beside itself, and one with twice the light where they meet. */
static void further_means(void)
{
    static struct view v, dim;
    static float known[4 * N], sums[FURTHER_SUMS * N], rgb[3 * N];
    struct further_picture p = further_of(&v);
    struct random r;
    float gain[3];
    double off = 0;

    random_init(&r, 8, "further");
    further_random(&v, &r);
    further_known(known, &v);
    further_gain(gain, &p, known, N);
    further_add(sums, &p, gain, N);
    struct view same = v;
    further_take(same.pixel, same.trust, rgb, same.facing, sums, N);
    for (size_t i = 0; i < 4 * N; i++)
        off = fmax(off, fabs((double)(same.pixel[i] - v.pixel[i])));
    check("the same picture again changes nothing", off, 1e-6);
    check_that("nor its trust", !memcmp(same.trust, v.trust, sizeof v.trust));

    dim = v;
    for (size_t i = 0; i < 4 * N; i++)
        dim.pixel[i] *= 0.5f;
    p = further_of(&dim);
    further_gain(gain, &p, known, N);
    check_range("half the light: the gain's square", (double)(gain[0] * gain[0]),
                1.5, 2);
    memset(dim.trust, 0, sizeof dim.trust);
    further_gain(gain, &p, known, N);
    expect("nothing in common: no gain", (double)gain[1], 1, 0);
}

/* Seen at 80 degrees by one, from the front by the other. */
static void further_best(void)
{
    const float facing[2] = {0.17f, 1}, trust[2] = {0.3f, 1}, one[3] = {1, 1, 1};
    const float front[4] = {0.8f, 0.6f, 0.4f, 1};
    float side[4] = {0.1f, 0.1f, 0.1f, 1}, sums[FURTHER_SUMS] = {0}, rgb[3];
    float own = trust[0];
    const struct further_picture p = {front, trust + 1, facing + 1};

    further_add(sums, &p, one, 1);
    further_take(side, &own, rgb, facing, sums, 1);
    expect("the one that saw it best", (double)rgb[0], 0.8, 0.01);
    expect("trust in that", (double)own, 1, 0);
    expect("the matte stays", (double)side[3], 1, 0);
}

int main(void)
{
    further_matches();
    further_means();
    further_best();
    return check_status();
}
