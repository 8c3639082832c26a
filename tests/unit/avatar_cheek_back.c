/* The strip behind the cheeks: on a disc for a face, whose lower half moves,
 * it follows that half's outline a little inside, lies between the skin and
 * where that turns away as the picture has it, and takes no gradient; other
 * Gaussians stay. */
#include <math.h>
#include <string.h>

#include "lib/avatar/cheek_back.h"
#include "lib/base/camera.h"
#include "tests/check.h"

#define S 256           /* the picture's side, */
#define N 128            /* the plane's, */
#define RADIUS 0.6      /* and the disc's, of half sides */
#define CHANNELS 4
#define OTHER -3.0f     /* what no Gaussian of the strip has */

static struct {
    float coverage[N * N], depth[N * N], moving[N * N], back[N * N];
    float mean[3 * N * N], scale[3 * N * N], quat[4 * N * N], opacity[N * N];
    float color[CHANNELS * N * N], seen[N * N];
} all;

/* Cell k's distance from the middle, and its height over it. */
static double cheek_radius(size_t k, double *y)
{
    double x = (2.0 * (double)(k % N) + 1) / N - 1;

    *y = (2.0 * (double)(k / N) + 1) / N - 1;
    return hypot(x, *y);
}

/* A ball's front: brown, on nothing. */
static void cheek_paint(struct source_picture *p, struct source_mesh *m)
{
    static const float cam[12] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 12};
    static uint8_t rgb[3 * S * S], matte[S * S];
    double y;

    for (size_t i = 0; i < S * S; i++) {
        double u = (2.0 * (double)(i % S) + 1) / S - 1;
        double v = (2.0 * (double)(i / S) + 1) / S - 1;

        matte[i] = hypot(u, v) < RADIUS ? 255 : 0;
        memcpy(rgb + 3 * i, "\x80\x60\x40", 3);
    }
    source_picture_set(p, rgb, matte, true);
    for (size_t k = 0; k < N * N; k++) {
        double r = cheek_radius(k, &y);

        all.coverage[k] = r < RADIUS + 0.02;
        all.depth[k] = all.coverage[k] > 0 ? 12 - (float)(0.8 - r) : INFINITY;
        all.moving[k] = all.coverage[k] > 0 && y > 0 ? 20 : 0;
    }
    *m = (struct source_mesh){.n = N, .coverage = all.coverage,
                              .depth = all.depth, .moving = all.moving};
    memcpy(m->cam, cam, sizeof cam);
    source_mesh_normal(m->normal, cam);
}

/* Where it is. */
static void cheek_found(void)
{
    bool within = true, round[18] = {false}, whole = true;
    double y;

    for (size_t k = 0; k < N * N; k++) {
        double r = cheek_radius(k, &y);

        if (!(all.back[k] > 0))
            continue;
        within = within && r > RADIUS - 0.08 && r < RADIUS - 0.01 && y > -0.08;
        if (y > 0.1 && all.back[k] == 1)
            round[(size_t)(18 * acos((k % N + 0.5 - N / 2) / (N / 2 * r)) /
                           3.1416)] = true;
    }
    check_that("inside the outline of what moves, not elsewhere", within);
    for (int i = 2; i < 16; i++)
        whole = whole && round[i];
    check_that("all of it", whole);
}

/* What its Gaussians are, and the others. */
static void cheek_placed(const struct source_mesh *m)
{
    double off = 0, before = 0, outside = 0;
    bool others = true, dense = true, deeper = true;
    double y;

    for (size_t k = 0; k < N * N; k++) {
        float at[2], z;

        if (!(all.back[k] > 0)) {
            others = others && all.opacity[k] == OTHER &&
                     all.mean[3 * k] == OTHER && all.seen[k] == OTHER;
            continue;
        }
        camera_project(at, &z, m->cam, 2, all.mean + 3 * k, 1);
        off = fmax(off, fabs(at[0] - (2.0 * (double)(k % N) + 1) / N));
        off = fmax(off, fabs(at[1] - (2.0 * (double)(k / N) + 1) / N));
        if (isfinite(all.depth[k]) && z < 11.99f) {
            before = fmax(before, all.depth[k] - z);
            outside = fmax(outside, z - (11.2 + RADIUS + 0.02));
        }
        deeper = deeper && (cheek_radius(k, &y) > RADIUS - 0.04 ||
                            z > all.depth[k] + 0.01f);
        if (cheek_radius(k, &y) < RADIUS - 0.04 && all.back[k] == 1)
            dense = dense && all.opacity[k] > 0.9f && all.seen[k] == 1 &&
                    fabs(all.color[CHANNELS * k] - 128.0 / 255) < 0.01 &&
                    all.color[CHANNELS * k + 3] == 0;
    }
    check("each where its cell is", off, 1e-5);
    check("never before the skin", before, 1e-5);
    check("nor beyond where it turns away", outside, 1e-5);
    check_that("inside the outline, behind the skin", deeper);
    check_that("dense, of the picture's colour", dense);
    check_that("other Gaussians are as they were", others);
}

int main(void)
{
    struct source_picture p = {0};
    struct source_mesh m;
    struct error err = {0};
    struct branch_set set = {
        .n = N * N, .channels = CHANNELS, .mean = all.mean,
        .scale = all.scale, .quat = all.quat, .opacity = all.opacity,
        .color = all.color, .seen = all.seen
    };
    bool none = true;

    REQUIRE(source_picture_init(&p, S, &err) == 0, "%s", err.text);
    cheek_paint(&p, &m);
    for (size_t i = 0; i < 3 * N * N; i++)
        all.mean[i] = OTHER;
    for (size_t i = 0; i < N * N; i++)
        all.opacity[i] = all.seen[i] = OTHER;
    cheek_back_find(all.back, &p, &m, N);
    cheek_found();
    cheek_back_set(&set, all.back, &p, &m, N);
    cheek_placed(&m);
    for (size_t i = 0; i < N * N; i++)
        all.opacity[i] = OTHER;
    cheek_back_backward(&set, all.back);
    for (size_t i = 0; i < N * N; i++)
        none = none && all.opacity[i] == (all.back[i] > 0 ? 0 : OTHER);
    check_that("no gradient of its own, that of others stays", none);
    source_picture_release(&p);
    return check_status();
}
