/* The branches' equations, each on a case worked by hand. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/avatar.h"
#include "lib/avatar/coverage.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"
#include "tests/check.h"
#include "tests/unit/shipped_mouth.h"

/* v_mid: one square of two triangles has five edges, the diagonal once. */
static void equation_midpoints(void)
{
    static const int32_t faces[6] = {0, 1, 2, 0, 2, 3};
    const float x[12] = {0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 4};
    float out[27], dx[12] = {0}, dout[27] = {0}, spacing[9];
    struct densify d;
    struct error err;

    densify_init(&d, faces, 2, 4, &err);
    expect("edges of a square of two triangles", (double)d.E, 5, 0);
    densify_forward(out, x, &d, 3);
    size_t k = 0;       /* edges are sorted: 01 02 03 12 23 */
    while (k < d.E && !(d.edge[2 * k] == 0 && d.edge[2 * k + 1] == 3))
        k++;
    expect("midpoint of vertices 0 and 3, y", out[3 * (4 + k) + 1], 1, 0);
    expect("midpoint of vertices 0 and 3, z", out[3 * (4 + k) + 2], 2, 0);
    dout[3 * (4 + k) + 2] = 6;
    dout[3 * 3 + 2] = 1;
    densify_backward(dx, dout, &d, 3);
    expect("gradient at vertex 3: own 1 and half of 6", dx[3 * 3 + 2], 4, 0);
    expect("gradient at vertex 0: half of 6", dx[2], 3, 0);
    densify_spacing(spacing, x, &d);
    expect("spacing at vertex 1: half of two edges of 2", spacing[1], 1, 1e-6);
    expect("spacing of midpoint 0-3: half of sqrt(20)", spacing[4 + k],
           sqrt(20) / 2, 1e-6);
    densify_release(&d);
}

/* U_0, mu = o + d r, mu += (2p-1) n.  Frontal camera at 12: the plane is z = 0
 * and U = (1, 0) meets it at x = 12 * 1 / 12 = 1. */
static void equation_plane(void)
{
    float U0[8], cam[12], n[3], mu[6], R[9], t[3] = {0.1f, -0.2f, 11};
    const float U[4] = {1, 0, -0.5f, 0.25f}, p[2] = {0.5f, 0.75f};
    const float turn[3] = {0.3f, 0.8f, -0.2f}, rise[2] = {0.25f, 0.25f};
    float mid[2] = {0.625f, 0.625f}, uv[4];

    static_branch_grid(U0, 2);
    expect("U_0 of the first cell of 2 x 2", U0[0], -0.5, 0);
    expect("U_0 of the last cell of 2 x 2, y", U0[7], 0.5, 0);
    camera_frontal(cam, 12);
    source_mesh_normal(n, cam);
    expect("n_s of the frontal camera is +z", n[2], 1, 0);
    static_branch_lift(mu, U, p, NULL, cam, n, 2);
    expect("cell at the right border: x", mu[0], 1, 1e-6);
    expect("cell at the right border: z (p = 1/2)", mu[2], 0, 1e-6);
    expect("cell above the middle is below y = 0", mu[4], -0.25, 1e-6);
    expect("p = 3/4 lifts by 1/2", mu[5], 0.5, 1e-6);
    rotation_exp(R, turn);
    camera_make(cam, R, t);
    source_mesh_normal(n, cam);
    static_branch_lift(mu, U, (const float[2]){0.5f, 0.5f}, NULL, cam, n, 2);
    camera_project(uv, NULL, cam, 2, mu, 2);
    expect("turned camera: projection of the lifted cell, x", uv[2] - 1, -0.5,
           1e-5);
    expect("turned camera: projection of the lifted cell, y", uv[3] - 1, 0.25,
           1e-5);
    /* 2p - 1 = 0.25 = the surface's height: back on its ray */
    static_branch_lift(mu, U, mid, rise, cam, n, 2);
    camera_project(uv, NULL, cam, 2, mu, 2);
    expect("at the surface's height: projection, x", uv[2] - 1, -0.5, 1e-5);
    camera_apply(mu, cam, mu + 3);
    expect("at the surface's height: depth 11 - 0.25", mu[2], 10.75, 1e-5);
}

/* g = l + r [u,v,0]; cap; the clamp and its gradient. */
static void equation_mouth(void)
{
    const float centre[3] = {0.1f, -0.3f, 0.4f};
    float g[12], uv[8];
    struct head_mouth m = {.bowl = 0.0591f, .lip = 0.08295f};
    float q[9] = {1, 2, 0.05f, 0, 0, -0.5f, 0, 0, 0.2f}, raw[9];
    float dq[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};

    mouth_branch_grid(g, uv, centre, 0.2f, 2);
    expect("first cell of the grid: u", uv[0], -0.5, 0);
    expect("first cell of the grid: v is up", uv[1], 0.5, 0);
    expect("its x: 0.1 - 0.2 / 2", g[0], 0, 1e-7);
    expect("its y: -0.3 + 0.2 / 2", g[1], -0.2, 1e-7);
    expect("its z: the centroid's", g[2], 0.4f, 0);
    /* 11.82 mm and 16.59 mm at 5 units a metre, epsilon 2 mm */
    expect("cap of the paper's typical subject, mm",
           mouth_branch_cap(&m) / 5 * 1000,
           11.82 + 16.59 / 2 + 2, 1e-3);
    memcpy(raw, q, sizeof raw);
    expect("clamped of three", (double)mouth_branch_clamp(q, 3, 0.1f), 2, 0);
    expect("q inside the cap stays", q[2], 0.05f, 0);
    expect("q below it", q[5], -0.1f, 0);
    expect("x and y are free", q[1], 2, 0);
    mouth_branch_clamp_backward(dq, raw, 3, 0.1f);
    expect("gradient passes inside", dq[2], 1, 0);
    expect("and not where the clamp acted", dq[5] + dq[8], 0, 0);
}

/* A square from the middle to the right border, top to bottom: NDC 0..1. */
static void equation_coverage(void)
{
    const float verts[12] = {0, 1, 0, 1, 1, 0, 1, -1, 0, 0, -1, 0};
    static const int32_t faces[6] = {0, 1, 2, 0, 2, 3};
    const float attribute[4] = {0, 1, 1, 0};
    float cam[12], C[25], z[25], value[25], seen[3];
    void *scratch = malloc(coverage_scratch(5));
    const float points[9] = {0.5f, 0, 0.3f, 0.5f, 0, -0.3f, 5, 0, 0};

    camera_frontal(cam, 12);
    coverage_fraction(C, verts, faces, 2, cam, 5, scratch);
    expect("cell left of the square", C[10], 0, 0);
    expect("middle cell: the edge is at its centre", C[12], 0.5, 0);
    expect("cell inside", C[14], 1, 0);
    coverage_map(C, verts, faces, 2, cam, 5, scratch);
    expect("after the Gaussian: the edge stays about half", C[12], 0.5, 0.02);
    expect("after the Gaussian: some of it spills left", C[11] > 0.05, 1, 0);
    coverage_depth(z, value, 1, verts, attribute, faces, 2, cam, 5);
    expect("attribute two fifths of the way across", value[13], 0.4, 1e-5);
    expect("no attribute beside it", value[10], 0, 0);
    expect("depth where the square is", z[13], 12, 1e-5);
    expect("no depth beside it", isinf(z[10]), 1, 0);
    coverage_seen(seen, points, 3, z, 5, cam, 0.01f);
    expect("a point in front is seen", seen[0], 1, 0);
    expect("a point behind is not", seen[1], 0, 0);
    expect("a point outside the picture is not", seen[2], 0, 0);
    free(scratch);
}

/* Which colours are alike. */
static void equation_likeness(void)
{
    const float skin[3] = {0.58f, 0.43f, 0.38f};
    const float shade[3] = {0.35f, 0.26f, 0.23f}, dark[3] = {0.12f, 0.09f, 0};
    const float gray[3] = {0.25f, 0.23f, 0.23f};

    expect("a colour is like itself", branch_likeness(skin, skin), 1, 0);
    expect("and its shade", branch_likeness(shade, skin), 1, 1e-6);
    expect("not what is nearly black", branch_likeness(dark, skin), 0, 0);
    expect("nor a gray hood", branch_likeness(gray, skin), 0, 0);
}

/* Teeth of which the source shows enough tell the light; like: of two rows. */
static void equation_teeth_light(const struct teeth_cell *c,
                                 const float *like, size_t K)
{
    float *pixel = calloc(4 * K * K, sizeof *pixel);
    float light[3] = {0.5f, 0.5f, 0.4f}, few[3] = {0.5f, 0.5f, 0.4f};
    float *less = calloc(K * K, sizeof *less);

    for (size_t k = 0; k < K * K; k++)
        for (int i = 0; i < 3; i++)
            pixel[4 * k + i] = (i < 2 ? 1.5f : 3) * c[k].color[i];
    teeth_light(light, c, like, pixel, K);
    expect("teeth half as bright again", (double)light[0], 0.75, 1e-5);
    expect("and no more than twice as bright", (double)light[2], 0.8, 1e-5);
    for (size_t k = 0; k < K / 2; k++)
        less[k] = 1;
    teeth_light(few, c, less, pixel, K);
    expect("a few cells tell nothing", (double)few[0], 0.5, 0);
    free(pixel);
    free(less);
}

/* The generic teeth: upper edges over the lower ones and below the closed
 * lips' middle, enamel brighter than what is behind, the tongue than the
 * throat. */
static void equation_teeth(void)
{
    enum { K = 32 };
    struct head head = {.scale = 5};
    const struct head_mouth rest = {.radius = 0.11f};
    struct teeth_cell *c = malloc(K * K * sizeof *c);
    const size_t middle = K / 2, lower = 5 * K / 16 * K + middle;
    const size_t throat = lower + (K / 4 + 4) * K;
    const size_t tongue = K * (K - 3) + middle;

    float like[K * K] = {0};

    head.avatar = *shipped_mouth();
    teeth_make(c, &head, &rest, rest.chin, 0, K);
    check_range("upper front teeth's lowest row, mm from the closed lips",
                200 * (double)c[middle].mean[1], -3.5, -1.5);
    check_that("it is before the lower teeth and ends under their edge",
               c[middle].mean[2] > c[lower].mean[2] &&
               c[middle].mean[1] - c[middle].scale[1] <
                   c[lower].mean[1] + c[lower].scale[1]);
    check_that("front teeth are brighter than side teeth",
               c[middle + 4 * K].color[1] > 1.3f * c[1 + 4 * K].color[1]);
    check_that("teeth are brighter than the tongue",
               c[middle].color[1] > 1.5f * c[tongue].color[1]);
    check_that("the tongue is brighter than the throat",
               c[tongue].color[0] > 3 * c[throat].color[0]);
    check_that("and redder than the teeth",
               c[tongue].color[0] * c[middle].color[1] >
               1.2f * c[tongue].color[1] * c[middle].color[0]);
    expect("teeth that are not seen are not lifted",
           (double)teeth_lift(c, like, K), 0, 0);
    for (size_t k = 2 * K; k < 4 * K; k++)
        like[k] = 1;
    const float lift = teeth_lift(c, like, K), low = c[middle].mean[1];
    check_range("two rows that lips hide below those seen, mm",
                200 * (double)lift, 2, 3.5);
    teeth_make(c, &head, &rest, rest.chin, lift, K);
    expect("lifted by it", (double)(c[middle].mean[1] - low), (double)lift,
           1e-6);
    equation_teeth_light(c, like, K);
    head_avatar_release(&head.avatar);
    free(c);
}

/* Starting values: shifts of sigmoids. */
static void equation_shifts(void)
{
    double x = 0.3, s = -1.7, l = log(x / (1 - x)) + s;
    double h = 1e-3;

    expect("shift is sigmoid(logit(x) + s)", attribute_shift(0.3f, -1.7f),
           1 / (1 + exp(-l)), 1e-7);
    expect("its slope", attribute_shift_backward(1, 0.3f, -1.7f),
           (attribute_shift((float)(x + h),
                            -1.7f) - attribute_shift((float)(x - h),
                                                     -1.7f)) / (2 * h),
           1e-4);
    expect("shift of 0", attribute_shift(0, 3), 0, 0);
    expect("shift of 1", attribute_shift(1, -3), 1, 0);
    expect("logit limits", attribute_logit(0), log(0.02 / 0.98), 1e-6);
}

int main(void)
{
    equation_midpoints();
    equation_plane();
    equation_mouth();
    equation_coverage();
    equation_likeness();
    equation_teeth();
    equation_shifts();
    return check_status();
}
