/* Conjugate gradients: weights times the distance to what is asked for, plus
 * the stiffness times the squared differences between neighbours. */
#include "lib/lab/head/smooth.h"

#include <string.h>

#include "lib/base/vec3.h"

int smooth_mesh_init(struct smooth_mesh *m, const int32_t *faces, size_t nf,
                     size_t nv, struct arena *memory, struct error *err)
{
    size_t n = 0;
    int32_t *count = arena_take(memory, nv, sizeof *count);

    m->nv = nv;
    m->at = arena_take(memory, nv + 1, sizeof *m->at);
    m->link = arena_take(memory, 6 * nf, sizeof *m->link);
    if (arena_check(memory, "neighbours", err))
        return -1;
    for (size_t i = 0; i < 3 * nf; i++)
        m->at[faces[i] + 1] += 2;
    for (size_t v = 0; v < nv; v++)
        m->at[v + 1] += m->at[v];
    for (size_t i = 0; i < 6 * nf; i++) {       /* each edge, both ways */
        const int32_t *f = faces + i / 6 * 3;
        size_t k = i % 6 / 2;
        int32_t a = f[k], b = f[(k + 1 + i % 2) % 3], j;
        int32_t *l = m->link + m->at[a];

        for (j = 0; j < count[a] && l[j] != b; j++)
            ;
        if (j == count[a])
            l[count[a]++] = b;
    }
    for (size_t v = 0; v < nv; v++) {           /* close the gaps */
        int32_t from = m->at[v];

        m->at[v] = (int32_t)n;
        memmove(m->link + n, m->link + from,
                (size_t)count[v] * sizeof *m->link);
        n += (size_t)count[v];
    }
    m->at[nv] = (int32_t)n;
    return 0;
}

void smooth_mean(double out[3], const struct smooth_mesh *m, const double *x,
                 size_t v)
{
    int32_t first = m->at[v], end = m->at[v + 1];

    for (int c = 0; c < 3; c++) {
        out[c] = first < end ? 0 : x[3 * v + (size_t)c];
        for (int32_t i = first; i < end; i++)
            out[c] += x[3 * m->link[i] + c] / (end - first);
    }
}

struct system {
    const struct smooth_mesh *m;
    const double *weight, *normal, *along;
    double stiff;
    double *bent;               /* (V,3) d - mean */
};

/* out += weight (n n^T + along (1 - n n^T)) e of vertex v. */
static void smooth_pull_add(double out[3], const struct system *s, size_t v,
                            const double e[3])
{
    const double *n = s->normal ? s->normal + 3 * v : NULL;
    double a = s->normal ? s->along[v] : 1, en = 0;

    for (int c = 0; n && c < 3; c++)
        en += n[c] * e[c];
    for (int c = 0; c < 3; c++)
        out[c] += s->weight[v] * (a * e[c] + (n ? (1 - a) * en * n[c] : 0));
}

/* out = A d: weights and stiff L^T L. */
static void smooth_system_apply(double *out, const struct system *s,
                                const double *d)
{
    const struct smooth_mesh *m = s->m;

    for (size_t v = 0; v < m->nv; v++) {
        double mean[3];

        smooth_mean(mean, m, d, v);
        for (size_t c = 0; c < 3; c++) {
            s->bent[3 * v + c] = d[3 * v + c] - mean[c];
            out[3 * v + c] = s->stiff * s->bent[3 * v + c];
        }
    }
    for (size_t v = 0; v < m->nv; v++) {
        int32_t n = m->at[v + 1] - m->at[v];

        for (int32_t i = m->at[v]; i < m->at[v + 1]; i++)
            for (int c = 0; c < 3; c++)
                out[3 * m->link[i] + c] -=
                    s->stiff * s->bent[3 * v + (size_t)c] / n;
        smooth_pull_add(out + 3 * v, s, v, d + 3 * v);
    }
}

int smooth_fit(double *d, const struct smooth_mesh *m, const double *target,
               const double *weight, const double *normal,
               const double *along, double stiff, int rounds,
               struct error *err)
{
    size_t n = 3 * m->nv;
    struct arena room = {0};
    double *r = arena_take(&room, n, sizeof *r);
    double *p = arena_take(&room, n, sizeof *p);
    double *q = arena_take(&room, n, sizeof *q);
    double *z = arena_take(&room, n, sizeof *z);
    struct system s = {m, weight, normal, along, stiff,
                       arena_take(&room, n, sizeof *s.bent)};

    if (arena_check(&room, "a smooth fit", err)) {
        arena_release(&room);
        return -1;
    }
    for (size_t v = 0; v < m->nv; v++)
        smooth_pull_add(r + 3 * v, &s, v, target + 3 * v);
    double start = dot_many(r, r, n);
    smooth_system_apply(q, &s, d);
    for (size_t i = 0; i < n; i++)
        r[i] -= q[i];
    double before = 0;
    for (int round = 0; round < rounds && dot_many(r, r, n) > 1e-14 * start;
         round++) {
        for (size_t i = 0; i < n; i++)      /* about A's diagonal */
            z[i] = r[i] / (weight[i / 3] + 1.2 * stiff + 1e-30);
        double rz = dot_many(r, z, n);
        for (size_t i = 0; i < n; i++)
            p[i] = z[i] + (round ? rz / before * p[i] : 0);
        before = rz;
        smooth_system_apply(q, &s, p);
        double step = rz / dot_many(p, q, n);
        for (size_t i = 0; i < n; i++) {
            d[i] += step * p[i];
            r[i] -= step * q[i];
        }
    }
    arena_release(&room);
    return 0;
}
