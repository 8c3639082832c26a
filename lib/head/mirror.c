/* Opposite vertices of the mean head by their heights, and for every
 * direction the one that its mirror image is. */
#include "lib/head/mirror.h"

#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

/* Cosine of directions that are one: what keeps lips apart leaves some of the
 * built-in head's expressions symmetric to 0.986 only. */
#define SAME 0.98
/* Difference of their lengths squared over the sum: the scans' left and right
 * expressions are of different people's halves. */
#define ALIKE 0.1

/* Directions (n,V,3) and where their vertices lie across. */
struct directions {
    size_t V, n;
    float *d;
    size_t *other;          /* (V) */
    double *square;         /* (n) lengths squared */
};

/* A vertex in the order of height, and at equal height of itself. */
struct place {
    float y;
    size_t v;
};

static int mirror_by_height(const void *a, const void *b)
{
    const struct place *p = a, *q = b;

    if (p->y != q->y)
        return p->y < q->y ? -1 : 1;
    return (p->v > q->v) - (p->v < q->v);
}

/* Square of how far vertex w is from the mirror image of v. */
static float mirror_distance(const struct head *h, size_t v, size_t w)
{
    const float *x = h->v_template + 3 * v, *y = h->v_template + 3 * w;
    float a = x[0] + y[0], b = x[1] - y[1], c = x[2] - y[2];

    return a * a + b * b + c * c;
}

/* The vertex of the mean head nearest to the mirror image of order[at]'s: from
 * there up and down, until the height alone is further. */
static size_t mirror_vertex(const struct head *h, const struct place *order,
                            size_t at)
{
    size_t v = order[at].v, best = v;
    float least = mirror_distance(h, v, v);

    for (int way = -1; way <= 1; way += 2)
        for (size_t i = at + (size_t)way; i < h->V; i += (size_t)way) {
            float dy = order[i].y - order[at].y;
            float far = mirror_distance(h, v, order[i].v);

            if (dy * dy > least)
                break;
            if (far < least) {
                least = far;
                best = order[i].v;
            }
        }
    return best;
}

int head_mirror_vertices(size_t *other, const struct head *h,
                         struct error *err)
{
    struct place *order = malloc(h->V * sizeof *order);

    if (!order)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", h->V);
    for (size_t v = 0; v < h->V; v++)
        order[v] = (struct place){h->v_template[3 * v + 1], v};
    qsort(order, h->V, sizeof *order, mirror_by_height);
    for (size_t at = 0; at < h->V; at++)
        other[order[at].v] = mirror_vertex(h, order, at);
    free(order);
    return 0;
}

/* Inner product of direction k with the mirror image of direction j. */
static double mirror_product(const struct directions *s, size_t k, size_t j)
{
    const float *a = s->d + k * 3 * s->V, *b = s->d + j * 3 * s->V;
    double sum = 0;

    for (size_t v = 0; v < s->V; v++) {
        const float *p = a + 3 * v, *q = b + 3 * s->other[v];

        sum += (double)p[1] * q[1] + (double)p[2] * q[2] - (double)p[0] * q[0];
    }
    return sum;
}

/* Whether k's mirror image is j, or j with the other sign. */
static int mirror_pair(struct head_mirror *m, const struct directions *s,
                       size_t k, size_t j)
{
    double a = s->square[k], b = s->square[j], with;

    if (fabs(a - b) > ALIKE * (a + b))
        return 0;
    with = mirror_product(s, k, j);
    if (fabs(with) < SAME * sqrt(a * b))
        return 0;
    m->from[k] = (int)j;
    m->sign[k] = with < 0 ? -1 : 1;
    return 1;
}

/* Each direction's mirror image: itself with a sign, or another one. */
static int mirror_find_pairs(struct head_mirror *m, const struct directions *s)
{
    m->n = s->n;
    for (size_t k = 0; k < s->n; k++) {
        int found = mirror_pair(m, s, k, k);

        for (size_t j = 0; j < s->n && !found; j++)
            found = mirror_pair(m, s, k, j);
        if (!found)
            return 0;
    }
    return 1;
}

/* Directions as rows, their energies, then the pairs; 0 when one has none. */
static int mirror_make(struct head_mirror *m, const struct head *h,
                       const float *dirs, size_t n, struct error *err)
{
    struct directions s = {.V = h->V, .n = n};
    int rc = -1;

    if (n > HEAD_MAX_EXP)
        return 0;
    s.d = malloc((n + 1) * 3 * h->V * sizeof *s.d);
    s.other = malloc(h->V * sizeof *s.other);
    s.square = calloc(n + 1, sizeof *s.square);
    if (!s.d || !s.other || !s.square) {
        error_set(err, EX_OSERR, "no memory for %zu directions", n);
        goto out;
    }
    if (head_mirror_vertices(s.other, h, err))
        goto out;
    for (size_t k = 0; k < n; k++) {
        float *d = s.d + k * 3 * h->V;

        head_direction(d, h, dirs, n, k);
        for (size_t i = 0; i < 3 * h->V; i++)
            s.square[k] += (double)d[i] * d[i];
    }
    rc = mirror_find_pairs(m, &s);
out:
    free(s.d);
    free(s.other);
    free(s.square);
    return rc;
}

int head_mirror_shape(struct head_mirror *m, const struct head *h,
                      struct error *err)
{
    return mirror_make(m, h, h->shape_dirs, h->nshape, err);
}

int head_mirror_exp(struct head_mirror *m, const struct head *h,
                    struct error *err)
{
    return mirror_make(m, h, h->exp_dirs, h->nexp, err);
}

void head_mirror_apply(float *out, const float *c,
                       const struct head_mirror *m)
{
    for (size_t k = 0; k < m->n; k++)
        out[k] = m->sign[k] * c[m->from[k]];
}
