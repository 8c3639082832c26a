/* The double-precision reference, first part: Gaussians and camera in double,
 * and each Gaussian's way to the screen by the EWA splatting formulas that the
 * paper's preliminaries give, term by term. */
#include "lib/splat/reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/half.h"

/* Rows of the picked Gaussians in double: the first `keep` of `row` numbers of
 * `in` or, where that is NULL, of `half`. */
static double *reference_widen(const float *in, const uint16_t *half,
                               const uint32_t *pick, size_t n, size_t row,
                               size_t keep)
{
    double *out = malloc((n * keep + 1) * sizeof *out);

    for (size_t i = 0; out && i < n; i++)
        for (size_t k = 0; k < keep; k++) {
            const size_t at = pick[i] * row + k;

            out[i * keep + k] = in ? in[at] : half_to_float(half[at]);
        }
    return out;
}

int reference_init(struct reference *t, const struct gaussians *g,
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
    t->mean = reference_widen(g->mean, NULL, pick, n, 3, 3);
    t->scale = reference_widen(g->scale, NULL, pick, n, 3, 3);
    t->quat = reference_widen(g->quat, NULL, pick, n, 4, 4);
    t->opacity = reference_widen(g->opacity, NULL, pick, n, 1, 1);
    t->color = reference_widen(g->color, g->color_half, pick, n,
                               (size_t)g->channels, (size_t)channels);
    free(pick);
    for (int k = 0; k < 12; k++)
        t->rt[k] = cam->rt[k];
    t->fx = cam->fx;
    t->fy = cam->fy;
    t->cx = cam->cx;
    t->cy = cam->cy;
    if (!t->mean || !t->scale || !t->quat || !t->opacity || !t->color) {
        reference_release(t);
        return error_set(err, EX_OSERR, "out of memory");
    }
    return 0;
}

void reference_release(struct reference *t)
{
    free(t->mean);
    free(t->scale);
    free(t->quat);
    free(t->opacity);
    free(t->color);
    memset(t, 0, sizeof *t);
}

void reference_rotation(double R[9], const double *quat,
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
static void reference_dgr_tiles(struct reference_point *p,
                                const struct reference *t)
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

/* The screen's covariance U U^T + 0.3, its inverse and its determinant from
 * cross products, which do not cancel. */
static void reference_set_conic(struct reference_point *p, const double U[2][3])
{
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
}

/* Camera coordinates, R S, the 3D covariance, then U = J W R S. */
void reference_project(struct reference_point *p, const struct reference *t,
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
    reference_rotation(R, t->quat + 4 * i, t->rules);
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
    reference_set_conic(p, U);
    if (t->rules == SPLAT_DGR)
        reference_dgr_tiles(p, t);
}
