/* Edge-midpoint subdivision of a triangle mesh (the dynamic branch's "dense"
 * vertices, Section 3.2): edges found by sorting, means of their ends. */
#include "lib/base/densify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/sort.h"

/* All sides of all faces as sorted 64-bit keys; doubles are dropped. */
int densify_init(struct densify *d, const int32_t *faces, size_t F, size_t V,
                 struct error *err)
{
    uint64_t *key = malloc((3 * F + 1) * sizeof *key);
    size_t n = 0;

    memset(d, 0, sizeof *d);
    if (!key)
        return error_set(err, EX_OSERR, "no memory for %zu edges", 3 * F);
    for (size_t f = 0; f < F; f++)
        for (int k = 0; k < 3; k++) {
            uint64_t i = (uint64_t)faces[3 * f + k];
            uint64_t j = (uint64_t)faces[3 * f + (k + 1) % 3];

            if (i != j)
                key[n++] = i < j ? i << 32 | j : j << 32 | i;
        }
    sort_keys(key, n);
    size_t E = 0;
    for (size_t i = 0; i < n; i++)
        if (i == 0 || key[i] != key[i - 1])
            key[E++] = key[i];
    d->V = V;
    d->E = E;
    d->edge = malloc((2 * E + 1) * sizeof *d->edge);
    d->degree = calloc(V + 1, sizeof *d->degree);
    for (size_t e = 0; d->edge && d->degree && e < E; e++) {
        d->edge[2 * e] = (int32_t)(key[e] >> 32);
        d->edge[2 * e + 1] = (int32_t)(key[e] & 0xffffffff);
        d->degree[d->edge[2 * e]]++;
        d->degree[d->edge[2 * e + 1]]++;
    }
    free(key);
    if (!d->edge || !d->degree) {
        densify_release(d);
        return error_set(err, EX_OSERR, "no memory for %zu edges", E);
    }
    return 0;
}

void densify_release(struct densify *d)
{
    free(d->edge);
    free(d->degree);
    memset(d, 0, sizeof *d);
}

void densify_midpoints(float *out, const float *x, const struct densify *d,
                       size_t C)
{
    for (size_t e = 0; e < d->E; e++) {
        const float *a = x + C * (size_t)d->edge[2 * e];
        const float *b = x + C * (size_t)d->edge[2 * e + 1];

        for (size_t c = 0; c < C; c++)
            out[C * e + c] = 0.5f * (a[c] + b[c]);
    }
}

void densify_forward(float *out, const float *x, const struct densify *d,
                     size_t C)
{
    memmove(out, x, d->V * C * sizeof *out);
    densify_midpoints(out + d->V * C, x, d, C);
}

/* A midpoint's gradient goes to its ends, half each. */
void densify_backward(float *dx, const float *dout, const struct densify *d,
                      size_t C)
{
    const float *dmid = dout + d->V * C;

    for (size_t i = 0; i < d->V * C; i++)
        dx[i] += dout[i];
    for (size_t e = 0; e < d->E; e++) {
        float *a = dx + C * (size_t)d->edge[2 * e];
        float *b = dx + C * (size_t)d->edge[2 * e + 1];

        /* v_mid = (v_i + v_j) / 2 */
        for (size_t c = 0; c < C; c++) {
            a[c] += 0.5f * dmid[C * e + c];
            b[c] += 0.5f * dmid[C * e + c];
        }
    }
}

/* As densify_forward, for the listed vertices only. */
void densify_gather(float *out, const int32_t *vertex, size_t n,
                    const float *x, const struct densify *d)
{
    size_t end[2];              /* a vertex' are both itself */

    for (size_t i = 0; i < n; i++) {
        densify_ends(end, d, vertex ? (size_t)vertex[i] : i);
        for (size_t c = 0; c < 3; c++)
            out[3 * i + c] = 0.5f * (x[3 * end[0] + c] + x[3 * end[1] + c]);
    }
}

void densify_gather_backward(float *dx, const float *dout,
                             const int32_t *vertex, size_t n,
                             const struct densify *d)
{
    size_t V = d->V;

    for (size_t i = 0; i < n; i++, dout += 3) {
        size_t k = vertex ? (size_t)vertex[i] : i;

        if (k < V) {
            for (int c = 0; c < 3; c++)
                dx[3 * k + (size_t)c] += dout[c];
            continue;
        }
        float *a = dx + 3 * (size_t)d->edge[2 * (k - V)];
        float *b = dx + 3 * (size_t)d->edge[2 * (k - V) + 1];
        /* v_mid = (v_i + v_j) / 2 */
        for (int c = 0; c < 3; c++) {
            a[c] += 0.5f * dout[c];
            b[c] += 0.5f * dout[c];
        }
    }
}

void densify_spacing(float *spacing, const float *x, const struct densify *d)
{
    memset(spacing, 0, (d->V + d->E) * sizeof *spacing);
    for (size_t e = 0; e < d->E; e++) {
        size_t i = (size_t)d->edge[2 * e], j = (size_t)d->edge[2 * e + 1];
        float s = 0;

        for (int c = 0; c < 3; c++)
            s += (x[3 * i + c] - x[3 * j + c]) * (x[3 * i + c] - x[3 * j + c]);
        s = 0.5f * sqrtf(s);
        spacing[d->V + e] = s;
        spacing[i] += s;
        spacing[j] += s;
    }
    for (size_t v = 0; v < d->V; v++)
        spacing[v] /= (float)(d->degree[v] > 0 ? d->degree[v] : 1);
}
