/* The camera: a case worked by hand, rays against projection, gradients
 * against central differences, points behind. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "tests/check.h"
#include "tests/unit/camera_double.h"

/* Frontal camera at z = 12, S = 512: f = 3072.  The point (0.5, 0.25, 0.4) has
 * camera coordinates (0.5, -0.25, 11.6): u = 256 + 3072 * 0.5 / 11.6. */
static void by_hand(void)
{
    float cam[12], uv[2], z, x[3] = {0.5f, 0.25f, 0.4f}, o[3];

    camera_frontal(cam, 12);
    camera_project(uv, &z, cam, 512, x, 1);
    check("u by hand", fabs(uv[0] - (256 + 3072 * 0.5 / 11.6)), 1e-4);
    check("v by hand", fabs(uv[1] - (256 - 3072 * 0.25 / 11.6)), 1e-4);
    check("depth by hand", fabs((double)z - 11.6), 1e-6);
    camera_origin(o, cam);
    check("origin (0,0,12)", fabsf(o[0]) + fabsf(o[1]) + fabsf(o[2] - 12), 0);
    x[2] = 13;
    camera_project(uv, &z, cam, 512, x, 1);
    check("behind: z negative, uv finite",
          !(z < 0 && isfinite(uv[0]) && isfinite(uv[1])), 0);
}

static void camera_rays(struct random *r)
{
    double worst = 0;

    for (int rep = 0; rep < 100; rep++) {
        float a[3], R[9], t[3], cam[12], d[3], o[3], x[3], uv[2], z;

        for (int i = 0; i < 3; i++) {
            a[i] = (float)random_range(r, -2, 2);
            t[i] = (float)random_range(r, -0.3, 0.3);
        }
        t[2] += 12;
        rotation_exp(R, a);
        camera_make(cam, R, t);
        camera_ray(d, cam, 512, 100, 300);
        camera_origin(o, cam);
        for (int i = 0; i < 3; i++)
            x[i] = o[i] + 11 * d[i];
        camera_project(uv, &z, cam, 512, x, 1);
        worst = fmax(worst, fabs(uv[0] - 100.0) + fabs(uv[1] - 300.0) +
                     fabs(z - 11.0));
    }
    check("projection of a point on a pixel's ray", worst, 5e-3);
}

/* sum of duv * uv + dz * z for two points. */
static double camera_loss(const double *cam, const double *x, const double *duv,
                          const double *dz)
{
    double uv[4], z[2], sum = 0;

    camera_project_d(uv, z, cam, 64, x, 2);
    for (int i = 0; i < 4; i++)
        sum += duv[i] * uv[i];
    return sum + dz[0] * z[0] + dz[1] * z[1];
}

static void camera_gradients(struct random *r)
{
    double cam[12] = {0.8, 0.6, 0, 0.1, 0.6, -0.8, 0, -0.2, 0, 0, -1, 12};
    double x[6], duv[4], dz[2], dx[6] = {0}, dcam[12] = {0}, worst = 0;
    float camf[12], xf[6], duvf[4], dzf[2], dxf[6] = {0}, dcamf[12] = {0};
    double f32 = 0, h = 1e-6;

    for (int i = 0; i < 6; i++)
        xf[i] = (float)(x[i] = random_range(r, -0.5, 0.5));
    for (int i = 0; i < 4; i++)
        duvf[i] = (float)(duv[i] = random_range(r, -1, 1));
    for (int i = 0; i < 2; i++)
        dzf[i] = (float)(dz[i] = random_range(r, -1, 1));
    camera_project_backward_d(dx, dcam, duv, dz, cam, 64, x, 2);
    for (int i = 0; i < 12; i++)
        camf[i] = (float)cam[i];
    camera_project_backward(dxf, dcamf, duvf, dzf, camf, 64, xf, 2);
    for (int i = 0; i < 18; i++) {
        double *p = i < 6 ? &x[i] : &cam[i - 6], keep = *p;
        double g = i < 6 ? dx[i] : dcam[i - 6];
        double gf = i < 6 ? dxf[i] : dcamf[i - 6];

        *p = keep + h;
        double up = camera_loss(cam, x, duv, dz);
        *p = keep - h;
        double d = (up - camera_loss(cam, x, duv, dz)) / (2 * h);
        *p = keep;
        worst = fmax(worst, fabs(d - g) / (1 + fabs(g)));
        f32 = fmax(f32, fabs(gf - g) / (1 + fabs(g)));
    }
    check("gradient by differences", worst, 1e-7);
    check("float gradient against double", f32, 1e-5);
}

int main(void)
{
    struct random r;

    random_init(&r, 9, "geom_camera");
    by_hand();
    camera_rays(&r);
    camera_gradients(&r);
    return check_status();
}
