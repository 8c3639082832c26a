/* Alpha matting by local normal distributions (matting.h), up to the layers'
 * guesses. */
#include "lib/photo/matting_kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/crop.h"
#include "lib/base/parallel.h"
#include "lib/base/vec3.h"
#include "lib/nn/math.h"
#include "lib/photo/pyramid.h"

/* tests/bench/matte.sh measures what these give on scans: halving or doubling
 * one changes the mean error of the matte by less than a tenth. */
#define CELLS 64                /* statistics are by cells, so many across */
#define SMALL 512               /* pixels across, of the picture they are of */
#define TRIMAP 0.1f             /* decided: this far from it, not at all */
#define NOISE (2.5f / 255)      /* of a pixel: camera, compression */
#define STRANGE_BACK 0.02f      /* density of colours that a side has not */
#define STRANGE_FORE 0.5f       /* shown; more: people have many */
#define MIXED 0.3f              /* of a rim, where both are as likely */
#define EVIDENCE 0.25f          /* of a cell: what coarser cells count for it */
#define STATES 8                /* of alpha: 0, six intervals between, 1 */
#define RUN 16                  /* pixels at once */

enum { SIDE_BACK, SIDE_FORE, SIDES };
enum { MOMENTS = 10 };          /* 1, c, and the lower half of c c' */
enum { FORM = 10, GAIN = 4 };   /* coefficients of a quadratic; of a plane */

/* A normal distribution of colours, 0..1. */
struct matting_colours {
    float mean[3], cov[6];      /* xx, yx, yy, zx, zy, zz */
};

/* What a cell says of a pixel's colour c, for each state of alpha: the
 * logarithm of its likelihood is a quadratic in c, and the mean of alpha within
 * the state is linear in c.  All floats, so that cells can be mixed. */
struct matting_cell {
    float form[FORM][STATES], gain[GAIN][STATES], spread[STATES];
    struct matting_colours side[SIDES];
};

/* small: the picture of which the statistics are; its back is NULL, and none is
 * looked for. */
struct matting_work {
    struct matting small;
    uint8_t rgb[3 * SMALL * SMALL], alpha[SMALL * SMALL];
    uint8_t confidence[SMALL * SMALL];
    float moment[SIDES][(CELLS * CELLS * 4 / 3 + 1) * MOMENTS]; /* pyramids */
    struct matting_cell cell[CELLS * CELLS];
    const float *prior;         /* (w,w), or NULL */
    size_t w;
    bool known;                 /* alpha, in the picture */
};

static inline float matting_clamp(float x)
{
    return x < 0 ? 0 : x > 1 ? 1 : x;
}

static inline uint8_t matting_byte(float x)
{
    return (uint8_t)(255 * matting_clamp(x) + 0.5f);
}

/* ---- what is decided, and its colours' statistics ----------------------- */

/* Adds the pixels of the small picture that are decided to their cells, as far
 * as they are: a little of the other side in many of them would be a colour of
 * this one. */
static void matting_gather(struct matting_work *k)
{
    const struct matting *m = &k->small;
    const size_t s = m->n;

    memset(k->moment, 0, sizeof k->moment);
    for (size_t i = 0; i < s * s; i++) {
        const float a = (float)m->alpha[i] / 255;
        const size_t cell = i / s * CELLS / s * CELLS + i % s * CELLS / s;
        float *to = k->moment[a > 0.5f] + cell * MOMENTS, c[3];

        if (!extent_has(&m->inside, i % s, i / s) ||
            (a > TRIMAP && a < 1 - TRIMAP))
            continue;
        const float w = 1 - fminf(a, 1 - a) / TRIMAP;

        to[0] += w;
        for (int j = 0, l = 4; j < 3; j++) {
            c[j] = (float)m->rgb[3 * i + j] / 255;
            to[1 + j] += w * c[j];
            for (int h = 0; h <= j; h++)
                to[l++] += w * c[j] * c[h];
        }
    }
}

/* ---- the likelihood of a colour ------------------------------------------ */

static void matting_normal(struct matting_colours *c, const float *m)
{
    for (int j = 0; j < 3; j++)
        c->mean[j] = m[1 + j] / m[0];
    for (int j = 0, l = 0; j < 3; j++)
        for (int h = 0; h <= j; h++, l++) {
            const float cov = m[4 + l] / m[0] - c->mean[j] * c->mean[h];
            c->cov[l] = h == j ? fmaxf(cov, 0) : cov;   /* after rounding */
        }
}

/* inverse = a^-1 of a symmetric matrix; returns its determinant. */
static float matting_invert(float inverse[6], const float a[6])
{
    const float xx = a[0], yx = a[1], yy = a[2], zx = a[3], zy = a[4],
                zz = a[5];
    const float c0 = yy * zz - zy * zy, c1 = zx * zy - yx * zz;
    const float c3 = yx * zy - zx * yy;
    const float det = xx * c0 + yx * c1 + zx * c3, by = 1 / det;

    inverse[0] = c0 * by;
    inverse[1] = c1 * by;
    inverse[2] = (xx * zz - zx * zx) * by;
    inverse[3] = c3 * by;
    inverse[4] = (zx * yx - xx * zy) * by;
    inverse[5] = (xx * yy - yx * yx) * by;
    return det;
}

/* y = a x. */
static void matting_apply(float y[3], const float a[6], const float x[3])
{
    y[0] = a[0] * x[0] + a[1] * x[1] + a[3] * x[2];
    y[1] = a[1] * x[0] + a[2] * x[1] + a[4] * x[2];
    y[2] = a[3] * x[0] + a[4] * x[1] + a[5] * x[2];
}

/* Alpha in the middle of a state, and its variance in there: of an interval, an
 * even distribution's. */
static float matting_state(float *variance, int state)
{
    const float width = 1.f / (STATES - 2);

    *variance = state > 0 && state < STATES - 1 ? width * width / 12 : 0;
    return state == 0 ? 0 : state == STATES - 1 ? 1
           : ((float)state - 0.5f) * width;
}

/* Covariance of alpha F + (1 - alpha) B plus noise. */
static void matting_mix(float cov[6], const struct matting_cell *c, float a)
{
    for (int l = 0; l < 6; l++)
        cov[l] = a * a * c->side[SIDE_FORE].cov[l] +
                 (1 - a) * (1 - a) * c->side[SIDE_BACK].cov[l];
    cov[0] += NOISE * NOISE;
    cov[2] += NOISE * NOISE;
    cov[5] += NOISE * NOISE;
}

/* The quadratic and the plane of one state. */
static void matting_prepare_state(struct matting_cell *c, int state)
{
    const float *F = c->side[SIDE_FORE].mean, *B = c->side[SIDE_BACK].mean;
    float variance, a = matting_state(&variance, state), inverse[6], cov[6];
    float mean[3], d[3], b[3], g[3];

    matting_mix(cov, c, a);
    for (int j = 0, l = 0; j < 3; j++) {
        d[j] = F[j] - B[j];
        mean[j] = B[j] + a * d[j];
        for (int h = 0; h <= j; h++)
            cov[l++] += variance * d[j] * d[h];
    }
    const float det = matting_invert(inverse, cov);
    matting_apply(b, inverse, mean);
    matting_apply(g, inverse, d);
    for (int l = 0; l < 6; l++)         /* the others stand twice in c' A c */
        c->form[l][state] = (l == 0 || l == 2 || l == 5 ? -0.5f : -1)
                            * inverse[l];
    for (int j = 0; j < 3; j++) {
        c->form[6 + j][state] = b[j];
        c->gain[j][state] = variance * g[j];
    }
    c->form[9][state] = -0.5f * (dot3(mean, b) + logf(det) +
                                 3 * 1.8378771f);
    c->gain[3][state] = a - variance * dot3(g, mean);
    c->spread[state] = variance - variance * variance * dot3(g, d);
}

PARALLEL(matting_prepare_part, i, struct matting_work *, k)
{
    struct matting_cell *c = k->cell + i;

    for (int side = 0; side < SIDES; side++)
        matting_normal(&c->side[side], k->moment[side] + i * MOMENTS);
    for (int state = 0; state < STATES; state++)
        matting_prepare_state(c, state);
}

/* ---- the posterior ------------------------------------------------------ */

/* to = a + t (b - a), n floats. */
static inline void matting_between(float *to, const float *a, const float *b,
                                   float t, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] = a[i] + t * (b[i] - a[i]);
}

/* Where a row of pixels is: the cells about it mixed, and the prior at its two
 * columns about a pixel. */
struct matting_row {
    struct matting_cell cell[CELLS];
    bool made[CELLS];
    size_t column;              /* the prior's, plus 1 */
    float left, step;
};

/* Cell u of the row of pixels y of n. */
static const struct matting_cell *matting_row_cell(struct matting_row *row,
                                                   const struct matting_work *k,
                                                   size_t u, size_t y, size_t n)
{
    float t;

    if (!row->made[u]) {
        const size_t v = pyramid_between(&t, y, n, CELLS);
        const struct matting_cell *a = k->cell + v * CELLS + u;

        matting_between((float *)(row->cell + u), (const float *)a,
                        (const float *)(a + CELLS), t,
                        sizeof *a / sizeof(float));
        row->made[u] = true;
    }
    return row->cell + u;
}

/* The prior, between its cells, at pixel (x,y) of n x n. */
static inline float matting_prior(struct matting_row *row,
                                  const struct matting_work *k, size_t x,
                                  size_t y, size_t n)
{
    float tx, ty;
    const size_t u = pyramid_between(&tx, x, n, k->w);

    if (u + 1 != row->column) {
        const size_t v = pyramid_between(&ty, y, n, k->w);
        const float *a = k->prior + v * k->w + u, *b = a + k->w;

        row->column = u + 1;
        row->left = a[0] + ty * (b[0] - a[0]);
        row->step = a[1] + ty * (b[1] - a[1]) - row->left;
    }
    return row->left + tx * row->step;
}

/* Pixels of a row that lie between the same two cells: how far they do, colours
 * and prior probabilities; then mean of alpha and standard deviation. */
struct matting_run {
    size_t n;                   /* others' numbers mean nothing */
    float t[RUN], c[3][RUN], p[RUN], mean[RUN], doubt[RUN];
};

/* The polynomial of `terms` coefficients, those of a and b mixed, at `in`. */
static inline float matting_sum(const float (*a)[STATES],
                                const float (*b)[STATES], float t,
                                const float (*in)[RUN], int terms, int state,
                                size_t i)
{
    float left = 0, right = 0;

#pragma GCC unroll 16
    for (int k = 0; k < terms; k++) {
        left += in[k][i] * a[k][state];
        right += in[k][i] * b[k][state];
    }
    return left + t * (right - left);
}

/* The posterior of a run between cells a and b. */
static void matting_posterior(struct matting_run *r,
                              const struct matting_cell *a,
                              const struct matting_cell *b)
{
    float in[FORM][RUN], none[RUN], rim[RUN], sum[RUN] = {0}, square[RUN] = {0};

    for (int j = 0, l = 0; j < 3; j++) {
        memcpy(in[6 + j], r->c[j], sizeof in[j]);
        for (int h = 0; h <= j; h++, l++)
            for (size_t i = 0; i < RUN; i++)
                in[l][i] = r->c[j][i] * r->c[h][i];
    }
    for (size_t i = 0; i < RUN; i++) {
        in[9][i] = 1;
        none[i] = 1 - r->p[i];
        rim[i] = MIXED * 2 * sqrtf(r->p[i] * none[i]) / (STATES - 2);
        r->mean[i] = 0;
    }
    for (int s = 0; s < STATES; s++) {
        const float *prior = s == 0 ? none : s == STATES - 1 ? r->p : rim;
        const float strange = s == STATES - 1 ? STRANGE_BACK + STRANGE_FORE
                                              : STRANGE_BACK;
#pragma omp simd
        for (size_t i = 0; i < RUN; i++) {
            const float likely = math_exp(matting_sum(a->form, b->form, r->t[i],
                                                      in, FORM, s, i)) + strange;
            const float alpha = matting_clamp(
                matting_sum(a->gain, b->gain, r->t[i], in + 6, GAIN, s, i));
            const float spread = a->spread[s] +
                                 r->t[i] * (b->spread[s] - a->spread[s]);
            const float fit = prior[i] * likely;

            sum[i] += fit;
            r->mean[i] += fit * alpha;
            square[i] += fit * (alpha * alpha + spread);
        }
    }
#pragma omp simd
    for (size_t i = 0; i < RUN; i++) {
        const float mean = r->mean[i] / sum[i];
        const float variance = square[i] / sum[i] - mean * mean;

        r->mean[i] = mean;
        r->doubt[i] = sqrtf(variance > 0 ? variance : 0);
    }
}

/* A colour's share in a sum that is c, as far as it can be one. */
static inline float matting_rest(float c, float other, float share)
{
    return matting_clamp((c - (1 - share) * other) / share);
}

/* B, the background's mean, becomes that of a pixel of colour c and such an
 * alpha, and one that some person before it explains. */
static void matting_unmix(float B[3], const struct matting_cell *cell,
                          const float c[3], float a)
{
    float cov[6], inverse[6], rest[3], pull[3], move[3];

    matting_mix(cov, cell, a);
    matting_invert(inverse, cov);
    for (int j = 0; j < 3; j++)
        rest[j] = c[j] - a * cell->side[SIDE_FORE].mean[j] - (1 - a) * B[j];
    matting_apply(pull, inverse, rest);
    matting_apply(move, cell->side[SIDE_BACK].cov, pull);
    for (int j = 0; j < 3; j++) {
        B[j] = matting_clamp(B[j] + (1 - a) * move[j]);
        B[j] = matting_rest(c[j], matting_rest(c[j], B[j], a), 1 - a);
    }
}

/* The background at pixel i, which is mostly that; beyond the picture, where it
 * is not `seen`, the person's colour, too. */
static void matting_layer(struct matting *m, const struct matting_cell *a,
                          const struct matting_cell *b, float t,
                          const float c[3], size_t i, bool seen)
{
    struct matting_cell mean;
    float *B = mean.side[SIDE_BACK].mean;

    matting_between((float *)mean.side, (const float *)a->side,
                    (const float *)b->side, t,
                    SIDES * sizeof *mean.side / sizeof(float));
    if (seen)
        matting_unmix(B, &mean, c, (float)m->alpha[i] / 255);
    for (int j = 0; j < 3; j++) {
        m->back[3 * i + j] = matting_byte(B[j]);
        if (!seen)
            m->rgb[3 * i + j] = matting_byte(mean.side[SIDE_FORE].mean[j]);
    }
}

/* The run from pixel (x,y) on, with the prior's alpha in m; returns its first cell. */
static size_t matting_take(struct matting_run *r, struct matting *m,
                           const struct matting_work *k,
                           struct matting_row *row, size_t x, size_t y)
{
    const size_t n = m->n, first = pyramid_between(r->t, x, n, CELLS);

    for (r->n = 0; r->n < RUN && x < n &&
                   pyramid_between(r->t + r->n, x, n, CELLS) == first;
         r->n++, x++) {
        const size_t i = y * n + x;
        const bool given = k->known && extent_has(&m->inside, x, y);

        for (size_t c = 0; c < 3; c++)
            r->c[c][r->n] = m->rgb[3 * i + c] / 255.f;
        r->p[r->n] = given ? (float)m->alpha[i] / 255
                           : matting_prior(row, k, x, y, n);
        m->alpha[i] = matting_byte(r->p[r->n]);
    }
    return first;
}

/* Pixel j of a run between cells a and b, which is pixel i: alpha and certainty,
 * unless that is known, and the layers, if they are wanted. */
static void matting_pixel(struct matting *m, const struct matting_run *r,
                          const struct matting_cell *a,
                          const struct matting_cell *b, size_t j, size_t i,
                          bool seen, bool known)
{
    const float c[3] = {r->c[0][j], r->c[1][j], r->c[2][j]};
    uint8_t *alpha = m->alpha + i;

    if (seen && !known) {
        *alpha = matting_byte(r->mean[j]);
        m->confidence[i] = matting_byte(1 - 2 * r->doubt[j]);
    }
    if (m->back && (!seen || (*alpha > 0 && *alpha <= MATTING_BACK)))
        matting_layer(m, a, b, r->t[j], c, i, seen);
}

/* One row. */
PARALLEL(matting_pixels_part, y, struct matting *, m,
         const struct matting_work *, k)
{
    struct matting_row row;
    struct matting_run r = {0};

    row.column = 0;
    memset(row.made, 0, sizeof row.made);
    for (size_t x = 0, i = y * m->n; x < m->n;) {
        const size_t u = matting_take(&r, m, k, &row, x, y);
        const struct matting_cell *a = NULL, *b = NULL;

        for (size_t j = 0; j < r.n; j++, i++, x++) {
            const bool seen = extent_has(&m->inside, x, y);

            m->confidence[i] = seen ? 255 : 0;
            /* a prior that shows in no byte decides */
            if (!seen || (m->alpha[i] > 0 && m->alpha[i] < 255)) {
                if (!a) {
                    a = matting_row_cell(&row, k, u, y, m->n);
                    b = matting_row_cell(&row, k, u + 1, y, m->n);
                    matting_posterior(&r, a, b);
                }
                matting_pixel(m, &r, a, b, j, i, seen, k->known);
            }
            if (m->back && seen && m->alpha[i] == 0)
                memcpy(m->back + 3 * i, m->rgb + 3 * i, 3);
        }
    }
}

/* ---- together ----------------------------------------------------------- */

/* The statistics of both sides as the small picture's alpha has them: of every
 * cell from its own pixels, or where it has few from those of coarser and coarser
 * cells about it; at last any colour is as likely. */
static void matting_learn(struct matting_work *k)
{
    static const float any[MOMENTS] = {
        1, .5f, .5f, .5f, 1 / 3.f, .25f, 1 / 3.f, .25f, .25f, 1 / 3.f
    };
    const float pixels = (float)(k->small.n * k->small.n);
    const float weight = EVIDENCE * pixels / (CELLS * CELLS);

    matting_gather(k);
    for (int side = 0; side < SIDES; side++)
        pyramid_pool(k->moment[side], CELLS, MOMENTS, weight, any);
    parallel_each(matting_prepare_part, CELLS * CELLS, 1, k);
}

/* The small picture's alpha: the prior, sharpened by statistics of what that
 * alone decides. */
static void matting_begin(struct matting_work *k)
{
    struct matting_row row = {.column = 0};
    const size_t s = k->small.n;

    for (size_t i = 0; i < s * s; i++) {
        row.column = i % s ? row.column : 0;
        k->small.alpha[i] = matting_byte(matting_prior(&row, k, i % s, i / s,
                                                       s));
    }
    matting_learn(k);
    parallel_each(matting_pixels_part, s, 1, &k->small, k);
}

int ISA(matting_find)(struct matting *m, const float *prior, size_t w,
                      bool known, struct error *err)
{
    const size_t n = m->n, s = n < SMALL ? n : SMALL;
    const double half = 0.5 * (double)n;
    const struct square all = {half, half, 2 * half};
    struct matting_work *k = malloc(sizeof *k);
    int rc = -1;

    if (!k || crop_resize_u8(k->rgb, s, m->rgb, n, n, 3 * n, 3, all) ||
        (known && crop_resize_u8(k->alpha, s, m->alpha, n, n, n, 1, all))) {
        error_set(err, EX_OSERR, "no memory for the matte");
        goto out;
    }
    k->small = (struct matting){s, extent_resize(m->inside, n, s), k->rgb,
                                k->alpha, k->confidence, NULL};
    k->prior = prior;
    k->w = w;
    k->known = known;
    if (!known)
        matting_begin(k);
    matting_learn(k);
    parallel_each(matting_pixels_part, m->n, 1, m, k);
    rc = 0;
out:
    free(k);
    return rc;
}
