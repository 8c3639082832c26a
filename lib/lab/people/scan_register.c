/* Alternating: the pose by Gauss and Newton, then identity and expression
 * together as a ridge regression under that pose. */
#include "lib/lab/people/scan_register.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/cholesky.h"
#include "lib/base/vec3.h"

#define ROUNDS 3
#define SIGMA 2.5f              /* pixels that a landmark may be off */

int register_map_load(struct register_map *m, const struct scan_face *f,
                      const char *dir, struct arena *memory, struct error *err)
{
    const size_t one = 3 * (size_t)FACE_VERTICES;
    struct landmark_map map;
    char path[4096];

    snprintf(path, sizeof path, "%s/labels/mediapipe_to_ict.json", dir);
    if (landmark_map_read(&map, path, err))
        return -1;
    m->basis = arena_take(memory, 3 * LANDMARK_FACE * REGISTER_TERMS,
                          sizeof *m->basis);
    if (arena_check(memory, "landmarks", err))
        return -1;
    for (int i = 0; i < LANDMARK_FACE; i++) {
        m->vertex[i] = map.vertex[i];
        m->weight[i] = 1 / (0.1f + (float)map.spread[i]);
    }
    for (size_t t = 0; t < REGISTER_TERMS; t++)
        for (size_t i = 0; i < LANDMARK_FACE; i++)
            copy3(m->basis + 3 * (t * LANDMARK_FACE + i),
                  (t < SCAN_IDENTITIES
                   ? f->identity + t * one
                   : f->expression + (t - SCAN_IDENTITIES) * one)
                  + 3 * m->vertex[i]);
    return 0;
}

void register_project(float o[3], const struct registration *r,
                      const float p[3])
{
    float q[3], g;

    rot3(q, r->rot, p);
    g = r->scale / (1 - q[2] / REGISTER_DEPTH);
    o[0] = r->at[0] + g * q[0];
    o[1] = r->at[1] - g * q[1];
    o[2] = q[2];
}

/* The landmarks' places under the terms, head frame. */
static void register_place(float *p, const struct registration *r,
                           const struct register_map *m,
                           const struct scan_face *f)
{
    for (int i = 0; i < LANDMARK_FACE; i++)
        copy3(p + 3 * i, f->neutral + 3 * m->vertex[i]);
    for (size_t t = 0; t < REGISTER_TERMS; t++)
        for (size_t i = 0; r->term[t] != 0 && i < 3 * LANDMARK_FACE; i++)
            p[i] += r->term[t] * m->basis[3 * t * LANDMARK_FACE + i];
}

/* A step of the pose: small rotation, shift, relative scale. */
static void register_step_pose(struct registration *r,
                               const struct register_map *m, const float *p,
                               const float *point)
{
    double a[36] = {0}, b[6] = {0};

    for (int i = 0; i < LANDMARK_FACE; i++) {
        float o[3], q[3], w = m->weight[i];
        register_project(o, r, p + 3 * i);
        rot3(q, r->rot, p + 3 * i);
        double g = (double)r->scale / (1 - (double)(q[2] / REGISTER_DEPTH));
        double j[2][6] = {
            {0, g * (double)q[2], -g * (double)q[1], 1, 0, g * (double)q[0]},
            {g * (double)q[2], 0, -g * (double)q[0], 0, 1, -g * (double)q[1]}
        };
        for (int k = 0; k < 2; k++) {
            double e = (double)(point[3 * i + k] - o[k]);
            for (int u = 0; u < 6; u++) {
                for (int v = 0; v < 6; v++)
                    a[6 * u + v] += (double)w * j[k][u] * j[k][v];
                b[u] += (double)w * j[k][u] * e;
            }
        }
    }
    for (int u = 0; u < 6; u++)
        a[7 * u] *= 1 + 1e-9;
    cholesky_solve(b, a, 6);
    float w[3] = {(float)b[0], (float)b[1], (float)b[2]}, d[9], o[9];
    rodrigues33(d, w);
    mat3_mul(o, d, r->rot);
    memcpy(r->rot, o, sizeof o);
    r->at[0] += (float)b[3];
    r->at[1] += (float)b[4];
    r->scale *= 1 + (float)b[5];
}

/* Identity and expression under the pose. */
static int register_step_terms(struct registration *r,
                               const struct register_map *m,
                               const struct scan_face *f, const float *point)
{
    enum { N = REGISTER_TERMS };
    double *a = calloc(N * N + N, sizeof *a);
    float *row = malloc(2 * N * sizeof *row);

    if (!a || !row) {
        free(a);
        free(row);
        return -1;
    }
    double *b = a + N * N;
    for (int i = 0; i < LANDMARK_FACE; i++) {
        float o[3], q[3], t[3], w = m->weight[i] * 0.25f;
        const float *p = f->neutral + 3 * m->vertex[i];
        register_project(o, r, p);
        rot3(q, r->rot, p);
        float g = r->scale / (1 - q[2] / REGISTER_DEPTH) / SIGMA;
        for (size_t k = 0; k < N; k++) {
            rot3(t, r->rot, m->basis + 3 * (k * LANDMARK_FACE + (size_t)i));
            row[k] = g * t[0];
            row[N + k] = -g * t[1];
        }
        for (size_t c = 0; c < 2; c++) {
            double e = (double)((point[3 * i + (int)c] - o[c]) / SIGMA);
            const float *v = row + c * N;
            for (size_t u = 0; u < N; u++) {
                double x = (double)(w * v[u]);
#pragma omp simd
                for (size_t k = 0; k <= u; k++)
                    a[u * N + k] += x * (double)v[k];
                b[u] += x * e;
            }
        }
    }
    for (size_t u = 0; u < N; u++)
        a[u * N + u] += u < SCAN_IDENTITIES ? 1 : 30;
    cholesky_solve(b, a, N);
    for (size_t u = 0; u < N; u++)
        r->term[u] = clampf((float)b[u], u < SCAN_IDENTITIES ? -4 : -0.3f,
                            u < SCAN_IDENTITIES ? 4 : 1.2f);
    free(row);
    free(a);
    return 0;
}

int register_fit(struct registration *r, const struct register_map *m,
                 const struct scan_face *f, const float *point)
{
    float p[3 * LANDMARK_FACE];
    float x = 0, y = 0, sx = 0;

    *r = (struct registration){.rot = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int i = 0; i < LANDMARK_FACE; i++) {
        x += point[3 * i] / LANDMARK_FACE;
        y += point[3 * i + 1] / LANDMARK_FACE;
    }
    for (int i = 0; i < LANDMARK_FACE; i++)
        sx += fabsf(point[3 * i] - x) / LANDMARK_FACE;
    r->at[0] = x;
    r->at[1] = y;
    r->scale = sx / 0.2f;
    for (int round = 0; round < ROUNDS; round++) {
        register_place(p, r, m, f);
        for (int k = 0; k < (round ? 3 : 10); k++)
            register_step_pose(r, m, p, point);
        if (register_step_terms(r, m, f, point))
            return -1;
    }
    return 0;
}

void register_shape(float *out, const struct scan_face *f,
                    const struct registration *r)
{
    size_t one = 3 * (size_t)FACE_VERTICES;

    scan_face_fold(out, f, r->term, SCAN_IDENTITIES);
    for (size_t k = 0; k < ARKIT_COUNT; k++)
        for (size_t i = 0; i < one; i++)
            out[i] += r->term[SCAN_IDENTITIES + k]
                      * f->expression[k * one + i];
}
