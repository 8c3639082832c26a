/* Teeth tooth by tooth along a parabola, five to a side. */
#include "lib/avatar/teeth.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "lib/avatar/branch.h"
#include "lib/avatar/cavity.h"
#include "lib/base/drive.h"

#define SIDE 5              /* teeth of a side */
#define FRONT 3             /* of them: each has as many columns as the others
                             * together, which are seen from their ends */
#define HALF 22.0f          /* mm: half the width of the scans' inner lips */
#define BETWEEN 0.38f       /* of the light is lost between two teeth, */
#define NECK_DIM 0.12f      /* beside the gums, in the lip's shade, */
#define EDGE_DIM 0.14f      /* and goes through the edges, which are thin */
#define GLINT 0.10f         /* more light is thrown back half way up */
#define PAPILLA 2.6f        /* mm: gums come down between two teeth so far */
#define GUM_ROW 1.6f        /* mm from one row of gums to the next */

/* One jaw's crowns from the middle, mm: width, height, how far the edge stays
 * behind the first tooth's, how far it is bowed and its corners are rounded;
 * and the light that the cheeks leave. */
struct teeth_row {
    float width[SIDE], height[SIDE], raise[SIDE], bow[SIDE], corner[SIDE];
    float light[SIDE];
    float edge[2];          /* y and z of the first edge, from the inner lips'
                             * centroid at rest */
    float way;              /* 1: crowns grow upwards */
    float lean;             /* how much they go back on their way */
};

static const struct teeth_row teeth_rows[2] = {
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
static const float teeth_enamel[3] = {1.05f, 1.05f, 0.98f};
static const float teeth_gum[3] = {0.84f, 0.59f, 0.59f};

/* Rows of a grid of K by K: the upper teeth's, and the lower ones', below. */
static size_t teeth_upper_rows(size_t K)
{
    return 5 * K / 16;
}

static size_t teeth_lower_rows(size_t K)
{
    return K / 4;
}

/* Of a jaw's rows those of its crowns; the others are gums. */
static size_t teeth_crown_rows(size_t rows)
{
    return (7 * rows + 9) / 10;
}

/* x, mm, at length a along the parabola, by Newton's method. */
static float teeth_along(float a)
{
    float x = 0.9f * a;

    for (int i = 0; i < 6; i++) {
        float slope = 2 * TEETH_ARCH * x, root = sqrtf(1 + slope * slope);

        x -= (0.5f * x * root + asinhf(slope) / (4 * TEETH_ARCH) - a) / root;
    }
    return x;
}

/* Along the arch, u in -1..1: which tooth, where across it (0..1), and its
 * share of the columns of a side. */
static size_t teeth_tooth(float *across, float *share, float u)
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
static float teeth_light_at(const struct teeth_row *j, size_t t, float across)
{
    const float at = (float)t + across - 0.5f;
    const size_t k = at > 0 ? (size_t)at : 0, next = k + 1 < SIDE ? k + 1 : k;

    return j->light[k] + fmaxf(at - (float)k, 0) *
                         (j->light[next] - j->light[k]);
}

/* How bright a crown is at side (-1..1 across it) and `height` (0..1) over its
 * edge: round, in the shade of its neighbours and of the lip above, wet. */
static float teeth_shade(float side, float height)
{
    const float s2 = side * side, h = height - 0.5f, g = side + 0.15f;
    const float edge = fmaxf(1 - height / 0.25f, 0);

    return (1 - BETWEEN * s2 * s2 * s2) * (1 - NECK_DIM * height * height) *
               (1 - EDGE_DIM * edge) +
           GLINT * expf(-0.5f * (h * h / 0.04f + g * g / 0.06f));
}

/* Color of a crown at side and up, mm over its edge; the gums' above it. */
static void teeth_color(float color[3], const struct teeth_row *j, size_t t,
                        float side, float up)
{
    const float s4 = side * side * side * side, height = up / j->height[t];
    const float light = teeth_light_at(j, t, 0.5f * (side + 1));
    const float gum = branch_ramp(up, j->height[t] - PAPILLA * s4 - 0.4f,
                                  j->height[t] - PAPILLA * s4 + 0.4f);
    const float enamel = light * teeth_shade(side, fminf(height, 1));

    for (int k = 0; k < 3; k++)
        color[k] = (1 - gum) * enamel * teeth_enamel[k] +
                   gum * light * teeth_gum[k];
}

/* Column u of a jaw's row r of n: place in mm from the lips' centroid, size
 * and colour. */
static void teeth_crown(struct teeth_cell *c, const struct teeth_row *j,
                        float u, size_t r, size_t n, float columns)
{
    float across, share, a = 0;
    const size_t t = teeth_tooth(&across, &share, u);
    const size_t crown = teeth_crown_rows(n);
    const float side = 2 * across - 1, s2 = side * side;
    const float outline = j->bow[t] * s2 + j->corner[t] * s2 * s2 * s2;
    const float step = (j->height[t] - outline) / (float)crown;

    for (size_t i = 0; i < t; i++)
        a += j->width[i];
    const float x = copysignf(teeth_along(a + across * j->width[t]), u);
    const float up = r < crown
        ? outline + ((float)r + 0.5f) * step
        : j->height[t] + ((float)(r - crown) + 0.5f) * GUM_ROW;
    teeth_color(c->color, j, t, side, up);
    c->mean[0] = x;
    c->mean[1] = j->edge[0] + j->way * (j->raise[t] + up);
    c->mean[2] = j->edge[1] - TEETH_ARCH * x * x - j->lean * up;
    const float turn = 0.5f * atanf(2 * TEETH_ARCH * x);
    c->quat[0] = cosf(turn);
    c->quat[2] = sinf(turn);
    c->scale[0] = j->width[t] / (share * columns);
    c->scale[1] = r < crown ? 0.6f * step : 0.6f * GUM_ROW;
    c->scale[2] = 0.35f;
}

/* Row i of n behind the teeth, as cavity.h has it. */
static void teeth_behind(struct teeth_cell *c, float *share, float u,
                         size_t i, size_t n, float columns)
{
    const float rows = n > 1 ? (float)(n - 1) : 1, v = (float)i / rows;
    struct cavity_place p;

    cavity_place(&p, u, v);
    memcpy(c->mean, p.at, sizeof c->mean);
    memcpy(c->color, p.color, sizeof c->color);
    *share = p.share;
    cavity_cover(c->scale, c->quat, u, v, 2 / columns, 1 / rows);
}

/* Cell (i,j) of K by K as teeth_crown and teeth_behind place it, and its share
 * of the jaw's way. */
static struct teeth_cell teeth_cell_make(float *share, size_t i, size_t j,
                                         size_t K)
{
    const size_t upper = teeth_upper_rows(K), lower = teeth_lower_rows(K);
    const float n = (float)K, u = (float)(2 * j + 1) / n - 1;
    struct teeth_cell c = {.quat = {1}, .layer = TEETH_UPPER};

    *share = TEETH_UPPER_SHARE;
    if (i < upper) {
        teeth_crown(&c, &teeth_rows[0], u, i, upper, n);
    } else if (i < upper + lower) {
        c.layer = TEETH_LOWER;
        *share = 1;
        teeth_crown(&c, &teeth_rows[1], u, i - upper, lower, n);
    } else {
        c.layer = TEETH_BACK;
        teeth_behind(&c, share, u, i - upper - lower, K - upper - lower, n);
    }
    return c;
}

void teeth_make(struct teeth_cell *cells, const struct head *h,
                const struct head_mouth *rest, const float chin[3],
                float lift, size_t K)
{
    const float mm = 1e-3f * h->scale;
    const float size = fminf(fmaxf(rest->radius / (HALF * mm), 0.85f), 1.15f);
    const float *hinge = h->joint_template + 3 * JOINT_JAW;
    const float d[3] = {chin[0] - rest->chin[0], chin[1] - rest->chin[1],
                        chin[2] - rest->chin[2]};

    for (size_t k = 0; k < K * K; k++) {
        struct teeth_cell *c = &cells[k];
        float share, *m = c->mean;

        *c = teeth_cell_make(&share, k / K, k % K, K);
        for (int i = 0; i < 3; i++) {
            m[i] = rest->centre[i] + mm * size * m[i];
            c->scale[i] = fminf(c->scale[i] * mm * size, BRANCH_SCALE_MAX);
        }
        if (c->layer == TEETH_UPPER)
            m[1] += lift;
        if (!h->nchin)
            continue;
        drive_jaw(c->jaw, m, share, hinge, rest->chin);
        m[0] += c->jaw[0] * d[0];
        m[1] += c->jaw[2] * d[2] + c->jaw[1] * d[1];
        m[2] += c->jaw[1] * d[2] - c->jaw[2] * d[1];
    }
}

/* Column by column the lowest cell that is teeth; the rows of the middle half
 * are as high as the first one's. */
float teeth_lift(const struct teeth_cell *cells, const float *like, size_t K)
{
    const size_t crown = teeth_crown_rows(teeth_upper_rows(K));
    float sum = 0, found = 0;

    for (size_t j = 3 * K / 8; j < K - 3 * K / 8; j++)
        for (size_t i = 0; i < crown; i++) {
            if (!(like[i * K + j] > 0.5f))
                continue;
            found++;
            if (i > 0)
                sum += cells[i * K + j].mean[1] - cells[j].mean[1];
            break;
        }
    return found > (float)(K / 8) ? sum / found : 0;
}

void teeth_light(float light[3], const struct teeth_cell *cells,
                 const float *like, const float *pixel, size_t K)
{
    float seen = 0, there[3] = {0}, own[3] = {1e-6f, 1e-6f, 1e-6f};

    for (size_t k = 0; k < teeth_upper_rows(K) * K; k++) {
        seen += like[k];
        for (int c = 0; c < 3; c++) {
            there[c] += like[k] * pixel[4 * k + c];
            own[c] += like[k] * cells[k].color[c];
        }
    }
    const float count = (float)(K * K);
    const float share = branch_ramp(seen, count / 64, count / 32);
    for (int c = 0; c < 3; c++)
        light[c] *= 1 + share * (fminf(there[c] / own[c], 2) - 1);
}

int teeth_hidden(const struct teeth_cell *cells, size_t K, size_t k)
{
    const size_t column = k % K, lower = teeth_upper_rows(K) * K;
    const float y = cells[k].mean[1];

    return (cells[k].layer != TEETH_UPPER && y > cells[column].mean[1]) ||
           (cells[k].layer == TEETH_BACK && y < cells[lower + column].mean[1]);
}
