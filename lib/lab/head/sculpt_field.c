/* Fields of displacements: falloffs and waves, made orthogonal and scaled to
 * millimetres. */
#include "lib/lab/head/sculpt_field.h"

#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"

void field_pull(struct vec *d, const struct full *m, const struct pull *p,
                enum half_side side, double strength)
{
    for (int v = 0; v < m->nv; v++) {
        int part = m->h->part[m->src[v]];
        if (part == PART_BALL)
            continue;
        double lower = part == PART_MOUTH
                           ? sculpt_jaw_weight(m->h, m->src[v], m->p[v])
                           : ramp(-44, -52, m->p[v].y);
        double grip = p->lips == LIP_UPPER ? 1 - lower
                    : p->lips == LIP_LOWER ? lower : 1;
        for (int s = 0; s < 2; s++) {
            double flip = s ? -1 : 1;
            if ((side == SIDE_LEFT && s) || (side == SIDE_RIGHT && !s))
                continue;
            struct vec at = vec(flip * p->at.x, p->at.y, p->at.z);
            struct vec by = vec(flip * p->by.x, p->by.y, p->by.z);
            struct vec q = sub(m->p[v], at);
            double w = exp(-dot(q, q) / (2 * p->reach * p->reach));
            if (w > 1e-4)
                d[v] = add(d[v], mul(by, strength * grip * w));
        }
    }
}

/* Three normal numbers, drawn from z to x.  One statement each: C does not say
 * in which order arguments are evaluated, and compilers differ. */
static struct vec field_draw(struct random *r)
{
    const double z = random_normal(r), y = random_normal(r);

    return vec(random_normal(r), y, z);
}

void field_wave(struct vec *d, const struct full *m, uint64_t k, double wave,
                int odd)
{
    struct random r;

    random_init(&r, k, "head.wave");
    for (int n = 0; n < 6; n++) {
        struct vec dir = unit(field_draw(&r)), by = field_draw(&r);
        double f = 2 * M_PI / (wave * random_range(&r, 0.8, 1.3));
        double phase = random_range(&r, 0, 2 * M_PI);
        for (int v = 0; v < m->nv; v++) {
            struct vec p = m->p[v], q = vec(-p.x, p.y, p.z);
            double a = sin(f * dot(p, dir) + phase);
            double b = sin(f * dot(q, dir) + phase);
            double flip = odd ? -1 : 1;
            d[v] = add(d[v], vec(by.x * (a - flip * b), by.y * (a + flip * b),
                                 by.z * (a + flip * b)));
        }
    }
}

void field_settle_eyes(struct vec *d, const struct full *m)
{
    const struct half *h = m->h;

    for (int s = 0; s < 2; s++) {
        struct vec e = EYE_CENTRE, mean = vec(0, 0, 0);
        e.x *= s ? -1 : 1;
        for (int i = 0; i < EYE_N; i++) {
            int v = h->eye[EYE_MARGIN][i];
            mean = add(mean, mul(d[s ? m->mirror[v] : v], 1.0 / EYE_N));
        }
        for (int v = 0; v < m->nv; v++) {
            if ((m->side[v] < 0) != s || m->side[v] == 0)
                continue;
            double w = ramp(36, 17, norm(sub(m->p[v], e)));
            if (h->part[m->src[v]] == PART_BALL)
                w = 1;
            d[v] = lerp(d[v], mean, w);
        }
    }
}

/* Columns are gathered into rows first: a column of dirs jumps through
 * memory. */
static void field_gather(double *x, const float *dirs, size_t K, size_t k,
                         size_t n)
{
    for (size_t i = 0; i < n; i++)
        x[i] = dirs[i * K + k];
}

int field_store(float *dirs, size_t K, size_t first, size_t k,
                const struct vec *d, size_t nv, double most)
{
    double *x = malloc(6 * nv * sizeof *x), top = 1e-12;

    if (!x)
        return -1;
    double *y = x + 3 * nv;
    for (size_t v = 0; v < nv; v++)
        top = fmax(top, norm(d[v]));
    for (size_t v = 0; v < nv; v++) {
        x[3 * v] = d[v].x * 1e-3 * most / top;
        x[3 * v + 1] = d[v].y * 1e-3 * most / top;
        x[3 * v + 2] = d[v].z * 1e-3 * most / top;
    }
    /* twice: what the first pass leaves of a column that is almost in the
     * span of the others is mostly rounding */
    for (size_t pass = 0; pass < 2; pass++)
        for (size_t j = first; j < k; j++) {
            double xy = 0, yy = 0;
            field_gather(y, dirs, K, j, 3 * nv);
            for (size_t i = 0; i < 3 * nv; i++) {
                xy += x[i] * y[i];
                yy += y[i] * y[i];
            }
            for (size_t i = 0; yy > 0 && i < 3 * nv; i++)
                x[i] -= xy / yy * y[i];
        }
    for (size_t i = 0; i < 3 * nv; i++)
        dirs[i * K + k] = (float)x[i];
    free(x);
    return 0;
}

struct size {
    double norm;
    size_t column;
};

/* The largest norm first; ties by column, for a fixed order. */
static int field_larger(const void *a, const void *b)
{
    const struct size *x = a, *y = b;

    if (x->norm != y->norm)
        return x->norm < y->norm ? 1 : -1;
    return (x->column > y->column) - (x->column < y->column);
}

int field_sort(float *dirs, size_t K, size_t first, size_t n, size_t nv)
{
    struct size *s = calloc(n + 1, sizeof *s);
    float *row = malloc((n + 1) * sizeof *row);
    int rc = s && row ? 0 : -1;

    for (size_t k = 0; !rc && k < n; k++) {
        s[k].column = first + k;
        for (size_t i = 0; i < 3 * nv; i++)
            s[k].norm += (double)dirs[i * K + first + k] *
                         dirs[i * K + first + k];
    }
    if (!rc)
        qsort(s, n, sizeof *s, field_larger);
    for (size_t i = 0; !rc && i < 3 * nv; i++) {
        for (size_t k = 0; k < n; k++)
            row[k] = dirs[i * K + s[k].column];
        memcpy(dirs + i * K + first, row, n * sizeof *row);
    }
    free(s);
    free(row);
    return rc;
}
