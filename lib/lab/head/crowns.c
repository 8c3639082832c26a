/* The template avatar's mouth: teeth tooth by tooth along a parabola, five to a
 * side, and behind them the sheet of cavity.h. */
#include "lib/lab/head/crowns.h"

#include <math.h>
#include <string.h>

#include "lib/avatar/branch.h"
#include "lib/lab/head/cavity.h"

#define SIDE 5              /* teeth of a side */
#define FRONT 3             /* of them: each has as many columns as the others
                             * together, which are seen from their ends */
#define BETWEEN 0.38f       /* of the light is lost between two teeth, */
#define NECK_DIM 0.12f      /* beside the gums, in the lip's shade, */
#define EDGE_DIM 0.14f      /* and goes through the edges, which are thin */
#define GLINT 0.10f         /* more light is thrown back half way up */
#define PAPILLA 2.6f        /* mm: gums come down between two teeth so far */
#define GUM_ROW 1.6f        /* mm from one row of gums to the next */

/* The upper teeth's share of the jaw's way.  In life they stay; this is too
 * little to be seen, but their reach (gaussian_seen) goes by how far a cell has
 * moved: with it a jaw that drops ends the confidence in what the photograph
 * shows in their place, the lips that were before them. */
#define UPPER_SHARE 0.02f

/* A cell of the grid, mm. */
struct crowns_cell {
    float mean[3], scale[3], quat[4], color[3], share;
    enum mouth_layer layer;
};

/* One jaw's crowns from the middle, mm: width, height, how far the edge stays
 * behind the first tooth's, how far it is bowed and its corners are rounded;
 * and the light that the cheeks leave. */
struct crowns_row {
    float width[SIDE], height[SIDE], raise[SIDE], bow[SIDE], corner[SIDE];
    float light[SIDE];
    float edge[2];          /* y and z of the first edge, from the inner lips'
                             * centroid at rest */
    float way;              /* 1: crowns grow upwards */
    float lean;             /* how much they go back on their way */
};

static const struct crowns_row crowns_rows[2] = {
    {{8.5f, 6.5f, 7.5f, 7, 6.8f}, {10.2f, 8.8f, 9.8f, 8.5f, 8},
     {0, 0.8f, 0.1f, 1, 1.5f}, {0.15f, 0.4f, 1.3f, 1.1f, 1},
     {0.9f, 1.2f, 0.8f, 0.8f, 0.8f}, {1, 0.98f, 0.92f, 0.82f, 0.64f},
     {-2.7f, -1.8f}, 1, 0.22f},
    {{5.3f, 5.9f, 6.8f, 7, 7.1f}, {8.8f, 9, 10, 8.5f, 8},
     {0, 0, 0.1f, 0.6f, 1}, {0.1f, 0.15f, 1, 0.9f, 0.8f},
     {0.4f, 0.5f, 0.6f, 0.6f, 0.6f}, {0.78f, 0.77f, 0.72f, 0.62f, 0.46f},
     {-1.2f, -3.6f}, -1, 0.06f}
};

/* sRGB over that of what is white (white_point.h).  In the middle of the teeth
 * of 20 smiling people of the London set, lit from the front, the medians are
 * 1.00, 1.02, 0.98; of seven of the GRID corpus who speak, lit from above,
 * 0.76, 0.71, 0.68 (lip_lining_share: 0.8).  Shades below are made up for. */
static const float crowns_enamel[3] = {1.05f, 1.05f, 0.98f};
static const float crowns_gum[3] = {0.84f, 0.59f, 0.59f};

/* Rows of a grid of K by K: the upper teeth's, and the lower ones', below. */
static size_t crowns_upper_rows(size_t K)
{
    return 5 * K / 16;
}

static size_t crowns_lower_rows(size_t K)
{
    return K / 4;
}

/* Of a jaw's rows those of its crowns; the others are gums. */
static size_t crowns_crown_rows(size_t rows)
{
    return (7 * rows + 9) / 10;
}

/* x, mm, at length a along the parabola, by Newton's method. */
static float crowns_along(float a)
{
    float x = 0.9f * a;

    for (int i = 0; i < 6; i++) {
        float slope = 2 * CROWNS_ARCH * x, root = sqrtf(1 + slope * slope);

        x -= (0.5f * x * root + asinhf(slope) / (4 * CROWNS_ARCH) - a) / root;
    }
    return x;
}

/* Along the arch, u in -1..1: which tooth, where across it (0..1), and its
 * share of the columns of a side. */
static size_t crowns_tooth(float *across, float *share, float u)
{
    const float t = fminf(fabsf(u), 0.9999f) * (FRONT + 1);
    const size_t front = (size_t)t;

    *share = 1.0f / (FRONT + 1);
    *across = t - (float)front;
    if (front < FRONT)
        return front;
    const float back = *across * (SIDE - FRONT);
    *share /= SIDE - FRONT;
    *across = back - floorf(back);
    return FRONT + (size_t)back;
}

/* A jaw's light at `across` of tooth t: from the middle of one to that of the
 * next. */
static float crowns_light_at(const struct crowns_row *j, size_t t, float across)
{
    const float at = (float)t + across - 0.5f;
    const size_t k = at > 0 ? (size_t)at : 0, next = k + 1 < SIDE ? k + 1 : k;

    return j->light[k] + fmaxf(at - (float)k, 0) *
                         (j->light[next] - j->light[k]);
}

/* How bright a crown is at side (-1..1 across it) and `height` (0..1) over its
 * edge: round, in the shade of its neighbours and of the lip above, wet. */
static float crowns_shade(float side, float height)
{
    const float s2 = side * side, h = height - 0.5f, g = side + 0.15f;
    const float edge = fmaxf(1 - height / 0.25f, 0);

    return (1 - BETWEEN * s2 * s2 * s2) * (1 - NECK_DIM * height * height) *
               (1 - EDGE_DIM * edge) +
           GLINT * expf(-0.5f * (h * h / 0.04f + g * g / 0.06f));
}

/* Color of a crown at side and up, mm over its edge; the gums' above it. */
static void crowns_color(float color[3], const struct crowns_row *j, size_t t,
                        float side, float up)
{
    const float s4 = side * side * side * side, height = up / j->height[t];
    const float light = crowns_light_at(j, t, 0.5f * (side + 1));
    const float gum = branch_ramp(up, j->height[t] - PAPILLA * s4 - 0.4f,
                                  j->height[t] - PAPILLA * s4 + 0.4f);
    const float enamel = light * crowns_shade(side, fminf(height, 1));

    for (int k = 0; k < 3; k++)
        color[k] = (1 - gum) * enamel * crowns_enamel[k] +
                   gum * light * crowns_gum[k];
}

/* Column u of a jaw's row r of n: place in mm from the lips' centroid, size
 * and colour. */
static void crowns_crown(struct crowns_cell *c, const struct crowns_row *j,
                        float u, size_t r, size_t n, float columns)
{
    float across, share, a = 0;
    const size_t t = crowns_tooth(&across, &share, u);
    const size_t crown = crowns_crown_rows(n);
    const float side = 2 * across - 1, s2 = side * side;
    const float outline = j->bow[t] * s2 + j->corner[t] * s2 * s2 * s2;
    const float step = (j->height[t] - outline) / (float)crown;

    for (size_t i = 0; i < t; i++)
        a += j->width[i];
    const float x = copysignf(crowns_along(a + across * j->width[t]), u);
    const float up = r < crown
        ? outline + ((float)r + 0.5f) * step
        : j->height[t] + ((float)(r - crown) + 0.5f) * GUM_ROW;
    crowns_color(c->color, j, t, side, up);
    c->mean[0] = x;
    c->mean[1] = j->edge[0] + j->way * (j->raise[t] + up);
    c->mean[2] = j->edge[1] - CROWNS_ARCH * x * x - j->lean * up;
    const float turn = 0.5f * atanf(2 * CROWNS_ARCH * x);
    c->quat[0] = cosf(turn);
    c->quat[2] = sinf(turn);
    c->scale[0] = j->width[t] / (share * columns);
    c->scale[1] = r < crown ? 0.6f * step : 0.6f * GUM_ROW;
    c->scale[2] = 0.35f;
}

/* Row i of n behind the teeth, as cavity.h has it. */
static void crowns_behind(struct crowns_cell *c, float u, size_t i, size_t n,
                          float columns)
{
    const float rows = n > 1 ? (float)(n - 1) : 1, v = (float)i / rows;
    struct cavity_place p;

    cavity_place(&p, u, v);
    memcpy(c->mean, p.at, sizeof c->mean);
    memcpy(c->color, p.color, sizeof c->color);
    c->share = p.share;
    cavity_cover(c->scale, c->quat, u, v, 2 / columns, 1 / rows);
}

/* Cell (i,j) of K by K. */
static struct crowns_cell crowns_cell_make(size_t i, size_t j, size_t K)
{
    const size_t upper = crowns_upper_rows(K), lower = crowns_lower_rows(K);
    const float n = (float)K, u = (float)(2 * j + 1) / n - 1;
    struct crowns_cell c = {.quat = {1}, .layer = MOUTH_UPPER,
                            .share = UPPER_SHARE};

    if (i < upper) {
        crowns_crown(&c, &crowns_rows[0], u, i, upper, n);
    } else if (i < upper + lower) {
        c.layer = MOUTH_LOWER;
        c.share = 1;
        crowns_crown(&c, &crowns_rows[1], u, i - upper, lower, n);
    } else {
        c.layer = MOUTH_BACK;
        crowns_behind(&c, u, i - upper - lower, K - upper - lower, n);
    }
    return c;
}

void crowns_make(struct head_avatar *a)
{
    const size_t K = a->mouth;

    for (size_t k = 0; k < K * K; k++) {
        const struct crowns_cell c = crowns_cell_make(k / K, k % K, K);

        memcpy(a->mouth_place + 3 * k, c.mean, sizeof c.mean);
        memcpy(a->mouth_size + 3 * k, c.scale, sizeof c.scale);
        memcpy(a->mouth_turn + 4 * k, c.quat, sizeof c.quat);
        memcpy(a->mouth_color + 3 * k, c.color, sizeof c.color);
        a->mouth_jaw[k] = c.share;
        a->mouth_layer[k] = (float)c.layer;
    }
}
