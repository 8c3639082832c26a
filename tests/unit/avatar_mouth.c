/* The inside of a mouth that the source shows shut: palate, throat and tongue
 * behind the teeth, teeth that can be told apart, the lips' inside and the
 * shade in which they leave all that. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lib/avatar/lip_lining.h"
#include "lib/avatar/mouth_branch.h"
#include "lib/avatar/teeth.h"
#include "lib/base/camera.h"
#include "lib/base/gaussians.h"
#include "tests/check.h"
#include "tests/unit/shipped_mouth.h"

#define ARCH 0.031f     /* teeth stand along z = -ARCH x^2, mm */

/* The shipped model's grid, rows of its back, columns of a front tooth. */
enum { K = 64, BACK = 28, TOOTH = 8 };

static float mouth_light(const float rgb[3])
{
    return rgb[0] + rgb[1] + rgb[2];
}

/* Cell (i,j) of what is behind the teeth, in the template avatar's grid. */
static size_t mouth_cell(size_t i, size_t j)
{
    return (K - BACK + i) * K + j;
}

/* Nothing stands out before the teeth or through a cheek; both sides are
 * alike. */
static void mouth_sheet(void)
{
    const struct head_avatar *a = shipped_mouth();
    double front = -1e3, wide = 0, uneven = 0;

    expect("side of the grid", (double)a->mouth, K, 0);
    for (size_t k = 0; k < BACK * K; k++) {
        const size_t at = mouth_cell(k / K, k % K);
        const size_t other = mouth_cell(k / K, K - 1 - k % K);
        const float *p = a->mouth_place + 3 * at;

        front = fmax(front, (double)(p[2] + ARCH * p[0] * p[0]));
        wide = fmax(wide, fabs((double)p[0]));
        uneven = fmax(uneven, fabs((double)(p[0] +
                                            a->mouth_place[3 * other])) +
                                  fabs((double)(a->mouth_color[3 * at] -
                                                a->mouth_color[3 * other])));
    }
    check_range("the sheet stays behind the arch, mm", front, -9, -6.9);
    check_range("it reaches to the cheeks and no further, mm", wide, 24, 27);
    expect("left and right are alike", uneven, 0, 1e-5);
    expect("the palate stays with the skull",
           (double)a->mouth_jaw[mouth_cell(0, K / 2)], 0, 0);
    expect("the tongue's tip goes with the jaw",
           (double)a->mouth_jaw[mouth_cell(11, K / 2)], 1, 0);
}

/* Colour of row i at u across. */
static float mouth_light_at(size_t i, double u)
{
    const size_t j = (size_t)((u + 1) * K / 2);

    return mouth_light(shipped_mouth()->mouth_color + 3 * mouth_cell(i, j));
}

/* Deeper is darker, a tongue round and furrowed.  Rows: THROAT to TIP, TOP of
 * the tongue. */
static void mouth_shading(void)
{
    enum { THROAT = 9, TIP = 22, TOP = 21 };
    float last = 0;
    int brighter = 0;

    for (size_t i = THROAT; i <= TIP; i++) {
        brighter += mouth_light_at(i, 0.2) > last;
        last = mouth_light_at(i, 0.2);
    }
    expect("every row from the throat to the tip is brighter", brighter,
           TIP - THROAT + 1, 0);
    check_range("the throat over the tongue's tip",
                (double)(mouth_light_at(THROAT, 0.2) / last), 0.05, 0.3);
    const float top = mouth_light_at(TOP, 0.25);
    check_range("the furrow over what is beside it",
                (double)(mouth_light_at(TOP, 0) / top), 0.8, 0.95);
    check_range("a tongue's side over its top",
                (double)(mouth_light_at(TOP, 0.7) / top), 0.3, 0.7);
}

/* Neighbours overlap when the jaw has dropped: the distance of two rows is no
 * more than three of their standard deviations. */
static void mouth_cover(void)
{
    const struct head_avatar *a = shipped_mouth();
    double worst = 0, turned = 0;

    for (size_t i = 0; i + 1 < BACK; i++) {
        const size_t at = mouth_cell(i, 35), next = mouth_cell(i + 1, 35);
        const float *p = a->mouth_place + 3 * at;
        const float *q = a->mouth_place + 3 * next;
        const float *turn = a->mouth_turn + 4 * at;
        /* the throat's part of the way of a jaw wide open */
        const double y = (double)(p[1] - q[1] +
                                  12 * (a->mouth_jaw[next] -
                                        a->mouth_jaw[at]));

        worst = fmax(worst, hypot(y, (double)(p[2] - q[2])) /
                                (0.5 * (double)(a->mouth_size[3 * at + 1] +
                                                a->mouth_size[3 * next + 1])));
        turned = fmax(turned, fabs(hypot((double)turn[0],
                                         (double)turn[1]) - 1));
    }
    check_range("rows' distance over their deviation", worst, 1, 3);
    check("turns are of unit length, in halves", turned, 0x1p-11);
}

/* Between two teeth it is darker than on them, and the more the further from
 * the middle; their corners are rounded; the lower ones' edges are just under
 * the closed lips. */
static void mouth_teeth(void)
{
    struct head head = {.scale = 5};
    const struct head_mouth rest = {.radius = 0.11f};
    struct teeth_cell *c = malloc(K * K * sizeof *c);
    const size_t row = 5, middle = K / 2, lower = 5 * K / 16 * K + middle;

    head.avatar = *shipped_mouth();
    teeth_make(c, &head, &rest, rest.chin, 0, K);
    for (size_t t = 0; t < 3; t++) {
        const struct teeth_cell *edge = c + middle + TOOTH * t;
        const struct teeth_cell *at = edge + row * K + TOOTH / 2;
        const float *between = edge[row * K + TOOTH - 1].color;
        const float *next = at[t < 2 ? TOOTH : TOOTH / 2 + 2].color;

        check_range("between two teeth over their mean",
                    2 * (double)(mouth_light(between) /
                                 (mouth_light(at->color) +
                                  mouth_light(next))),
                    0.65, 0.92);
        check_that("the next one is darker",
                   mouth_light(next) < 0.99f * mouth_light(at->color));
        check_range("the corner over the edge's middle, mm",
                    200 * (double)(edge[TOOTH - 1].mean[1] -
                                   edge[TOOTH / 2].mean[1]), 0.3, 2);
    }
    check_that("gums come down between teeth",
               c[13 * K + middle + TOOTH].color[1] <
                   0.8f * c[13 * K + middle + TOOTH / 2].color[1] &&
               c[13 * K + middle + TOOTH].color[0] >
                   1.2f * c[13 * K + middle + TOOTH].color[1]);
    check_range("the lower front teeth's highest row, mm from the closed lips",
                200 * (double)c[lower].mean[1], -2.5, -0.4);
    free(c);
}

/* By how much light l brightens a rim of normal n (colours are roots of light). */
static float mouth_gain(const float n[3], const float l[3])
{
    float to[3];

    lip_lining_bend(to, n, 1);
    return sqrtf(gaussian_light(to, l));
}

/* The lips' rims, in a light from above as photographs have it. */
static void mouth_paint(void)
{
    const float normal[12] = {0, -1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 2};
    const float seam[4] = {1, 1, 0, 1}, white[3] = {0.8f, 0.8f, 0.8f};
    const float lips[3] = {0.6f, 0.3f, 0.3f}, above[3] = {0, 0.55f, 0};
    float rgb[12], to[3];

    lip_lining_bend(to, normal + 3, 1);
    expect("a rim's light comes from above", (double)to[1], sqrt(0.5), 1e-6);
    expect("and from the front", (double)to[2], sqrt(0.5), 1e-6);
    lip_lining_bend(to, normal + 6, 0);
    check_that("normals before the seam stay", to[1] == 1 && to[2] == 0);
    lip_lining_bend(to, normal + 9, 1);
    check_that("and those to the front", to[1] == 0 && to[2] == 2);
    for (int k = 0; k < 12; k++)
        rgb[k] = lips[k % 3];
    lip_lining_paint(rgb, seam, normal, white, 4);
    check_that("rims see less of the sky",
               mouth_light(rgb + 3) < 0.9f * mouth_light(lips));
    for (int k = 0; k < 2; k++)
        check_that("they are redder",
                   rgb[3 * k] * lips[1] > 1.1f * lips[0] * rgb[3 * k + 1]);
    check_that("the upper lip's is darker than the lower's",
               mouth_gain(normal, above) * mouth_light(rgb) <
                   0.9f * mouth_gain(normal + 3, above) *
                       mouth_light(rgb + 3));
    expect("what is before the seam keeps its colour", (double)rgb[6], 0.6,
           1e-7);
    expect("what faces the front, too", (double)rgb[9], 0.6, 1e-6);
}

/* Lips of four vertices, `gap` apart, and two of the lining behind them, the
 * upper one first, whose opacities go to veil; returns how far the upper one
 * shows the photograph. */
static float mouth_veil(float veil[2], float gap)
{
    int32_t ring[4] = {0, 1, 2, 3};
    const float y = 0.5f * gap;
    const float verts[18] = {-0.1f, 0, 0, 0, y, 0, 0.1f, 0, 0, 0, -y, 0,
                             0, 0.02f, -0.02f, 0, -0.02f, -0.02f};
    float lining[6] = {0, 0, 0, 0, 1, 1}, scale[18], color[24], opacity[6];
    float seen[6] = {1, 1, 1, 1, 0.5f, 0.5f};
    const float white[3] = {1, 1, 1};
    struct head head = {.scale = 5, .lip_inner = ring, .nlip_inner = 4};
    const struct head_avatar weights = {.lining = lining};
    const struct source_mesh mesh = {.head = &head, .weights = &weights,
                                     .posed = verts};
    struct branch_set out = {.n = 6, .channels = 4, .scale = scale,
                             .opacity = opacity, .color = color,
                             .seen = seen};

    for (int k = 0; k < 24; k++)
        color[k] = 0.7f;
    for (int k = 0; k < 6; k++)
        opacity[k] = k < 4 ? 0.9f : 0;
    lip_lining_shade(&out, verts, &mesh, white);
    check_that("the veil is dark, and has no features",
               color[16] < 0.25f && color[17] < color[16] && color[19] == 0);
    expect("lips keep their colour", (double)color[0], 0.7f, 0);
    memcpy(veil, opacity + 4, 2 * sizeof *veil);
    lip_lining_shade_backward(&out, &mesh);
    check_that("what is constant has no gradient",
               color[16] == 0 && scale[12] == 0 && opacity[4] == 0 &&
                   color[0] == 0.7f && opacity[0] == 0.9f);
    return seen[4];
}

/* Lips of four vertices, `gap` apart, before a picture whose row `dark` is so;
 * returns how much higher lips meet there, in rows. */
static double mouth_line(float gap, size_t dark)
{
    enum { S = 128 };
    static uint8_t rgb[3 * S * S];
    int32_t ring[4] = {0, 1, 2, 3};
    const float y = 0.5f * gap, row = 2.0f / S;
    const float posed[12] = {-0.02f, 0, 0, 0, y, 0, 0.02f, 0, 0, 0, -y, 0};
    const float cam[12] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, CAMERA_FOCAL};
    struct head head = {.scale = 5, .lip_inner = ring, .nlip_inner = 4};
    struct source_mesh mesh = {.head = &head, .posed = posed};
    struct source_picture picture = {0};

    memset(rgb, 200, sizeof rgb);
    memset(rgb + 3 * S * dark, 60, 3 * S);
    memcpy(mesh.cam, cam, sizeof cam);
    if (source_picture_init(&picture, S, NULL))
        return INFINITY;
    source_picture_set(&picture, rgb, NULL, NULL, false);
    const double rise = (double)(lip_lining_rise(&picture, &mesh) / row);
    source_picture_release(&picture);
    return rise;
}

/* Where closed lips meet in a picture of 64 rows above and below them. */
static void mouth_meet(void)
{
    expect("the line is half a row below the mesh's", mouth_line(0, 64), -0.5,
           0.1);
    expect("above it", mouth_line(0, 62), 1.5, 0.1);
    expect("open lips meet nowhere", mouth_line(0.02f, 62), 0, 0);
}

/* Light from above does not reach the teeth, light from the front does. */
static void mouth_overhead(void)
{
    const float front[3] = {0.1f, -0.2f, 0.9f}, above[3] = {0, 0.72f, 0.1f};
    const float high[3] = {0, 1, 0};

    expect("light from the front", (double)lip_lining_share(front), 1, 0);
    check_range("from above", (double)lip_lining_share(above), 0.7, 0.85);
    check_range("and only that", (double)lip_lining_share(high), 0.65, 0.75);
}

/* It is there whether the source's lips are closed or open, and weaker below;
 * where they are open it shows the photograph, which has that shade. */
static void mouth_shade(void)
{
    float shut[2], open[2];

    expect("the veil of closed lips shows no photograph",
           (double)mouth_veil(shut, 0), 0, 0);
    expect("that of open lips does", (double)mouth_veil(open, 0.02f), 1, 0);
    check_range("the upper lip's veil", (double)shut[0], 0.05, 0.4);
    check_range("the lower lip's", (double)shut[1], 0.01, 0.1);
    expect("that of open lips is as deep", (double)(open[0] + open[1]),
           (double)(shut[0] + shut[1]), 0);
}

int main(void)
{
    mouth_sheet();
    mouth_shading();
    mouth_cover();
    mouth_teeth();
    mouth_paint();
    mouth_meet();
    mouth_shade();
    mouth_overhead();
    return check_status();
}
