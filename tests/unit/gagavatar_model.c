/* GAGAvatar's planes and rotations by their definitions.  With arguments OUT,
 * a configuration and a head it only writes a checkpoint of random weights in
 * the public names, for the pipe tests. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/net/gagavatar.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "lib/head/head.h"
#include "lib/splat/reference.h"

#define N 9             /* a plane's side */
#define MANY 200

static void give_up(const struct error *err)
{
    printf("%s\n", err->text);
    exit(1);
}

/* Points lie on the plane through the origin, square to the optical axis, and
 * are seen at the picture's corners and between; lifting moves them along the
 * axis.  Returns the greatest error. */
static double plane_error(void)
{
    float points[3 * N * N], lifted[3 * N * N], uv[2 * N * N], d[3], cam[12];
    float R[9], t[3] = {0.1f, -0.2f, 9}, position[N * N], worst = 0;
    const float turn[3] = {2.8f, 0.3f, -0.2f};

    rotation_exp(R, turn);
    camera_make(cam, R, t);
    gagavatar_plane(points, d, cam, N);
    camera_project(uv, NULL, cam, 512, points, N * N);
    for (size_t k = 0; k < N * N; k++) {
        const float *p = points + 3 * k;
        const float u = (float)(k % N) / (N - 1) * 512;
        const float v = (float)(k / N) / (N - 1) * 512;

        position[k] = (float)k / (N * N);
        worst = fmaxf(worst, fabsf(p[0] * d[0] + p[1] * d[1] + p[2] * d[2]));
        worst = fmaxf(worst, fabsf(uv[2 * k] - u) / 512);
        worst = fmaxf(worst, fabsf(uv[2 * k + 1] - v) / 512);
    }
    gagavatar_lift(lifted, points, position, d, -1, N * N);
    for (size_t k = 0; k < N * N; k++) {
        float near[3], far[3];

        camera_apply(near, cam, lifted + 3 * k);
        camera_apply(far, cam, points + 3 * k);
        worst = fmaxf(worst, fabsf(far[2] - near[2] - position[k]));
        worst = fmaxf(worst, fabsf(far[0] - near[0]));
    }
    return worst;
}

/* Covariances of quaternions of any length, taken as they are, against those
 * of what gagavatar_unit_rotations makes of them. */
static double rotation_error(void)
{
    float mean[3 * MANY] = {0}, scale[2][3 * MANY], quat[2][4 * MANY];
    float opacity[MANY] = {0}, color[3 * MANY] = {0};
    const struct splat_camera cam = {
        .rt = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 9}, .fx = 1, .fy = 1};
    struct reference r[2];
    struct error err = {0};
    struct random rng;
    double worst = 0;

    random_init(&rng, 5, "rotations");
    for (size_t i = 0; i < 4 * MANY; i++)
        quat[0][i] = (float)(random_normal(&rng) * (i % 3 ? 0.03 : 0.4));
    for (size_t i = 0; i < 3 * MANY; i++)
        scale[0][i] = i % 7 ? (float)(0.05 * random_uniform(&rng)) : 0.01f;
    memcpy(scale[1], scale[0], sizeof scale[0]);
    memcpy(quat[1], quat[0], sizeof quat[0]);
    gagavatar_unit_rotations(scale[1], quat[1], MANY);
    for (int k = 0; k < 2; k++) {
        const struct gaussians g = {
            .n = MANY, .channels = 3, .mean = mean, .scale = scale[k],
            .quat = quat[k], .opacity = opacity, .color = color};

        if (reference_init(&r[k], &g, &cam, 8, 8, 3, SPLAT_DGR, 0, &err))
            give_up(&err);
    }
    for (size_t i = 0; i < MANY; i++) {
        struct reference_point a, b;

        reference_project(&a, &r[0], i);
        reference_project(&b, &r[1], i);
        for (int k = 0; k < 6; k++)
            worst = fmax(worst, fabs(a.cov3[k] - b.cov3[k]) /
                                    fmax(a.cov3[0] + a.cov3[3] + a.cov3[5],
                                         1e-9));
    }
    reference_release(&r[0]);
    reference_release(&r[1]);
    return worst;
}

static int gagavatar_test(void)
{
    const double plane = plane_error(), rotation = rotation_error();

    printf("planes: %.2g (at most 1e-5)\n", plane);
    printf("covariances: %.2g (at most 1e-5)\n", rotation);
    return !(plane <= 1e-5 && rotation <= 1e-5);
}

static void write_checkpoint(const char *out, const char *config,
                             const char *head)
{
    struct avatar_config c;
    struct head h;
    struct params ps;
    struct gagavatar g;
    struct refiner r;
    struct error err = {0};

    params_init(&ps);
    if (avatar_config_load(&c, config, &err) || head_load(&h, head, &err) ||
        gagavatar_init(&g, &ps, &c, h.V, &err) ||
        gagavatar_init_refiner(&r, &ps, &c, &err) ||
        params_allocate(&ps, &err))
        give_up(&err);
    params_randomise(&ps, 1);
    if (params_save(&ps, out, NULL, &err))
        give_up(&err);
    gagavatar_release(&g);
    refiner_release(&r);
    params_release(&ps);
    head_release(&h);
}

int main(int argc, char **argv)
{
    if (argc == 1)
        return gagavatar_test();
    if (argc != 4) {
        printf("usage: gagavatar_model [OUT CONFIG HEAD]\n");
        return 1;
    }
    write_checkpoint(argv[1], argv[2], argv[3]);
    return 0;
}
