/* Poisson completion of the head's colours (completion.h). */
#include "lib/avatar/completion.h"

#include <math.h>
#include <string.h>

#define KEEP 10.0f      /* weight of a trusted colour, for one of a step */
#define ANCHOR 0.02f    /* of the mirror image's, where there is no other: lights
                         * differ from side to side */
#define FLAT 0.02f      /* of no step, beside the trust in two ends' colours: so
                         * the ear of a photograph from the front, trusted by a
                         * fifth, keeps two thirds of its slopes.  .005 to .1
                         * differ by 0.1 dB (tests/bench/turned.sh) */
#define APART 0.001f    /* of steps where a layer is not: no colour comes across,
                         * and what is there goes on without one */
#define FLOOR 1e-4f     /* of the mean, where there is nothing at all */
#define ITERATIONS 80   /* a thousandth of the way across the head is left */

/* ---- which point lies across -------------------------------------------- */

/* The edge between two vertices, or E. */
static size_t completion_edge(const struct densify *d, size_t a, size_t b)
{
    const int32_t want[2] = {(int32_t)(a < b ? a : b), (int32_t)(a < b ? b : a)};
    size_t lo = 0, hi = d->E;

    while (lo < hi) {
        const size_t mid = (lo + hi) / 2;
        const int32_t *e = d->edge + 2 * mid;

        if (e[0] < want[0] || (e[0] == want[0] && e[1] < want[1]))
            lo = mid + 1;
        else
            hi = mid;
    }
    return lo < d->E && d->edge[2 * lo] == want[0] &&
                   d->edge[2 * lo + 1] == want[1] ? lo : d->E;
}

void completion_mirror(size_t *mirror, const size_t *vertices,
                       const struct densify *d)
{
    memmove(mirror, vertices, d->V * sizeof *mirror);
    for (size_t e = 0; e < d->E; e++) {
        const size_t to = completion_edge(d, vertices[d->edge[2 * e]],
                                          vertices[d->edge[2 * e + 1]]);

        mirror[d->V + e] = d->V + (to < d->E ? to : e);
    }
}

/* ---- the system ---------------------------------------------------------- */

/* What is solved for: weight (N) x colours, and steps along half edges.  Of a
 * midpoint that is colour = share (b + its ends' colours), share = 1 / (weight +
 * 2), so that only the vertices are sought (completion_eliminate): the same as
 * all points after twice the steps, of four times the numbers each. */
struct completion {
    const struct densify *d;
    size_t N;
    float *weight;              /* then (V) A's diagonal, (E) shares */
    float *tie;                 /* (2E) weights of the half edges' steps */
};

/* b (N,3) and the weights, midpoints taken out of the vertices' part. */
static void completion_eliminate(float *b, struct completion *c)
{
    for (size_t h = 0; h < 2 * c->d->E; h++) {
        const size_t i = (size_t)c->d->edge[h], j = c->d->V + h / 2;

        if (h % 2 == 0)
            c->weight[j] = 1 / (c->weight[j] + c->tie[h] + c->tie[h + 1]);
        c->weight[i] += c->tie[h] * (1 - c->tie[h] * c->weight[j]);
        for (size_t k = 0; k < 3; k++)
            b[3 * i + k] += c->tie[h] * c->weight[j] * b[3 * j + k];
    }
}

/* out (V,3) = A x. */
static void completion_apply(float *out, const struct completion *c,
                             const float *x)
{
    for (size_t i = 0; i < 3 * c->d->V; i++)
        out[i] = c->weight[i / 3] * x[i];
    for (size_t e = 0; e < c->d->E; e++) {
        const size_t i = 3 * (size_t)c->d->edge[2 * e];
        const size_t j = 3 * (size_t)c->d->edge[2 * e + 1];
        const float share = c->weight[c->d->V + e] * c->tie[2 * e] *
                            c->tie[2 * e + 1];

        for (size_t k = 0; k < 3; k++) {
            out[i + k] -= share * x[j + k];
            out[j + k] -= share * x[i + k];
        }
    }
}

/* mean (3): of colours rgb (N,3), by the trust in them (layers,N); where there is
 * none, it stays. */
static void completion_mean(float mean[3], const float *rgb, const float *trust,
                            size_t layers, size_t N)
{
    float total = 1e-3f;

    for (size_t k = 0; k < 3; k++)
        mean[k] *= total;
    for (size_t i = 0; i < layers * N; i++) {
        for (size_t k = 0; k < 3; k++)
            mean[k] += trust[i] * rgb[3 * (i % N) + k];
        total += trust[i];
    }
    for (size_t k = 0; k < 3; k++)
        mean[k] /= total;
}

/* b (N,3) and the weights from the photograph's colours rgb (N,3); mean (3): theirs
 * where nothing is. */
static void completion_wants(float *b, struct completion *c, const float *rgb,
                             const float *trust, const float *layer,
                             const float mean[3], const size_t *mirror)
{
    for (size_t i = 0; i < c->N; i++) {
        const float own = KEEP * trust[i];
        const float across = ANCHOR * (1 - trust[i]) * trust[mirror[i]];

        c->weight[i] = own + across + FLOOR;
        for (size_t k = 0; k < 3; k++)
            b[3 * i + k] = own * rgb[3 * i + k] +
                           across * rgb[3 * mirror[i] + k] +
                           FLOOR * mean[k];
    }
    for (size_t h = 0; h < 2 * c->d->E; h++) {
        const size_t i = (size_t)c->d->edge[h], j = c->d->V + h / 2;
        const size_t p = mirror[i], q = mirror[j];
        const float own = trust[i] * trust[j];
        const float across = (1 - own) * trust[p] * trust[q];
        const float sum = own + across + FLAT;

        c->tie[h] = APART + (1 - APART) * layer[i] * layer[j];
        for (size_t k = 0; k < 3; k++) {
            const float step = (own * (rgb[3 * j + k] - rgb[3 * i + k]) +
                                across * (rgb[3 * q + k] - rgb[3 * p + k])) /
                               sum;

            b[3 * i + k] -= c->tie[h] * step;
            b[3 * j + k] += c->tie[h] * step;
        }
    }
}

/* Sum of x y over n numbers. */
static double completion_dot(const float *x, const float *y, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += (double)x[i] * y[i];
    return sum;
}

/* z = r over A's diagonal. */
static void completion_precondition(float *z, const float *r,
                                    const struct completion *c)
{
    for (size_t i = 0; i < 3 * c->d->V; i++)
        z[i] = r[i] / c->weight[i / 3];
}

/* rgb (N,3) complete, of one layer: how far each point belongs to it (N); mean (3)
 * where it is not seen. */
static void completion_layer(float *rgb, const float *trust, const float *layer,
                             const float mean[3], const size_t *mirror,
                             const struct densify *d, float *scratch)
{
    const size_t N = d->V + d->E, n = 3 * d->V;
    float own[3] = {mean[0], mean[1], mean[2]};
    struct completion c = {d, N, scratch, scratch + N};
    float *r = c.tie + 2 * d->E, *z = r + 3 * N, *p = z + n, *Ap = p + n;

    completion_mean(own, rgb, trust, 1, N);
    completion_wants(r, &c, rgb, trust, layer, own, mirror);
    completion_eliminate(r, &c);
    completion_apply(Ap, &c, rgb);
    for (size_t i = 0; i < n; i++)
        r[i] -= Ap[i];
    completion_precondition(z, r, &c);
    memcpy(p, z, n * sizeof *p);
    double rz = completion_dot(r, z, n);
    for (int it = 0; it < ITERATIONS && rz > 1e-9; it++) {
        completion_apply(Ap, &c, p);
        const float a = (float)(rz / completion_dot(p, Ap, n));

        for (size_t i = 0; i < n; i++) {
            rgb[i] += a * p[i];
            r[i] -= a * Ap[i];
        }
        completion_precondition(z, r, &c);
        const double next = completion_dot(r, z, n);
        const float more = (float)(next / rz);
        for (size_t i = 0; i < n; i++)
            p[i] = z[i] + more * p[i];
        rz = next;
    }
    for (size_t e = 0; e < d->E; e++) {
        const float *a = rgb + 3 * (size_t)d->edge[2 * e];
        const float *b = rgb + 3 * (size_t)d->edge[2 * e + 1];

        for (size_t j = d->V + e, k = 0; k < 3; k++)
            rgb[3 * j + k] = c.weight[j] *
                             (r[3 * j + k] + c.tie[2 * e] * a[k] +
                              c.tie[2 * e + 1] * b[k]);
    }
    for (size_t i = 0; i < 3 * N; i++)
        rgb[i] = fminf(fmaxf(rgb[i], 0), 1);
}

void completion_solve(float *rgb, const float *trust, const float *chance,
                      const size_t *mirror, const struct densify *d,
                      float *scratch)
{
    const size_t N = d->V + d->E;
    float *seen = scratch, *layer = seen + 3 * N;
    float mean[3] = {0};

    memcpy(seen, rgb, 3 * N * sizeof *rgb);
    completion_mean(mean, seen, trust, MATERIALS, N);
    memset(rgb, 0, 3 * N * sizeof *rgb);
    for (size_t m = 0; m < MATERIALS; m++) {
        memcpy(layer, seen, 3 * N * sizeof *layer);
        completion_layer(layer, trust + m * N, chance + m * N, mean, mirror, d,
                         layer + 3 * N);
        for (size_t i = 0; i < 3 * N; i++)
            rgb[i] += chance[m * N + i / 3] * layer[i];
    }
}
