/* The slope of what the source's camera saw (tilt.h). */
#include "lib/avatar/tilt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/coverage.h"
#include "lib/base/slices.h"
#include "lib/base/camera.h"
#include "lib/base/parallel.h"
#include "lib/base/resample.h"

#define SMOOTH 2.0f     /* cells */
#define ROUND 0.6f      /* depth that an outline falls by, head units: about half
                         * of a head */

int tilt_init(struct tilt *t, size_t n, struct error *err)
{
    const struct slice slices[] = {
        {&t->depth, n * n, false}, {&t->person, n * n, false},
        {&t->smooth, n * n, false}, {&t->tmp, n * n, false},
        {&t->slope, 2 * n * n, false}
    };

    t->n = n;
    return slices_allocate(&t->block, slices, sizeof slices / sizeof *slices,
                           false, err);
}

void tilt_release(struct tilt *t)
{
    free(t->block);
    memset(t, 0, sizeof *t);
}

/* Depth from the plane's on, and presence, at cell k: both times the person's
 * matte. */
PARALLEL(tilt_map, k, struct tilt *, t, const struct source_picture *, picture,
         const struct source_mesh *, mesh)
{
    const size_t n = t->n;
    const float at[2] = {(float)(2 * (k % n) + 1) / (float)n - 1,
                         (float)(2 * (k / n) + 1) / (float)n - 1};
    const float z = mesh->depth[k];
    float rgba[4];

    source_picture_sample(rgba, picture, at, 1);
    t->person[k] = fminf(rgba[3], 1);
    t->depth[k] = isfinite(z) ? t->person[k] * (z - mesh->cam[11]) : 0;
}

void tilt_find(struct tilt *t, const struct source_picture *picture,
               const struct source_mesh *mesh)
{
    const size_t n = t->n;
    const float step = 2 * source_mesh_spacing(mesh, n);

    parallel_each(tilt_map, n * n, n, t, picture, mesh);
    coverage_blur(t->smooth, t->depth, n, SMOOTH, t->tmp);
    coverage_blur(t->depth, t->person, n, SMOOTH, t->tmp);
    /* the mean depth of the person, and down its outline */
    for (size_t k = 0; k < n * n; k++)
        t->smooth[k] = t->smooth[k] / fmaxf(t->depth[k], 1e-3f) -
                       ROUND * t->depth[k];
    for (size_t k = 0; k < n * n; k++) {
        const size_t x = k % n, y = k / n;

        t->slope[2 * k] = (t->smooth[x + 1 < n ? k + 1 : k] -
                           t->smooth[x > 0 ? k - 1 : k]) / step;
        t->slope[2 * k + 1] = (t->smooth[y + 1 < n ? k + n : k] -
                               t->smooth[y > 0 ? k - n : k]) / step;
    }
}

/* Of Gaussian i. */
PARALLEL(tilt_sample_part, i, float *, tilt, const struct tilt *, t,
         const float *, uv, const float *, neck)
{
    const float at[2] = {2 * uv[2 * i] - 1, 2 * uv[2 * i + 1] - 1};
    float *to = tilt + 2 * i;

    grid_sample(to, t->slope, at, 1, t->n, t->n, 2, 1, false, RESAMPLE_BORDER);
    const float steep = sqrtf(to[0] * to[0] + to[1] * to[1]);
    const float by = (1 - neck[i]) * fminf(1, TILT_STEEPEST / fmaxf(steep, 1));
    for (int k = 0; k < 2; k++)
        to[k] *= by;
}

void tilt_sample(float *tilt, const struct tilt *t, const float *uv,
                 const float *neck, size_t N)
{
    parallel_each(tilt_sample_part, N, 256, tilt, t, uv, neck);
}
