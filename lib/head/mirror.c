#include "lib/head/mirror.h"

#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

#define SAME 0.98       /* cosine of directions that are one */

/* Directions in the head's posing layout: (blocks, n, 96). */
struct directions {
    const struct head *head;
    const float *d;
    size_t n;
    size_t *other;          /* (V) the vertex across */
    double *square;         /* (n) lengths squared */
};

/* The vertex of the mean head nearest to the mirror image of vertex v. */
static size_t opposite(const struct head *h, size_t v)
{
    const float *x = h->v_template + 3 * v;
    float least = INFINITY;
    size_t best = v;

    for (size_t w = 0; w < h->V; w++) {
        const float *y = h->v_template + 3 * w;
        float a = x[0] + y[0], b = x[1] - y[1], c = x[2] - y[2];
        float far = a * a + b * b + c * c;

        if (far < least) {
            least = far;
            best = w;
        }
    }
    return best;
}

/* What direction k does to vertex v, coordinate c. */
static double moved(const struct directions *s, size_t k, size_t v, size_t c)
{
    return (double)s->d[(v / HEAD_BLOCK * s->n + k) * 3 * HEAD_BLOCK +
                        c * HEAD_BLOCK + v % HEAD_BLOCK];
}

/* Inner product of direction k with the mirror image of direction j. */
static double across(const struct directions *s, size_t k, size_t j)
{
    double sum = 0;

    for (size_t v = 0; v < s->head->V; v++)
        for (size_t c = 0; c < 3; c++) {
            double p = moved(s, k, v, c) * moved(s, j, s->other[v], c);

            sum += c ? p : -p;
        }
    return sum;
}

/* Whether k's mirror image is j, or j with the other sign. */
static int pair(struct head_mirror *m, const struct directions *s, size_t k,
                size_t j)
{
    double a = s->square[k], b = s->square[j], with;

    if (fabs(a - b) > (1 - SAME) * (a + b))
        return 0;
    with = across(s, k, j);
    if (fabs(with) < SAME * sqrt(a * b))
        return 0;
    m->from[k] = (int)j;
    m->sign[k] = with < 0 ? -1 : 1;
    return 1;
}

static int find_pairs(struct head_mirror *m, const struct directions *s)
{
    m->n = s->n;
    for (size_t k = 0; k < s->n; k++) {
        int found = pair(m, s, k, k);

        for (size_t j = 0; j < s->n && !found; j++)
            found = pair(m, s, k, j);
        if (!found)
            return 0;
    }
    return 1;
}

static int make(struct head_mirror *m, const struct head *h, const float *d,
                size_t n, struct error *err)
{
    struct directions s = {.head = h, .d = d, .n = n};
    int rc;

    if (n > HEAD_MAX_EXP)
        return 0;
    s.other = malloc(h->V * sizeof *s.other);
    s.square = calloc(n + 1, sizeof *s.square);
    if (!s.other || !s.square) {
        free(s.other);
        free(s.square);
        return error_set(err, EX_OSERR, "no memory for %zu vertices", h->V);
    }
    for (size_t v = 0; v < h->V; v++)
        s.other[v] = opposite(h, v);
    for (size_t k = 0; k < n; k++)
        for (size_t v = 0; v < h->V; v++)
            for (size_t c = 0; c < 3; c++)
                s.square[k] += moved(&s, k, v, c) * moved(&s, k, v, c);
    rc = find_pairs(m, &s);
    free(s.other);
    free(s.square);
    return rc;
}

int head_mirror_shape(struct head_mirror *m, const struct head *h,
                      struct error *err)
{
    return make(m, h, h->shape_dirs, h->nshape, err);
}

int head_mirror_exp(struct head_mirror *m, const struct head *h,
                    struct error *err)
{
    return make(m, h, h->exp_dirs, h->nexp, err);
}

void head_mirror_apply(float *out, const float *c,
                       const struct head_mirror *m)
{
    for (size_t k = 0; k < m->n; k++)
        out[k] = m->sign[k] * c[m->from[k]];
}
