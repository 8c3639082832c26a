/* The grain of a head: which part of it has which, all around, on a picture without
 * a seam (grain.h). */
#include <math.h>
#include <string.h>

#include "lib/avatar/grain.h"
#include "lib/base/camera.h"
#include "tests/check.h"
#include "tests/unit/sphere_head.h"

enum { RINGS = 24, SEGMENTS = 32, S = 256, SIDE = S * S };

/* A sphere whose upper half has hair, striped in the photograph, and whose lower
 * half is smooth skin. */
struct scene {
    struct head head;
    struct head_avatar weights;
    struct densify dense;
    struct dynamic_branch branch;
    struct source_mesh mesh;
    struct source_picture picture;
    struct grain grain;
    size_t N;
};

static float *floats(size_t n)
{
    float *p = calloc(n, sizeof *p);

    REQUIRE(p, "no memory for %zu floats", n);
    return p;
}

static void scene_points(struct scene *s)
{
    struct dynamic_branch *b = &s->branch;
    float *verts = floats(3 * (s->head.V + 1));

    for (size_t v = 0; v < s->head.V; v++) {
        const size_t i = v / SEGMENTS, j = v % SEGMENTS;
        const double up = v >= s->head.V - 2
                              ? (v == s->head.V - 2 ? 0 : M_PI)
                              : M_PI * (double)(i + 1) / (RINGS + 1);
        const double turn = 2 * M_PI * (double)j / SEGMENTS;

        verts[3 * v] = (float)(0.45 * sin(up) * sin(turn));
        verts[3 * v + 1] = (float)(0.6 * cos(up));
        verts[3 * v + 2] = (float)(0.45 * sin(up) * cos(turn));
    }
    s->mesh.verts = verts;
    densify_forward(b->verts, verts, &s->dense, 3);
    for (size_t k = 0; k < s->N; k++) {
        const float *x = b->verts + 3 * k;
        const size_t m = x[1] > 0 ? MATERIAL_HAIR : MATERIAL_SKIN;

        b->facing[k] = x[2] / sqrtf(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        b->chance[m * s->N + k] = 1;
        b->as[m * s->N + k] = b->facing[k] > 0;
    }
}

static void scene_make(struct scene *s)
{
    struct error err = {0};

    memset(s, 0, sizeof *s);
    sphere_head(&s->head, RINGS, SEGMENTS);
    REQUIRE(densify_init(&s->dense, s->head.f, s->head.F, s->head.V,
                         &err) == 0, "%s", err.text);
    s->N = s->dense.V + s->dense.E;
    s->branch = (struct dynamic_branch){
        .dense = &s->dense, .count = s->N, .verts = floats(3 * s->N),
        .facing = floats(s->N), .chance = floats(MATERIALS * s->N),
        .as = floats(MATERIALS * s->N), .lid = floats(s->N)};
    s->weights.lining = floats(s->N);
    s->mesh.head = &s->head;
    s->mesh.weights = &s->weights;
    camera_frontal(s->mesh.cam, 11);
    scene_points(s);
    s->picture.size = S;
    s->picture.rgba = floats(4 * SIDE);
    for (size_t i = 0; i < SIDE; i++) {
        const bool hair = i / S < S / 2;
        const float grey = hair ? (i % 4 < 2 ? 0.2f : 0.4f) : 0.5f;

        for (size_t c = 0; c < 3; c++)
            s->picture.rgba[4 * i + c] = grey;
        s->picture.rgba[4 * i + 3] = 1;
    }
    REQUIRE(grain_init(&s->grain, &s->head, s->N + 1, S,
                       (struct nn_options){NN_INFER, NN_F32}, &err) == 0, "%s",
            err.text);
    grain_find(&s->grain, s->N, s->N + 1, &s->branch, &s->mesh, &s->picture);
}

/* Least and most of the grain in columns x0..x1 and rows y0..y1, shares of S. */
static void grain_range(int range[2], const struct grain *g, double x0, double x1,
                        double y0, double y1)
{
    range[0] = 255;
    range[1] = 0;
    for (size_t y = (size_t)(y0 * S); y < (size_t)(y1 * S); y++)
        for (size_t x = (size_t)(x0 * S); x < (size_t)(x1 * S); x++) {
            const int v = g->picture[S * y + x];

            range[0] = v < range[0] ? v : range[0];
            range[1] = v > range[1] ? v : range[1];
        }
}

static void grain_places(const struct scene *s)
{
    const float *around = s->grain.around, *x = s->branch.verts;
    const float scale = CAMERA_FOCAL / 11 / 2;
    double front = 1, long_step = 0;

    for (size_t k = 0; k < s->N; k++)       /* the foremost one, not a quarter off */
        if (x[3 * k + 2] > 0.44f && fabsf(x[3 * k]) < 1e-3f)
            front = fmin(front, hypot((double)around[2 * k] - 0.5,
                                      (double)around[2 * k + 1] - 0.5 +
                                          (double)(scale * x[3 * k + 1])));
    for (size_t h = 0; h < 2 * s->dense.E; h++) {
        const size_t i = (size_t)s->dense.edge[h], j = s->dense.V + h / 2;
        const double way = sqrt(pow(x[3 * j] - x[3 * i], 2) +
                                pow(x[3 * j + 1] - x[3 * i + 1], 2) +
                                pow(x[3 * j + 2] - x[3 * i + 2], 2));

        const double step[2] = {
            (double)around[2 * j] - (double)around[2 * i],
            (double)around[2 * j + 1] - (double)around[2 * i + 1]};

        if (x[3 * i + 2] > -0.2f && fabsf(x[3 * i + 1]) < 0.5f)
            long_step = fmax(long_step, hypot(step[0], step[1]) /
                                            (way * scale));
    }
    check("what faces the camera lies where the photograph shows it", front, 1e-6);
    check_range("no seam where a turn may show it: steps over the mesh's",
                long_step, 1, 1.8);
    check_that("none of what is not on the mesh",
               around[2 * s->N] == GRAIN_NOWHERE);
}

int main(void)
{
    static struct scene s;
    int hair[2], skin[2], outside[2];

    scene_make(&s);
    grain_places(&s);
    /* a quarter to the left of the middle is 75 degrees around */
    grain_range(hair, &s.grain, 0.15, 0.25, 0.4, 0.45);
    grain_range(skin, &s.grain, 0.15, 0.25, 0.55, 0.65);
    grain_range(outside, &s.grain, 0, 1, 0, 0.1);
    check_range("hair has dark stripes where the photograph shows none", hair[0],
                60, 110);
    check_range("and bright ones", hair[1], 146, 210);
    check_that("smooth skin is smooth", skin[0] == 128 && skin[1] == 128);
    check_that("and what is beside the head", outside[0] == 128 && outside[1] == 128);
    return check_status();
}
