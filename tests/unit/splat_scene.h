/* Small random Gaussians for the rasteriser's tests. */
#ifndef SPID_TESTS_SPLAT_SCENE_H
#define SPID_TESTS_SPLAT_SCENE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/lab/bench/testscene.h"
#include "lib/splat/reference.h"
#include "lib/splat/splat.h"
#include "tests/check.h"
#include "tests/unit/levels.h"

__attribute__((unused)) static void *scene_grab(size_t n, size_t size)
{
    void *p = calloc(n + 1, size);

    if (!p)
        exit(1);
    return p;
}

/* ||x - t|| / ||t|| */
__attribute__((unused)) static double splat_relative(const float *x, const double *t, size_t n)
{
    double d = 0, s = 0;

    for (size_t i = 0; i < n; i++) {
        d += (x[i] - t[i]) * (x[i] - t[i]);
        s += t[i] * t[i];
    }
    return sqrt(d / fmax(s, 1e-300));
}

/* n Gaussians that fill a small picture, a few pixels wide. */
__attribute__((unused)) static void small_scene(struct testscene *t, size_t n,
                                                uint64_t seed)
{
    struct error err = {0};

    if (testscene_make(t, n, seed, &err)) {
        printf("FAILED: %s\n", err.text);
        exit(1);
    }
    for (size_t i = 0; i < 3 * n; i++)       /* small, and not round */
        ((float *)t->g.scale)[i] =
            fminf(t->g.scale[i], 0.15f) * (1 - 0.3f * (float)(i % 3));
}

#endif
