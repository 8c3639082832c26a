/* Edges counted face by face; normals summed likewise. */
#include "lib/lab/head/surface.h"

#include <string.h>

#include "lib/base/vec3.h"

int surface_init(struct surface *m, const int32_t *faces, size_t nf, size_t nv,
                 struct arena *memory, struct error *err)
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

void surface_mean(double out[3], const struct surface *m, const double *x,
                  size_t v)
{
    int32_t first = m->at[v], end = m->at[v + 1];

    for (int c = 0; c < 3; c++) {
        out[c] = first < end ? 0 : x[3 * v + (size_t)c];
        for (int32_t i = first; i < end; i++)
            out[c] += x[3 * m->link[i] + c] / (end - first);
    }
}

void surface_normals(float *n, const float *p, size_t nv,
                     const int32_t *faces, size_t nf)
{
    memset(n, 0, 3 * nv * sizeof *n);
    for (size_t i = 0; i < nf; i++) {
        const int32_t *v = faces + 3 * i;
        float a[3], b[3], c[3];

        sub3(a, p + 3 * v[1], p + 3 * v[0]);
        sub3(b, p + 3 * v[2], p + 3 * v[0]);
        cross3(c, a, b);
        for (int k = 0; k < 3; k++)
            mad3(n + 3 * v[k], n + 3 * v[k], c, 1);
    }
    for (size_t i = 0; i < nv; i++)
        unit3(n + 3 * i);
}
