/* Phase B of the three branches as plain geometry: midpoints of the driven
 * mesh, the neck blend and the mouth's shift, each with its gradient under
 * it. */
#include "lib/base/drive.h"

#include <string.h>

#include "lib/base/neck_blend.h"

/* Both rigid motions of a frame, about a pivot that stays behind. */
void drive_bodies(struct drive_frame *f, const struct drive *d,
                  const float cam[12])
{
    neck_blend_body(f->mesh, d->pivot, neck_blend_upright, cam);
    neck_blend_body(f->plane, d->pivot, d->source, cam);
    memset(f->stay, 0, sizeof f->stay);
    if (!d->view)
        return;
    neck_blend_stay(f->stay, d->pivot, d->view, cam);
    for (int i = 0; i < 3; i++) {
        f->mesh[4 * i + 3] += f->stay[i];
        f->plane[4 * i + 3] += f->stay[i];
    }
}

/* Midpoints of the driven vertices, then the neck blend. */
void drive_dynamic(float *out, float *densified, const struct drive *d,
                   const struct drive_frame *f, const struct densify *mesh,
                   const float *verts)
{
    densify_gather(densified, d->vertex, d->dynamic, verts, mesh);
    neck_blend_points(out, densified, d->weight, d->dynamic, f->mesh);
}

/* Blend first, then midpoints to their ends. */
void drive_dynamic_backward(float *dverts, float dcam[12], float *ddensified,
                            const float *dout, const float *densified,
                            const struct drive *d,
                            const struct densify *mesh, const float cam[12])
{
    memset(ddensified, 0, 3 * d->dynamic * sizeof *ddensified);
    neck_blend_points_backward(ddensified, dcam, dout, densified, d->weight,
                               d->dynamic, d->pivot, neck_blend_upright, cam);
    densify_gather_backward(dverts, ddensified, d->vertex, d->dynamic, mesh);
}

/* The neck blend of source centres. */
void drive_static(float *out, const struct drive *d,
                  const struct drive_frame *f, size_t first, size_t count)
{
    neck_blend_points(out, d->mean + 3 * first, d->weight + first, count,
                      f->plane);
}

void drive_static_backward(float *dmean, float dcam[12], const float *dout,
                           const struct drive *d, size_t first, size_t count,
                           const float cam[12])
{
    neck_blend_points_backward(dmean, dcam, dout, d->mean + 3 * first,
                               d->weight + first, count, d->pivot, d->source,
                               cam);
}

void drive_jaw(float jaw[3], const float x[3], float share,
               const float hinge[3], const float chin[3])
{
    const float p[2] = {x[2] - hinge[2], x[1] - hinge[1]};
    const float c[2] = {chin[2] - hinge[2], chin[1] - hinge[1]};
    const float square = c[0] * c[0] + c[1] * c[1] + 1e-6f;

    jaw[0] = share * (p[0] * c[0] + p[1] * c[1]) / square;
    jaw[1] = jaw[0];
    jaw[2] = share * (p[1] * c[0] - p[0] * c[1]) / square;
}

/* mu = (g + q) + l_d - l_s, in this order of rounding, and the jaw's. */
void drive_mouth(float *out, const struct drive *d,
                 const struct drive_frame *f)
{
    const float *mean = d->mean + 3 * d->mouth;

    for (size_t i = 0; i < 3 * d->mouth_count; i++)
        out[i] = mean[i] + f->to[i % 3] - f->from[i % 3];
    for (size_t i = 0; d->jaw && i < d->mouth_count; i++) {
        const float *j = d->jaw + 3 * i, *chin = f->chin;

        out[3 * i] += j[0] * chin[0];
        out[3 * i + 1] += j[2] * chin[2] + j[1] * chin[1];
        out[3 * i + 2] += j[1] * chin[2] - j[2] * chin[1];
    }
}

/* Every Gaussian passes its gradient on, to its centre, to l_d and to the
 * chin. */
void drive_mouth_backward(float *dmean, float dto[3], float dchin[3],
                          const float *dout, const struct drive *d)
{
    for (size_t i = 0; i < 3 * d->mouth_count; i++) {
        dto[i % 3] += dout[i];
        dmean[i] += dout[i];
    }
    for (size_t i = 0; d->jaw && i < d->mouth_count; i++) {
        const float *j = d->jaw + 3 * i, *g = dout + 3 * i;

        dchin[0] += j[0] * g[0];
        dchin[1] += j[1] * g[1] - j[2] * g[2];
        dchin[2] += j[2] * g[1] + j[1] * g[2];
    }
}
