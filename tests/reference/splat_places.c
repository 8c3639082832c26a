/* Place channels of Gaussians in double, and their gradient. */
#include "tests/reference/splat_places.h"

#include <stdlib.h>
#include <string.h>

void reference_places_release(struct reference_places *p)
{
    free(p->uv);
    free(p->confidence);
    free(p->shorter);
    free(p->around);
    free(p->grain);
    free(p->unrolled);
    memset(p, 0, sizeof *p);
}

/* out (4) += a place's channels of this weight: `to`, seen at `at`, and shorter
 * by the share s along e. */
static void places_add(double *out, double weight, const double *to, double s,
                       const double at[2], const float e[2])
{
    const double along = s * (e[0] * at[0] + e[1] * at[1]);

    for (int k = 0; k < 2; k++)
        out[k] += weight * (to[k] - at[k] + along * e[k]);
    out[2] += weight;
    out[3] += weight * s;
}

void reference_places_fill(const struct reference *t,
                           const struct reference_places *p)
{
    const struct splat_place_side side = splat_place_side(&p->view);

    for (size_t i = 0; i < t->n; i++) {
        double *out = t->color + (i + 1) * (size_t)t->channels -
                      SPLAT_PLACE_CHANNELS;
        struct reference_point point;
        double at[2];

        reference_project(&point, t, i);
        splat_place_at(at, &p->view, 2 * point.x / t->width - 1,
                       2 * point.y / t->height - 1);
        memset(out, 0, SPLAT_PLACE_CHANNELS * sizeof *out);
        places_add(out, p->confidence[i], p->uv + 2 * i, p->shorter[i], at,
                   side.e);
        if (p->around)
            places_add(out, p->grain[i], p->around + 2 * i, p->unrolled[i], at,
                       side.e);
    }
}

void reference_places_backward(double center[2], const double *d,
                               const struct reference_point *at,
                               const struct reference *t,
                               const struct reference_places *p, size_t i)
{
    const struct splat_place_side side = splat_place_side(&p->view);
    double u, v, J[4];

    d += t->channels - SPLAT_PLACE_CHANNELS;
    const double along = p->shorter[i] * (side.e[0] * d[0] + side.e[1] * d[1]);
    u = -p->confidence[i] * (d[0] - along * side.e[0]);
    v = -p->confidence[i] * (d[1] - along * side.e[1]);
    splat_place_slope(J, &p->view, 2 * at->x / t->width - 1,
                      2 * at->y / t->height - 1);
    center[0] += 2.0 / t->width * (J[0] * u + J[2] * v);
    center[1] += 2.0 / t->height * (J[1] * u + J[3] * v);
}
