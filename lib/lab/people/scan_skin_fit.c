/* Light divided out of photographs, their mean and principal components, and
 * grain. */
#include "lib/lab/people/scan_skin_fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cholesky.h"
#include "lib/base/parallel.h"
#include "lib/base/vec3.h"
#include "lib/lab/people/lens.h"

#define N SKIN_SIZE
#define M SKIN_SLOW
#define STEP (N / M)
#define PLANE ((size_t)M * M)
#define JACOBI_SWEEPS 9
#define JACOBI_ZERO 1e-16       /* smaller entries are left */

int skin_fit_init(struct skin_fit *t, size_t n, struct arena *memory,
                  struct error *err)
{
    t->n = n;
    t->slow = arena_take(memory, 3 * n * PLANE, sizeof *t->slow);
    t->weight = arena_take(memory, n * PLANE, sizeof *t->weight);
    t->normal = arena_take(memory, 3 * n * PLANE, sizeof *t->normal);
    t->mean = arena_take(memory, n, sizeof *t->mean);
    return brow_fit_init(&t->brows, n, memory, err);
}

/* ---- one photograph ----------------------------------------------------- */

/* What is finer than about a centimetre in the luminance; room (3,N,N). */
static void skin_take_grain(int8_t *grain, float *room,
                            const struct skin_sample *o)
{
    float *v = room, *w = v + N * N, *tmp = w + N * N;

    for (int i = 0; i < N * N; i++) {
        const float *l = o->log + 3 * i;
        w[i] = o->weight[i];
        v[i] = w[i] * (0.3f * l[0] + 0.5f * l[1] + 0.2f * l[2]);
    }
    lens_box(v, tmp, N, 5);
    lens_box(w, tmp, N, 5);
    for (int i = 0; i < N * N; i++) {
        const float *l = o->log + 3 * i;
        float g = 0.3f * l[0] + 0.5f * l[1] + 0.2f * l[2];
        g = o->weight[i] > 0 && w[i] > 1e-7f
            ? (g - v[i] / w[i]) * ramp(0.3f, 0.9f, o->weight[i]) : 0;
        grain[i] = (int8_t)lrintf(clampf(g, -0.49f, 0.49f) * 256);
    }
}

/* Weighted means over STEP x STEP texels, against the person's mean. */
static void skin_take_slow(struct skin_fit *t, size_t i,
                           const struct skin_sample *o)
{
    for (int y = 0; y < M; y++)
        for (int x = 0; x < M; x++) {
            float sum[3] = {0, 0, 0}, n[3] = {0, 0, 0}, all = 1e-9f;
            size_t to = i * PLANE + (size_t)(y * M + x);
            for (int k = 0; k < STEP * STEP; k++) {
                int at = (y * STEP + k / STEP) * N + x * STEP + k % STEP;
                mad3(sum, sum, o->log + 3 * at, o->weight[at]);
                mad3(n, n, o->normal + 3 * at, o->weight[at]);
                all += o->weight[at];
            }
            for (size_t k = 0; k < 3; k++)
                t->slow[3 * to + k] = all > 1 ? sum[k] / all - o->mean[k] : 0;
            t->weight[to] = all > 1 ? all / (STEP * STEP) : 0;
            for (size_t k = 0; all > 1 && k < 3; k++)
                t->normal[3 * to + k] = n[k] / all;
        }
}

int skin_fit_add(struct skin_fit *t, size_t i, const struct skin_model *s,
                 const struct scan_face *f, const struct register_map *m,
                 const char *path, const float *point, struct error *err)
{
    float *room = calloc(10 * N * N, sizeof *room);

    if (!room)
        return error_set(err, EX_OSERR, "out of memory for skin");
    struct skin_sample o = {room, room + 3 * N * N, room + 6 * N * N,
                            {0, 0, 0}};
    int rc = skin_sample_take(&o, s, &t->chart, f, m, path, point, err);
    if (!rc) {
        skin_take_slow(t, i, &o);
        brow_fit_add(&t->brows, i, o.log, s->brow);
        copy3(t->mean[i], o.mean);
        skin_take_grain(t->grain + i * N * N, room + 7 * N * N, &o);
    }
    free(room);
    return rc;
}

/* ---- all of them -------------------------------------------------------- */

/* Fill texels of v (M,M,c) of weight 0 from their neighbours: coarser and
 * coarser means, read back. */
static void skin_fill(float *v, float *w, int c, int m)
{
    if (m < 4)
        return;
    int h = m / 2;
    float *cv = calloc((size_t)(h * h * c), sizeof *cv);
    float *cw = calloc((size_t)(h * h), sizeof *cw);
    for (int i = 0; cv && cw && i < m * m; i++) {
        int to = i / m / 2 * h + i % m / 2;
        cw[to] += w[i];
        for (int k = 0; k < c; k++)
            cv[to * c + k] += w[i] * v[i * c + k];
    }
    for (int i = 0; cv && cw && i < h * h; i++) {
        for (int k = 0; k < c; k++)
            cv[i * c + k] /= maxf(cw[i], 1e-6f);
        cw[i] = minf(cw[i], 1);
    }
    if (cv && cw)
        skin_fill(cv, cw, c, h);
    for (int y = 0; cv && cw && y < m; y++)
        for (int x = 0; x < m; x++) {
            float a = clampf(w[y * m + x] * 3, 0, 1);
            float fx = clampf(((float)x + 0.5f) / 2 - 0.5f, 0,
                              (float)h - 1.001f);
            float fy = clampf(((float)y + 0.5f) / 2 - 0.5f, 0,
                              (float)h - 1.001f);
            int u = (int)fx, t = (int)fy;
            fx -= (float)u;
            fy -= (float)t;
            for (int k = 0; k < c; k++) {
                const float *q = cv + (t * h + u) * c + k;
                float s = lerpf(lerpf(q[0], q[c], fx),
                                lerpf(q[h * c], q[h * c + c], fx), fy);
                v[(y * m + x) * c + k] = lerpf(s, v[(y * m + x) * c + k], a);
            }
        }
    free(cv);
    free(cw);
}

/* Mean over people (M,M,3) and its weight. */
static void skin_find_mean(float *mean, float *weight, const struct skin_fit *t)
{
    for (size_t p = 0; p < PLANE; p++) {
        float sum[3] = {0, 0, 0}, all = 0;
        for (size_t i = 0; i < t->n; i++) {
            float w = t->weight[i * PLANE + p];
            mad3(sum, sum, t->slow + 3 * (i * PLANE + p), w);
            all += w;
        }
        for (size_t k = 0; k < 3; k++)
            mean[3 * p + k] = all > 0 ? sum[k] / all : 0;
        weight[p] = all / (float)t->n > 0.15f ? all / (float)t->n : 0;
    }
}

#define LIGHT_TERMS 9

/* Spherical harmonics of the first three bands, not normalised. */
static void skin_light_terms(double o[LIGHT_TERMS], const float n[3])
{
    double x = (double)n[0], y = (double)n[1], z = (double)n[2];
    const double t[LIGHT_TERMS] = {1, x, y, z, x * x - y * y,
                                   3 * z * z - 1, x * y, x * z, y * z};

    memcpy(o, t, sizeof t);
}

/* The studio's light: what of the mean follows the normals.  out: its log on
 * a normal of each texel, without the constant. */
static void skin_find_light(double light[3][LIGHT_TERMS], const float *mean,
                            const float *weight, const struct skin_fit *t,
                            const struct skin_model *s)
{
    for (int c = 0; c < 3; c++) {
        double a[LIGHT_TERMS * LIGHT_TERMS] = {0};
        memset(light[c], 0, sizeof light[c]);
        for (size_t p = 0; p < PLANE; p++) {
            size_t at = (p / M * N + p % M) * STEP;
            float n[3] = {0, 0, 0};
            double v[LIGHT_TERMS];
            if (weight[p] <= 0 || s->lip[at] || s->brow[at])
                continue;
            for (size_t i = 0; i < t->n; i++)
                mad3(n, n, t->normal + 3 * (i * PLANE + p),
                     t->weight[i * PLANE + p]);
            unit3(n);
            skin_light_terms(v, n);
            double w = (double)weight[p];
            for (int u = 0; u < LIGHT_TERMS; u++) {
                for (int k = 0; k < LIGHT_TERMS; k++)
                    a[u * LIGHT_TERMS + k] += w * v[u] * v[k];
                light[c][u] += w * v[u] * (double)mean[3 * p + (size_t)c];
            }
        }
        for (int u = 0; u < LIGHT_TERMS; u++)
            a[u * (LIGHT_TERMS + 1)] += 1;
        cholesky_solve(light[c], a, LIGHT_TERMS);
    }
}

/* Divide the light out of everyone: by luminance, so that colours stay. */
static void skin_divide_light(struct skin_fit *t, double light[3][LIGHT_TERMS])
{
    double front[LIGHT_TERMS], mean[LIGHT_TERMS];
    const float z[3] = {0, 0, 1};

    skin_light_terms(front, z);
    for (int u = 0; u < LIGHT_TERMS; u++)
        mean[u] = 0.3 * light[0][u] + 0.5 * light[1][u] + 0.2 * light[2][u];
    for (size_t i = 0; i < t->n * PLANE; i++) {
        double v[LIGHT_TERMS], s = 0;
        if (t->weight[i] <= 0)
            continue;
        skin_light_terms(v, t->normal + 3 * i);
        for (int u = 1; u < LIGHT_TERMS; u++)
            s += mean[u] * (v[u] - front[u]);
        for (size_t k = 0; k < 3; k++)
            t->slow[3 * i + k] -= clampf((float)s, -1.2f, 0.6f);
    }
}

/* Everyone as a difference from the mean, with holes filled, and in a mirror:
 * row 2 i + 1 of x (2n, M,M,3). */
static void skin_spread_out(float *x, const struct skin_fit *t,
                            const float *mean)
{
    for (size_t i = 0; i < t->n; i++) {
        float *o = x + 2 * i * 3 * PLANE, *w = t->weight + i * PLANE;
        float *flip = o + 3 * PLANE;
        for (size_t p = 0; p < PLANE; p++)
            for (size_t k = 0; k < 3; k++)
                o[3 * p + k] = w[p] > 0
                    ? clampf(t->slow[3 * (i * PLANE + p) + k]
                             - mean[3 * p + k], -0.8f, 0.8f) : 0;
        skin_fill(o, w, 3, M);
        for (size_t p = 0; p < PLANE; p++)
            for (size_t k = 0; k < 3; k++) {
                /* own overall colour, which the filling has left out */
                o[3 * p + k] += t->mean[i][k];
                flip[3 * (p / M * M + M - 1 - p % M) + k] = o[3 * p + k];
            }
    }
}

/* The n numbers at x and at y, `step` apart, turned into each other by the
 * angle of cosine c and sine s: two columns of a matrix, or two rows. */
static void skin_turn(double *x, double *y, size_t n, size_t step, double c,
                      double s)
{
    for (size_t i = 0; i < n; i++) {
        double a = x[i * step], b = y[i * step];

        x[i * step] = c * a - s * b;
        y[i * step] = s * a + c * b;
    }
}

/* Eigenvectors of the symmetric g (n,n) in the columns of v, by Jacobi's
 * rotations: each makes one entry off the diagonal zero (Golub and Van Loan,
 * Matrix Computations, 8.5). */
static void skin_eigen(double *g, double *v, size_t n)
{
    memset(v, 0, n * n * sizeof *v);
    for (size_t i = 0; i < n; i++)
        v[i * n + i] = 1;
    for (size_t i = 0; i < JACOBI_SWEEPS * n * n; i++) {
        const size_t p = i / n % n, q = i % n;
        double gpq = g[p * n + q];

        if (q <= p || fabs(gpq) < JACOBI_ZERO)
            continue;
        double th = (g[q * n + q] - g[p * n + p]) / (2 * gpq);
        double t = (th < 0 ? -1 : 1) / (fabs(th) + sqrt(th * th + 1));
        double c = 1 / sqrt(t * t + 1), s = t * c;

        skin_turn(g + p, g + q, n, n, c, s);
        skin_turn(g + p * n, g + q * n, n, 1, c, s);
        skin_turn(v + p, v + q, n, n, c, s);
    }
}

PARALLEL(skin_find_parts_part, i, const float *, x, double *, g, size_t, d,
         size_t, every, size_t, n)
{
    for (size_t j = 0; j <= i; j++) {
        float sum = 0;
        const float *a = x + i * d, *b = x + j * d;
        for (size_t p = 0; p + 2 < d; p += 3 * every)
            sum += a[p] * b[p] + a[p + 1] * b[p + 1] + a[p + 2] * b[p + 2];
        g[i * n + j] = g[j * n + i] = (double)sum;
    }
}

float *skin_find_parts(const float *x, size_t n, size_t d, size_t every,
                       int parts, struct arena *memory, struct error *err)
{
    double *g = arena_take(memory, n * n, sizeof *g);
    double *v = arena_take(memory, n * n, sizeof *v);
    float *part = arena_take(memory, (size_t)parts * d, sizeof *part);

    if (arena_check(memory, "skin", err))
        return NULL;
    parallel_each(skin_find_parts_part, n, 1, x, g, d, every, n);
    skin_eigen(g, v, n);
    for (int k = 0; k < parts; k++) {
        size_t best = 0;
        for (size_t i = 1; i < n; i++)
            if (g[i * n + i] > g[best * n + best])
                best = i;
        g[best * n + best] = -1;
        for (size_t i = 0; i < n; i++) {
            float w = (float)(v[i * n + best] / sqrt((double)n));
            float *o = part + (size_t)k * d;
            for (size_t p = 0; p < d; p++)
                o[p] += w * x[i * d + p];
        }
    }
    return part;
}

/* Take the mean off the rows, into s->mean with the studio's mean added. */
static void skin_center(struct skin_model *s, float *x, size_t n,
                        const float *mean)
{
    size_t d = 3 * PLANE;
    float lum = 0;

    for (size_t p = 0; p < d; p++) {
        float m = 0;
        for (size_t i = 0; i < n; i++)
            m += x[i * d + p] / (float)n;
        for (size_t i = 0; i < n; i++)
            x[i * d + p] -= m;
        s->mean[p] = m;
    }
    for (size_t p = 0; p < PLANE; p++)
        for (size_t k = 0; k < 3; k++)
            s->mean[3 * p + k] += 0.5f * (mean[3 * p + k]
                + mean[3 * (p / M * M + M - 1 - p % M) + k]);
    /* photographs know albedo up to a factor: fair skin is about 0.36 */
    for (size_t p = M * 3 / 8 * M; p < M * 5 / 8 * M; p++)
        lum += (0.3f * expf(s->mean[3 * p]) + 0.59f * expf(s->mean[3 * p + 1])
                + 0.11f * expf(s->mean[3 * p + 2])) / (M / 4 * M);
    for (size_t p = 0; p < d; p++)
        s->mean[p] += logf(0.36f / lum);
}

/* What the grain of all has in common, evened over the sides, comes off it
 * into s->crease. */
static void skin_split_grain(struct skin_model *s, const struct skin_fit *t)
{
    for (size_t i = 0; i < t->n; i++)
        for (int p = 0; p < N * N; p++)
            s->crease[p] += 0.5f / 256 / (float)t->n
                            * (float)(t->grain[i * N * N + (size_t)p]
                                      + t->grain[i * N * N
                                                 + (size_t)(p / N * N + N - 1
                                                            - p % N)]);
    for (size_t i = 0; i < t->n; i++)
        for (size_t p = 0; p < N * N; p++) {
            int8_t *g = t->grain + i * N * N + p;
            if (*g)
                *g = (int8_t)lrintf(clampf((float)*g - 256 * s->crease[p],
                                           -126, 126));
        }
}

int skin_fit_finish(struct skin_model *s, struct skin_fit *t,
                    struct arena *memory, struct error *err)
{
    double light[3][LIGHT_TERMS];
    struct arena room = {0};
    float *x = arena_take(&room, 2 * t->n * 3 * PLANE, sizeof *x);
    float *mean = arena_take(&room, 3 * PLANE, sizeof *mean);
    float *weight = arena_take(&room, PLANE, sizeof *weight);
    int rc = -1;

    s->mean = arena_take(memory, 3 * PLANE, sizeof *s->mean);
    s->crease = arena_take(memory, N * N, sizeof *s->crease);
    if (arena_check(&room, "skin", err) || arena_check(memory, "skin", err))
        goto out;
    skin_find_mean(mean, weight, t);
    skin_find_light(light, mean, weight, t, s);
    skin_divide_light(t, light);
    skin_find_mean(mean, weight, t);
    skin_fill(mean, weight, 3, M);
    skin_spread_out(x, t, mean);
    skin_center(s, x, 2 * t->n, mean);
    s->parts = SKIN_PARTS < (int)(2 * t->n) ? SKIN_PARTS : (int)(2 * t->n);
    /* every third texel will do */
    s->part = skin_find_parts(x, 2 * t->n, 3 * PLANE, 3, s->parts, memory,
                              err);
    skin_split_grain(s, t);
    rc = !s->part || brow_fit_finish(&s->brows, &t->brows, memory, err) ? -1
                                                                        : 0;
    s->people = t->n;
    s->grain = t->grain;
out:
    arena_release(&room);
    return rc;
}
