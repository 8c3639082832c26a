#include "lib/splat/reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"
#include "lib/splat/reference_walk.h"

#define TILE 8            /* pixels, of the lists that save empty work */
#define TINY 1e-18        /* e^-sigma under which EXACT leaves a term out */

static double *widen(const float *in, const uint32_t *pick, size_t n,
                     size_t row, size_t keep)
{
    double *out = malloc((n * keep + 1) * sizeof *out);

    for (size_t i = 0; out && i < n; i++)
        for (size_t k = 0; k < keep; k++)
            out[i * keep + k] = in[pick[i] * row + k];
    return out;
}

static double *widen_half(const uint16_t *in, const uint32_t *pick, size_t n,
                          size_t row, size_t keep)
{
    double *out = malloc((n * keep + 1) * sizeof *out);

    for (size_t i = 0; out && i < n; i++)
        for (size_t k = 0; k < keep; k++)
            out[i * keep + k] = half_to_float(in[pick[i] * row + k]);
    return out;
}

int splat_truth_init(struct splat_truth *t, const struct gaussians *g,
                     const struct splat_camera *cam, int width, int height,
                     int channels, enum splat_rules rules,
                     unsigned branches, struct error *err)
{
    uint32_t *pick = malloc((g->n + 1) * sizeof *pick);
    size_t n = 0;

    memset(t, 0, sizeof *t);
    if (!pick)
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t i = 0; i < g->n; i++)
        if (!branches || !g->branch || branches >> g->branch[i] & 1)
            pick[n++] = (uint32_t)i;
    t->width = width;
    t->height = height;
    t->channels = channels;
    t->rules = rules;
    t->near = rules == SPLAT_DGR ? 0.2 : 0.01;
    t->alpha_cut = 1.0 / 255;
    t->t_cut = 1e-4;
    t->n = n;
    t->mean = widen(g->mean, pick, n, 3, 3);
    t->scale = widen(g->scale, pick, n, 3, 3);
    t->quat = widen(g->quat, pick, n, 4, 4);
    t->opacity = widen(g->opacity, pick, n, 1, 1);
    t->color = g->color
        ? widen(g->color, pick, n, (size_t)g->channels, (size_t)channels)
        : widen_half(g->color_half, pick, n, (size_t)g->channels,
                     (size_t)channels);
    free(pick);
    for (int k = 0; k < 12; k++)
        t->rt[k] = cam->rt[k];
    t->fx = cam->fx;
    t->fy = cam->fy;
    t->cx = cam->cx;
    t->cy = cam->cy;
    if (!t->mean || !t->scale || !t->quat || !t->opacity || !t->color) {
        splat_truth_release(t);
        return error_set(err, EX_OSERR, "out of memory");
    }
    return 0;
}

void splat_truth_release(struct splat_truth *t)
{
    free(t->mean);
    free(t->scale);
    free(t->quat);
    free(t->opacity);
    free(t->color);
    memset(t, 0, sizeof *t);
}

void splat_truth_rotation(double R[9], const double *quat,
                          enum splat_rules rules)
{
    double w = quat[0], x = quat[1], y = quat[2], z = quat[3];

    if (rules != SPLAT_DGR) {
        double norm = fmax(sqrt(w * w + x * x + y * y + z * z), 1e-12);

        w /= norm;
        x /= norm;
        y /= norm;
        z /= norm;
    }
    R[0] = 1 - 2 * (y * y + z * z);
    R[1] = 2 * (x * y - w * z);
    R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z);
    R[4] = 1 - 2 * (x * x + z * z);
    R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y);
    R[7] = 2 * (y * z + w * x);
    R[8] = 1 - 2 * (x * x + y * y);
}

/* The CUDA rasteriser's tiles: whole 16x16 ones within 3 sigma. */
static void dgr_tiles(struct splat_point *p, const struct splat_truth *t)
{
    double mid = 0.5 * (p->cov[0] + p->cov[2]);
    double r = ceil(3 * sqrt(mid + sqrt(fmax(0.1, mid * mid - p->det))));
    double c[2] = {p->x - 0.5, p->y - 0.5};
    int size[2] = {t->width, t->height};

    for (int k = 0; k < 2; k++) {
        double last = (size[k] + 15) / 16;
        double lo = trunc((c[k] - r) / 16), hi = trunc((c[k] + r + 15) / 16);

        p->tile[2 * k] = (int)fmin(fmax(lo, 0), last);
        p->tile[2 * k + 1] = (int)fmin(fmax(hi, 0), last);
    }
}

void splat_truth_project(struct splat_point *p, const struct splat_truth *t,
                         size_t i)
{
    const double *m = t->mean + 3 * i, *s = t->scale + 3 * i, *P = t->rt;
    double R[9], a[3][3], U[2][3], c[3];

    memset(p, 0, sizeof *p);
    for (int r = 0; r < 3; r++)
        c[r] = P[4 * r] * m[0] + P[4 * r + 1] * m[1] + P[4 * r + 2] * m[2] +
               P[4 * r + 3];
    p->z = c[2];
    p->front = c[2] > t->near;
    splat_truth_rotation(R, t->quat + 4 * i, t->rules);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            a[r][k] = R[3 * r + k] * s[k];
    for (int k = 0, e = 0; k < 3; k++)
        for (int l = k; l < 3; l++, e++)
            p->cov3[e] = a[k][0] * a[l][0] + a[k][1] * a[l][1] +
                         a[k][2] * a[l][2];
    if (!p->front)
        return;
    double eps = t->rules == SPLAT_DGR ? 1e-7 : 0;
    double limx = 0.65 * t->width / t->fx, limy = 0.65 * t->height / t->fy;
    double u = fmin(fmax(c[0] / c[2], -limx), limx);
    double v = fmin(fmax(c[1] / c[2], -limy), limy);

    p->x = t->fx * c[0] / (c[2] + eps) + t->cx;
    p->y = t->fy * c[1] / (c[2] + eps) + t->cy;
    /* rows of J W, then of J W R S: cov = U U^T */
    for (int k = 0; k < 3; k++) {
        double jx = t->fx / c[2], jy = t->fy / c[2];

        U[0][k] = U[1][k] = 0;
        for (int l = 0; l < 3; l++) {
            U[0][k] += jx * (P[l] - u * P[8 + l]) * a[l][k];
            U[1][k] += jy * (P[4 + l] - v * P[8 + l]) * a[l][k];
        }
    }
    double xx = 0, xy = 0, yy = 0, n2 = 0;

    for (int k = 0; k < 3; k++) {
        int l = (k + 1) % 3;
        double cross = U[0][k] * U[1][l] - U[0][l] * U[1][k];

        xx += U[0][k] * U[0][k];
        xy += U[0][k] * U[1][k];
        yy += U[1][k] * U[1][k];
        n2 += cross * cross;
    }
    p->det_sharp = n2;                      /* xx yy - xy^2, no cancelling */
    p->det = n2 + 0.3 * (xx + yy) + 0.09;
    p->cov[0] = xx + 0.3;
    p->cov[1] = xy;
    p->cov[2] = yy + 0.3;
    p->conic[0] = p->cov[2] / p->det;
    p->conic[1] = -p->cov[1] / p->det;
    p->conic[2] = p->cov[0] / p->det;
    if (t->rules == SPLAT_DGR)
        dgr_tiles(p, t);
}

struct key {
    double z;
    uint32_t i;
};

static int by_depth(const void *a, const void *b)
{
    const struct key *p = a, *q = b;

    if (p->z != q->z)
        return p->z < q->z ? -1 : 1;
    return p->i < q->i ? -1 : p->i > q->i;
}

/* Range of list tiles along one axis that [c - r, c + r] touches. */
static void tile_range(uint16_t out[2], double c, double r, int tiles)
{
    double lo = floor((c - r - 0.5) / TILE), hi = ceil((c + r + 0.5) / TILE);

    out[0] = (uint16_t)fmin(fmax(lo, 0), tiles);
    out[1] = (uint16_t)fmin(fmax(hi, 0), tiles);
}

static void bounds(uint16_t box[4], const struct splat_point *p, double o,
                   const struct splat_truth *t, int tx, int ty)
{
    double level = t->rules == SPLAT_EXACT
        ? -2 * log(TINY) : 2 * log(o / (t->alpha_cut * (1 - 1e-4)));

    memset(box, 0, 4 * sizeof *box);
    if (!p->front || !(level > 0))
        return;
    tile_range(box, p->x, sqrt(level * p->cov[0]), tx);
    tile_range(box + 2, p->y, sqrt(level * p->cov[2]), ty);
}

/* Tile lists in depth order: count, sum up, fill. */
static int fill_lists(struct walk *w, const struct splat_truth *t,
                      const struct key *key, struct error *err)
{
    size_t tiles = (size_t)w->tx * (size_t)w->ty, total = 0;
    uint16_t (*box)[4] = malloc((t->n + 1) * sizeof *box);

    w->start = calloc(tiles + 2, sizeof *w->start);
    if (!box || !w->start) {
        free(box);
        return error_set(err, EX_OSERR, "out of memory");
    }
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = 0; k < t->n; k++) {
            uint32_t i = key[k].i;

            if (!pass)
                bounds(box[i], &w->point[i], t->opacity[i], t, w->tx, w->ty);
            for (size_t y = box[i][2]; y < box[i][3]; y++)
                for (size_t x = box[i][0]; x < box[i][1]; x++) {
                    size_t at = y * (size_t)w->tx + x;

                    if (pass)
                        w->list[w->start[at + 1]++] = i;
                    else
                        w->start[at + 2]++;
                }
        }
        for (size_t a = 2; !pass && a < tiles + 2; a++)
            w->start[a] = total += w->start[a];
        if (!pass && !(w->list = malloc((total + 1) * sizeof *w->list))) {
            free(box);
            return error_set(err, EX_OSERR, "out of memory");
        }
    }
    free(box);
    return 0;
}

int walk_init(struct walk *w, const struct splat_truth *t, struct error *err)
{
    struct key *key = malloc((t->n + 1) * sizeof *key);
    int rc = -1;

    memset(w, 0, sizeof *w);
    w->truth = t;
    w->tx = (t->width + TILE - 1) / TILE;
    w->ty = (t->height + TILE - 1) / TILE;
    w->point = malloc((t->n + 1) * sizeof *w->point);
    if (!key || !w->point) {
        error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    for (size_t i = 0; i < t->n; i++) {
        splat_truth_project(&w->point[i], t, i);
        key[i].z = w->point[i].z;
        key[i].i = (uint32_t)i;
    }
    if (t->order)
        for (size_t i = 0; i < t->n; i++)
            key[i].i = t->order[i];
    else
        qsort(key, t->n, sizeof *key, by_depth);
    rc = fill_lists(w, t, key, err);
out:
    free(key);
    if (rc)
        walk_release(w);
    return rc;
}

void walk_release(struct walk *w)
{
    free(w->point);
    free(w->start);
    free(w->list);
    memset(w, 0, sizeof *w);
}

size_t walk_tile(const struct walk *w, int x, int y, const uint32_t **list)
{
    size_t at = (size_t)(y / TILE) * (size_t)w->tx + (size_t)(x / TILE);

    *list = w->list + w->start[at];
    return w->start[at + 1] - w->start[at];
}

static bool near(double a, double b)
{
    return fabs(a - b) <= 1e-5 * fabs(b);
}

/* Does DGR's choice of whole tiles leave this pixel to the Gaussian? */
static bool tile_has(const struct splat_point *p, int x, int y)
{
    return x / 16 >= p->tile[0] && x / 16 < p->tile[1] &&
           y / 16 >= p->tile[2] && y / 16 < p->tile[3];
}

size_t walk_pixel(struct hit *hit, double *T_final, uint8_t *ambiguous,
                  const struct walk *w, int x, int y)
{
    const struct splat_truth *t = w->truth;
    const uint32_t *list;
    size_t n = walk_tile(w, x, y, &list), hits = 0;
    double T = 1;

    for (size_t k = 0; k < n; k++) {
        const struct splat_point *p = &w->point[list[k]];
        struct hit h = {.i = list[k], .T = T};

        h.dx = p->x - (x + 0.5);
        h.dy = p->y - (y + 0.5);
        double sigma = 0.5 * (p->conic[0] * h.dx * h.dx +
                              p->conic[2] * h.dy * h.dy) +
                       p->conic[1] * h.dx * h.dy;

        h.fall = exp(-sigma);
        h.alpha = t->opacity[h.i] * h.fall;
        if (t->rules == SPLAT_EXACT) {
            if (h.fall < TINY)
                continue;
        } else {
            if (t->rules == SPLAT_DGR && !tile_has(p, x, y))
                continue;
            if (ambiguous && near(h.alpha, t->alpha_cut))
                *ambiguous = 1;
            if (sigma < 0 || h.alpha < t->alpha_cut)
                continue;
            h.clamped = h.alpha > 0.99;
            if (h.clamped)
                h.alpha = 0.99;
            double next = T * (1 - h.alpha);

            if (ambiguous && near(next, t->t_cut))
                *ambiguous = 1;
            if (t->rules == SPLAT_DGR ? next < t->t_cut : next <= t->t_cut)
                break;
        }
        T *= 1 - h.alpha;
        hit[hits++] = h;
    }
    *T_final = T;
    return hits;
}

size_t walk_longest(const struct walk *w)
{
    size_t most = 0;

    for (size_t a = 0; a < (size_t)w->tx * (size_t)w->ty; a++)
        if (w->start[a + 1] - w->start[a] > most)
            most = w->start[a + 1] - w->start[a];
    return most;
}

static void sum_pixel(double *image, double *alpha, double *depth,
                      const struct hit *hit, size_t hits, double T,
                      const struct walk *w)
{
    const struct splat_truth *t = w->truth;
    size_t C = (size_t)t->channels;
    double weight = 0, sum_z = 0;

    for (size_t c = 0; c < C; c++)
        image[c] = T * t->background[c];
    for (size_t k = 0; k < hits; k++) {
        double wt = hit[k].alpha * hit[k].T;

        weight += wt;
        sum_z += wt * w->point[hit[k].i].z;
        for (size_t c = 0; c < C; c++)
            image[c] += wt * t->color[hit[k].i * C + c];
    }
    if (alpha)
        *alpha = 1 - T;
    if (depth)
        *depth = weight > 0 ? sum_z / weight : 0;
}

static void draw_row(double *image, double *alpha, double *depth,
                     uint8_t *ambiguous, const struct walk *w,
                     struct hit *hit, int y)
{
    const struct splat_truth *t = w->truth;

    for (int x = 0; x < t->width; x++) {
        size_t at = (size_t)y * (size_t)t->width + (size_t)x;
        uint8_t flag = 0;
        double T;
        size_t hits = walk_pixel(hit, &T, ambiguous ? &flag : NULL, w, x, y);

        sum_pixel(image + at * (size_t)t->channels,
                  alpha ? alpha + at : NULL, depth ? depth + at : NULL, hit,
                  hits, T, w);
        if (ambiguous)
            ambiguous[at] = flag;
    }
}

int splat_reference_forward(double *image, double *alpha, double *depth,
                            uint8_t *ambiguous, const struct splat_truth *t,
                            struct error *err)
{
    struct walk w;
    int failed = 0;

    if (walk_init(&w, t, err))
        return -1;
#pragma omp parallel reduction(| : failed)
    {
        struct hit *hit = malloc((walk_longest(&w) + 1) * sizeof *hit);

        failed = !hit;
#pragma omp for schedule(dynamic, 1)
        for (int y = 0; y < t->height; y++)
            if (hit)
                draw_row(image, alpha, depth, ambiguous, &w, hit, y);
        free(hit);
    }
    walk_release(&w);
    return failed ? error_set(err, EX_OSERR, "out of memory") : 0;
}
