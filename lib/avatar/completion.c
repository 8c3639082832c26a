/* Poisson completion of the head's colours (completion.h). */
#include "lib/avatar/completion.h"

#include <math.h>
#include <string.h>

#include "lib/base/parallel.h"
#include "lib/base/quad.h"

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

typedef double v2d __attribute__((vector_size(16)));

/* A layer's, for weight (N) x colours and steps along half edges.  Of a midpoint
 * that is colour = share (b + its ends' colours), share = 1 / (weight + 2), so that
 * only the vertices are sought: the same as all points after twice the steps, of
 * four times the numbers each.  Theirs are times the root of the diagonal, which
 * leaves 1 there (Jacobi's preconditioner). */
struct completion {
    const struct densify *d;
    float *weight;              /* (N), then (V) roots, (E) shares */
    float *tie;                 /* (2E) weights of the half edges' steps */
    float *link;                /* (E) what midpoints leave between their ends */
    quad *b;                     /* (N), then (V) residuals; at last colours */
    quad *x, *p, *Ap;            /* (V) */
};

/* The parts of scratch. */
static struct completion completion_parts(const struct densify *d,
                                          float *scratch)
{
    const size_t V = d->V, E = d->E;
    quad *b = (quad *)(scratch + V + 4 * E);

    return (struct completion){
        d, scratch, scratch + V + E, scratch + V + 3 * E, b,
        b + V + E, b + 2 * V + E, b + 3 * V + E
    };
}

/* The weights, ties and b from the photograph's colours rgb (N,3); mean (3):
 * theirs where nothing is. */
static void completion_wants(struct completion *c, const float *rgb,
                             const float *trust, const float *layer,
                             const float mean[3], const size_t *mirror)
{
    for (size_t i = 0; i < c->d->V + c->d->E; i++) {
        const float own = KEEP * trust[i];
        const float across = ANCHOR * (1 - trust[i]) * trust[mirror[i]];

        c->weight[i] = own + across + FLOOR;
        for (size_t k = 0; k < 3; k++)
            c->b[i][k] = own * rgb[3 * i + k] +
                         across * rgb[3 * mirror[i] + k] + FLOOR * mean[k];
        c->b[i][3] = 0;
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

            c->b[i][k] -= c->tie[h] * step;
            c->b[j][k] += c->tie[h] * step;
        }
    }
}

/* Midpoints taken out of the vertices' part, which is scaled. */
static void completion_eliminate(struct completion *c)
{
    const size_t V = c->d->V, E = c->d->E;
    const int32_t *edge = c->d->edge;

    for (size_t h = 0; h < 2 * E; h++) {
        const size_t i = (size_t)edge[h], j = V + h / 2;

        if (h % 2 == 0)
            c->weight[j] = 1 / (c->weight[j] + c->tie[h] + c->tie[h + 1]);
        c->weight[i] += c->tie[h] * (1 - c->tie[h] * c->weight[j]);
        c->b[i] += c->tie[h] * c->weight[j] * c->b[j];
    }
    for (size_t i = 0; i < V; i++)
        c->weight[i] = sqrtf(c->weight[i]);
    for (size_t e = 0; e < E; e++)
        c->link[e] = c->weight[V + e] * c->tie[2 * e] * c->tie[2 * e + 1] /
                     (c->weight[edge[2 * e]] * c->weight[edge[2 * e + 1]]);
}

/* Ap = A p; edges lie in the order of their first ends. */
static void completion_apply(struct completion *c)
{
    const int32_t *edge = c->d->edge;

    memcpy(c->Ap, c->p, c->d->V * sizeof *c->p);
    for (size_t e = 0; e < c->d->E;) {
        const int32_t i = edge[2 * e];
        const quad own = c->p[i];
        quad sum = c->Ap[i];

        for (; e < c->d->E && edge[2 * e] == i; e++) {
            const int32_t j = edge[2 * e + 1];

            sum -= c->link[e] * c->p[j];
            c->Ap[j] -= c->link[e] * own;
        }
        c->Ap[i] = sum;
    }
}

/* Sum of a b over n colours. */
static double completion_dot(const quad *a, const quad *b, size_t n)
{
    v2d left = {0}, right = {0};

    for (size_t i = 0; i < n; i++) {
        const quad ab = a[i] * b[i];

        left += __builtin_convertvector(__builtin_shufflevector(ab, ab, 0, 1),
                                        v2d);
        right += __builtin_convertvector(__builtin_shufflevector(ab, ab, 2, 3),
                                         v2d);
    }
    return left[0] + left[1] + right[0];
}

/* x by conjugate gradients from where it is. */
static void completion_descend(struct completion *c)
{
    const size_t V = c->d->V;

    memcpy(c->p, c->x, V * sizeof *c->p);
    completion_apply(c);
    for (size_t i = 0; i < V; i++)
        c->p[i] = c->b[i] = c->b[i] / c->weight[i] - c->Ap[i];
    double rr = completion_dot(c->b, c->b, V);
    for (int it = 0; it < ITERATIONS && rr > 1e-9; it++) {
        completion_apply(c);
        const float a = (float)(rr / completion_dot(c->p, c->Ap, V));

        for (size_t i = 0; i < V; i++) {
            c->x[i] += a * c->p[i];
            c->b[i] -= a * c->Ap[i];
        }
        const double next = completion_dot(c->b, c->b, V);
        const float more = (float)(next / rr);
        for (size_t i = 0; i < V; i++)
            c->p[i] = c->b[i] + more * c->p[i];
        rr = next;
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

/* Layer m of all, whose colours become b. */
PARALLEL(completion_layer, m, struct completion *, all, const float *, rgb,
         const float *, trust, const float *, chance, const float *, mean,
         const size_t *, mirror)
{
    struct completion *c = all + m;
    const struct densify *d = c->d;
    const size_t N = d->V + d->E;
    float own[3] = {mean[0], mean[1], mean[2]};

    completion_mean(own, rgb, trust + m * N, 1, N);
    completion_wants(c, rgb, trust + m * N, chance + m * N, own, mirror);
    completion_eliminate(c);
    for (size_t i = 0; i < d->V; i++)
        c->x[i] = c->weight[i] * (quad){rgb[3 * i], rgb[3 * i + 1],
                                        rgb[3 * i + 2]};
    completion_descend(c);
    for (size_t i = 0; i < d->V; i++)
        c->b[i] = c->x[i] / c->weight[i];
    for (size_t e = 0, j = d->V; e < d->E; e++, j++)
        c->b[j] = c->weight[j] *
                  (c->b[j] + c->tie[2 * e] * c->b[d->edge[2 * e]] +
                   c->tie[2 * e + 1] * c->b[d->edge[2 * e + 1]]);
}

void completion_solve(float *rgb, const float *trust, const float *chance,
                      const size_t *mirror, const struct densify *d,
                      float *scratch)
{
    const size_t N = d->V + d->E;
    struct completion layer[MATERIALS];
    float mean[3] = {0};

    for (size_t m = 0; m < MATERIALS; m++)
        layer[m] = completion_parts(d, scratch +
                                    m * COMPLETION_SCRATCH(N) / MATERIALS);
    completion_mean(mean, rgb, trust, MATERIALS, N);
    parallel_each(completion_layer, MATERIALS, 1, layer, rgb, trust, chance,
                  mean, mirror);
    memset(rgb, 0, 3 * N * sizeof *rgb);
    for (size_t m = 0; m < MATERIALS; m++)
        for (size_t i = 0; i < 3 * N; i++)
            rgb[i] += chance[m * N + i / 3] * layer[m].b[i / 3][i % 3];
}
