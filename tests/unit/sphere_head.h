/* A head for tests that need a closed mesh and no likeness: a sphere of
 * rings x segments vertices with a mouth ring in front. */
#ifndef SPID_TESTS_SPHERE_HEAD_H
#define SPID_TESTS_SPHERE_HEAD_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "lib/base/random.h"
#include "lib/head/head.h"

#define SPHERE_EXP 4

/* Rings from top to bottom, poles included: V = rings * segments + 2. */
static inline void sphere_head(struct head *h, size_t rings, size_t segments)
{
    static const int32_t parents[5] = {-1, 0, 1, 1, 1};
    size_t V = rings * segments + 2, F = 2 * rings * segments, n = 0;
    float *x = calloc(3 * V, sizeof *x), *w = calloc(5 * V, sizeof *w);
    float *J = calloc(5 * V, sizeof *J), *zero = calloc(3 * V, sizeof *x);
    float *pd = calloc(108 * V, sizeof *pd);
    float *sd = calloc(3 * V * (2 + SPHERE_EXP), sizeof *sd);
    int32_t *f = calloc(3 * F, sizeof *f), lips[64];
    size_t nlips = 0;
    struct random r;
    struct error err;

    random_init(&r, 1, "sphere_head");
    for (size_t v = 0; v < V; v++) {
        size_t i = v / segments, j = v % segments;
        double up = v >= V - 2 ? (v == V - 2 ? 0 : M_PI)
                               : M_PI * (double)(i + 1) / (double)(rings + 1);
        double turn = 2 * M_PI * (double)j / (double)segments;

        x[3 * v] = (float)(0.08 * sin(up) * sin(turn));
        x[3 * v + 1] = (float)(0.11 * cos(up));
        x[3 * v + 2] = (float)(0.09 * sin(up) * cos(turn));
        for (int k = 0; k < 5; k++)
            J[(size_t)k * V + v] = 1.0f / (float)V;
        w[5 * v + 1] = 1;
        if (x[3 * v + 1] < -0.03f && x[3 * v + 2] > 0) {
            w[5 * v + 1] = 0.3f;        /* the lower front follows the jaw */
            w[5 * v + 2] = 0.7f;
        }
        if (fabsf(x[3 * v]) < 0.035f && x[3 * v + 2] > 0 &&
            fabsf(x[3 * v + 1] + 0.04f) < 0.02f && nlips < 64)
            lips[nlips++] = (int32_t)v;
    }
    for (size_t i = 0; i < 3 * V * (2 + SPHERE_EXP); i++)
        sd[i] = (float)random_range(&r, -0.002, 0.002);
    for (size_t i = 0; i < 108 * V; i++)
        pd[i] = (float)random_range(&r, -0.001, 0.001);
    for (size_t i = 0; i + 1 < rings; i++)
        for (size_t j = 0; j < segments; j++) {
            int32_t a = (int32_t)(i * segments + j);
            int32_t b = (int32_t)(i * segments + (j + 1) % segments);
            int32_t quad[6] = {a, a + (int32_t)segments, b, b,
                               a + (int32_t)segments,
                               b + (int32_t)segments};
            for (int k = 0; k < 6; k++)
                f[n++] = quad[k];
        }
    for (size_t j = 0; j < segments; j++) {
        size_t last = (rings - 1) * segments, k = (j + 1) % segments;
        int32_t caps[6] = {(int32_t)V - 2, (int32_t)j, (int32_t)k,
                           (int32_t)V - 1, (int32_t)(last + k),
                           (int32_t)(last + j)};
        for (int c = 0; c < 6; c++)
            f[n++] = caps[c];
    }
    struct head_arrays a = {
        .V = V, .F = n / 3, .nshape = 2, .nexp = SPHERE_EXP, .scale = 5,
        .v_template = x, .f = f, .shapedirs = sd, .posedirs = pd,
        .J_regressor = J, .weights = w, .parents = parents,
        .l_eyelid = zero, .r_eyelid = zero, .lip_inner = lips,
        .nlip_inner = nlips, .lip_upper_outer = lips,
        .nlip_upper_outer = nlips
    };
    if (head_init(h, &a, &err)) {
        printf("%s\n", err.text);
        exit(1);
    }
    free(x);
    free(w);
    free(J);
    free(zero);
    free(pd);
    free(sd);
    free(f);
}

#endif
