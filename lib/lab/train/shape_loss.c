/* Squared vertex distance as a form of beta - beta*: points that directions
 * move are freed of what a similarity undoes, and their Gram matrix is the
 * form. */
#include "lib/lab/train/shape_loss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/arena.h"

#define SIMILARITIES 4      /* three ways to move, one to grow */

/* Points x (P,3) of the mean head and what each direction does to them,
 * d (n,P,3). */
struct points {
    size_t P, n;
    double *x, *d;
};

/* a (count) without its part along a vector of length 1. */
static void shape_points_subtract(double *a, const double *unit, size_t count)
{
    double along = 0;

    for (size_t i = 0; i < count; i++)
        along += a[i] * unit[i];
    for (size_t i = 0; i < count; i++)
        a[i] -= along * unit[i];
}

/* The points' centroid. */
static void shape_points_middle(double mean[3], const struct points *p)
{
    memset(mean, 0, 3 * sizeof *mean);
    for (size_t i = 0; i < 3 * p->P; i++)
        mean[i % 3] += p->x[i] / (double)p->P;
}

/* unit (4,P*3): what moving the points and making them larger do to them,
 * each of length 1 and square to the others. */
static void shape_points_similarities(double *unit, const struct points *p)
{
    size_t count = 3 * p->P;
    double mean[3];

    shape_points_middle(mean, p);
    for (size_t i = 0; i < count; i++) {
        unit[i % 3 * count + i] = 1 / sqrt((double)p->P);
        unit[3 * count + i] = p->x[i] - mean[i % 3];
    }
    double sum = 1e-30, *larger = unit + 3 * count;
    for (size_t i = 0; i < count; i++)
        sum += larger[i] * larger[i];
    for (size_t i = 0; i < count; i++)
        larger[i] /= sqrt(sum);
}

/* Free the directions of similarities, then make their Gram matrix. */
static int shape_loss_fill(struct shape_loss *l, const struct points *p,
                           struct arena *room, struct error *err)
{
    size_t count = 3 * p->P, n = p->n;
    double *unit = arena_take(room, SIMILARITIES * count, sizeof *unit);

    if (arena_check(room, "a shape's points", err))
        return -1;
    shape_points_similarities(unit, p);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < SIMILARITIES; k++)
            shape_points_subtract(p->d + i * count, unit + k * count, count);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double sum = 0;
            for (size_t k = 0; k < count; k++)
                sum += p->d[i * count + k] * p->d[j * count + k];
            l->gram[i * n + j] = l->gram[j * n + i] = sum / (double)count;
        }
    return 0;
}

/* Floats as doubles. */
static void shape_points_put(double *to, const float *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        to[i] = from[i];
}

/* The landmarks, or every vertex, and n directions of theirs, in `room`. */
static int shape_points_take(struct points *p, const struct head *h, size_t n,
                             bool landmarks, struct arena *room,
                             struct error *err)
{
    size_t P = landmarks ? HEAD_LANDMARKS : h->V;
    float *verts = arena_take(room, 3 * h->V, sizeof *verts);
    float lmk[3 * HEAD_LANDMARKS];

    p->P = P;
    p->n = n;
    p->x = arena_take(room, (n + 1) * P * 3, sizeof *p->x);
    if (arena_check(room, "a shape's points", err))
        return -1;
    p->d = p->x + 3 * P;
    for (size_t k = 0; k <= n; k++) {
        const float *from = k ? verts : h->v_template;
        if (k)
            head_direction(verts, h, h->shape_dirs, h->nshape, k - 1);
        if (landmarks)
            head_landmarks(lmk, h, from);
        shape_points_put(p->x + k * 3 * P, landmarks ? lmk : from, 3 * P);
    }
    return 0;
}

int shape_loss_init(struct shape_loss *l, const struct head *h, size_t n,
                    bool landmarks, struct error *err)
{
    struct arena room = {0};
    struct points p;
    int rc = 0;

    l->n = n;
    l->gram = calloc(n * n, sizeof *l->gram);
    if (!l->gram)
        return error_set(err, EX_OSERR, "out of memory (%zu directions)", n);
    if (!landmarks || h->has_landmarks)
        rc = shape_points_take(&p, h, n, landmarks, &room, err) ||
             shape_loss_fill(l, &p, &room, err) ? -1 : 0;
    arena_release(&room);
    return rc;
}

void shape_loss_release(struct shape_loss *l)
{
    free(l->gram);
    memset(l, 0, sizeof *l);
}

double shape_loss(double *g, const float *beta, const float *truth,
                  const struct shape_loss *l)
{
    double sum = 0, rms;

    for (size_t i = 0; i < l->n; i++) {
        double row = 0;
        for (size_t j = 0; j < l->n; j++)
            row += l->gram[i * l->n + j] * ((double)beta[j] - truth[j]);
        if (g)
            g[i] = row;
        sum += ((double)beta[i] - truth[i]) * row;
    }
    rms = sqrt(fmax(sum, 0) + 1e-12);
    for (size_t i = 0; g && i < l->n; i++)
        g[i] /= rms;
    return rms;
}

/* Size and place by each direction. */
static void shape_place_fill(struct shape_place *out, const struct points *p)
{
    double spread = 0;

    shape_points_middle(out->centre, p);
    for (size_t i = 0; i < 3 * p->P; i++)
        spread += (p->x[i] - out->centre[i % 3]) *
                  (p->x[i] - out->centre[i % 3]);
    for (size_t k = 0; k < p->n; k++)
        for (size_t i = 0; i < 3 * p->P; i++) {
            double d = p->d[k * 3 * p->P + i];

            out->along[i % 3 * p->n + k] += d / (double)p->P;
            out->along[3 * p->n + k] += d * (p->x[i] - out->centre[i % 3]) /
                                        spread;
        }
}

int shape_place_init(struct shape_place *p, const struct head *h, size_t n,
                     struct error *err)
{
    struct arena room = {0};
    struct points points;
    int rc = 0;

    memset(p, 0, sizeof *p);
    p->n = n;
    p->along = calloc(4 * n, sizeof *p->along);
    if (!p->along)
        return error_set(err, EX_OSERR, "out of memory (%zu directions)", n);
    if (h->has_landmarks)
        rc = shape_points_take(&points, h, n, true, &room, err);
    if (h->has_landmarks && !rc)
        shape_place_fill(p, &points);
    arena_release(&room);
    return rc;
}

void shape_place_release(struct shape_place *p)
{
    free(p->along);
    memset(p, 0, sizeof *p);
}

void shape_place(double *size, double place[3], const float *a,
                 const float *b, const struct shape_place *p)
{
    double sum[4] = {0};

    for (size_t j = 0; j < 4; j++)
        for (size_t k = 0; k < p->n; k++)
            sum[j] += p->along[j * p->n + k] * ((double)a[k] - b[k]);
    *size = 1 + sum[3];
    for (size_t c = 0; c < 3; c++)
        place[c] = sum[c] - sum[3] * p->centre[c];
}
