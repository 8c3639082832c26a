/* Opposite vertices of the mean head by their heights, and for every
 * direction the one that its mirror image is. */
#include "lib/head/mirror.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/base/quad.h"
#include "lib/base/sort.h"

/* Of a block of the posing layout, and where it has y and z. */
enum { ROW = 3 * HEAD_BLOCK, Y = HEAD_BLOCK, Z = 2 * HEAD_BLOCK };

/* Cosine of directions that are one: what keeps lips apart leaves some of the
 * built-in head's expressions symmetric to 0.986 only. */
#define SAME 0.98
/* Difference of their lengths squared over the sum: the scans' left and right
 * expressions are of different people's halves. */
#define SIMILAR 0.1

/* Directions in the posing layout (head.h). */
struct directions {
    size_t V, n, blocks;
    const float *d;         /* (blocks,n,96) */
    const uint64_t *live;   /* (blocks,words) bits of those that are not
                             * zero there; NULL: any */
    size_t words;
    size_t *across;         /* (V) where the vertex on the other side is in an
                             * image */
    float *images;          /* (threads,blocks,96) a direction's mirror image */
    double *square;         /* (n) lengths squared */
};

/* Square of how far vertex w is from the mirror image of v. */
static float mirror_distance(const float *at, size_t v, size_t w)
{
    const float *x = at + 3 * v, *y = at + 3 * w;
    float a = x[0] + y[0], b = x[1] - y[1], c = x[2] - y[2];

    return a * a + b * b + c * c;
}

/* The vertex nearest to the mirror image of order[at]'s: from there up and
 * down, until the height alone is further. */
static size_t mirror_vertex(const float *x, size_t n, const uint64_t *order,
                            size_t at)
{
    const size_t v = (uint32_t)order[at];
    size_t best = v;
    float min = mirror_distance(x, v, v);

    for (int way = -1; way <= 1; way += 2)
        for (size_t i = at + (size_t)way; i < n; i += (size_t)way) {
            const size_t w = (uint32_t)order[i];
            float dy = x[3 * w + 1] - x[3 * v + 1];
            float far = mirror_distance(x, v, w);

            if (dy * dy > min)
                break;
            if (far < min) {
                min = far;
                best = w;
            }
        }
    return best;
}

int mirror_vertices(size_t *other, const float *x, size_t n, struct error *err)
{
    uint64_t *order = malloc(n * sizeof *order);

    if (!order)
        return error_set(err, EX_OSERR, "no memory for %zu vertices", n);
    for (size_t v = 0; v < n; v++)
        order[v] = sort_key(x[3 * v + 1], (uint32_t)v);
    sort_keys(order, n);
    for (size_t at = 0; at < n; at++)
        other[(uint32_t)order[at]] = mirror_vertex(x, n, order, at);
    free(order);
    return 0;
}

/* Direction k in block b, or NULL where it is zero: its pages may never have
 * been touched, and stay so. */
static const float *mirror_row(const struct directions *s, size_t k, size_t b)
{
    return !s->live || s->live[b * s->words + k / 64] >> k % 64 & 1
               ? s->d + (b * s->n + k) * ROW : NULL;
}

/* The mirror image of direction k is added to the image, where it has any. */
static void mirror_image(float *image, const struct directions *s, size_t k)
{
    for (size_t b = 0; b < s->blocks; b++) {
        const float *from = mirror_row(s, k, b);
        const size_t first = b * HEAD_BLOCK, rest = s->V - first;

        for (size_t i = 0; from && i < HEAD_BLOCK && i < rest; i++, from++) {
            float *to = image + s->across[first + i];

            to[0] -= from[0];
            to[Y] += from[Y];
            to[Z] += from[Z];
        }
    }
}

/* Zeros where direction k's was added: most are small parts of a head. */
static void mirror_clear(float *image, const struct directions *s, size_t k)
{
    for (size_t b = 0; b < s->blocks; b++) {
        const size_t first = b * HEAD_BLOCK, rest = s->V - first;

        for (size_t i = 0; mirror_row(s, k, b) && i < HEAD_BLOCK && i < rest;
             i++) {
            float *to = image + s->across[first + i];

            to[0] = to[Y] = to[Z] = 0;
        }
    }
}

/* Inner product of two rows. */
static double mirror_row_product(const float *p, const float *q)
{
    quad sum[2] = {{0}};        /* that do not wait for each other */

    for (size_t i = 0; i < ROW; i += 8)
        for (size_t k = 0; k < 2; k++)
            sum[k] += *(const quad *)(p + i + 4 * k) *
                      *(const quad *)(q + i + 4 * k);
    sum[0] += sum[1];
    return (double)(sum[0][0] + sum[0][1] + (sum[0][2] + sum[0][3]));
}

/* Inner product of direction j with the image. */
static double mirror_product(const float *image, const struct directions *s,
                             size_t j)
{
    double sum = 0;

    for (size_t b = 0; b < s->blocks; b++) {
        const float *p = mirror_row(s, j, b);

        sum += p ? mirror_row_product(p, image + b * ROW) : 0;
    }
    return sum;
}

/* Whether k's mirror image is j, or j with the other sign. */
static bool mirror_pair(struct head_mirror *m, const float *image,
                        const struct directions *s, size_t k, size_t j)
{
    double a = s->square[k], b = s->square[j], with;

    if (fabs(a - b) > SIMILAR * (a + b))
        return false;
    with = mirror_product(image, s, j);
    if (fabs(with) < SAME * sqrt(a * b))
        return false;
    m->from[k] = (int)j;
    m->sign[k] = with < 0 ? -1 : 1;
    return true;
}

/* Direction k's mirror image: itself with a sign, or another one, or -1. */
PARALLEL(mirror_find_pair, k, struct head_mirror *, m,
         const struct directions *, s)
{
    float *image = s->images + parallel_slot() * s->blocks * ROW;

    m->from[k] = -1;
    mirror_image(image, s, k);
    bool found = mirror_pair(m, image, s, k, k);
    for (size_t j = 0; j < s->n && !found; j++)
        found = mirror_pair(m, image, s, k, j);
    mirror_clear(image, s, k);
}

/* Direction k's length squared. */
static double mirror_square(const struct directions *s, size_t k)
{
    double sum = 0;

    for (size_t b = 0; b < s->blocks; b++) {
        const float *p = mirror_row(s, k, b);

        sum += p ? mirror_row_product(p, p) : 0;
    }
    return sum;
}

/* Opposite vertices and energies, then the pairs; 0 when one has none. */
static int mirror_make(struct head_mirror *m, const struct head *h,
                       struct directions s, struct error *err)
{
    int rc = -1;

    if (s.n > HEAD_MAX_EXP)
        return 0;
    s.V = h->V;
    s.blocks = h->blocks;
    s.across = malloc(h->V * sizeof *s.across);
    s.images = calloc((size_t)parallel_width() * h->blocks * ROW,
                      sizeof *s.images);
    s.square = calloc(s.n + 1, sizeof *s.square);
    if (!s.across || !s.images || !s.square) {
        error_set(err, EX_OSERR, "no memory for %zu directions", s.n);
        goto out;
    }
    if (mirror_vertices(s.across, h->v_template, h->V, err))
        goto out;
    for (size_t v = 0; v < h->V; v++)
        s.across[v] = s.across[v] / HEAD_BLOCK * ROW + s.across[v] % HEAD_BLOCK;
    for (size_t k = 0; k < s.n; k++)
        s.square[k] = mirror_square(&s, k);
    m->n = s.n;
    parallel_each(mirror_find_pair, s.n, 8, m, &s);
    rc = 1;
    for (size_t k = 0; k < s.n; k++)
        rc = rc && m->from[k] >= 0;
out:
    free(s.across);
    free(s.images);
    free(s.square);
    return rc;
}

int head_mirror_shape(struct head_mirror *m, const struct head *h,
                      struct error *err)
{
    return mirror_make(m, h, (struct directions){
        .n = h->nshape, .d = h->shape_dirs, .live = h->shape_live,
        .words = (h->nshape + 63) / 64
    }, err);
}

int head_mirror_exp(struct head_mirror *m, const struct head *h,
                    struct error *err)
{
    return mirror_make(m, h, (struct directions){
        .n = h->nexp, .d = h->exp_dirs, .live = h->exp_live,
        .words = HEAD_MAX_EXP / 64
    }, err);
}

void head_mirror_apply(float *out, const float *c,
                       const struct head_mirror *m)
{
    for (size_t k = 0; k < m->n; k++)
        out[k] = m->sign[k] * c[m->from[k]];
}
