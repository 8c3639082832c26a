/* The double-precision reference, backwards: the gradients of Eq. C and of
 * the EWA projection, by the chain rule, step by step backwards. */
#include "tests/reference/splat_backward.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/vec3.h"
#include "lib/splat/reference_traversal.h"

/* Sums of one Gaussian over the pixels. */
struct screen {
    double x, y;              /* dL/d centre */
    double conic[3];          /* dL/d A, B, C */
    double opacity;
};

/* Back to front through one pixel.  behind = what the light behind a Gaussian
 * is worth to the loss, so that dL/dalpha = T (c.g - behind): no division by
 * 1 - alpha, which may be 0 under EXACT. */
static void reference_pixel_backward(struct screen *s, double *d_color,
                                     const struct contribution *found,
                                     size_t count, const struct traversal *w,
                                     const double *g, double d_alpha)
{
    const struct reference *t = w->scene;
    size_t C = (size_t)t->channels;
    double behind = dot_many(t->background, g, C) - d_alpha;

    for (size_t k = count; k-- > 0;) {
        const struct contribution *h = &found[k];
        const struct reference_point *p = &w->point[h->i];
        const double *color = t->color + h->i * C;
        double cg = dot_many(color, g, C), da = h->T * (cg - behind);

        behind = h->alpha * cg + (1 - h->alpha) * behind;
        for (size_t c = 0; d_color && c < C; c++)
            d_color[h->i * C + c] += h->alpha * h->T * g[c];
        if (h->clamped && t->rules != SPLAT_DGR)
            continue;
        /* alpha = o e^-sigma */
        double ds = -t->opacity[h->i] * h->falloff * da;
        struct screen *o = &s[h->i];

        o->opacity += h->falloff * da;
        o->x += ds * (p->conic[0] * h->dx + p->conic[1] * h->dy);
        o->y += ds * (p->conic[2] * h->dy + p->conic[1] * h->dx);
        o->conic[0] += ds * 0.5 * h->dx * h->dx;
        o->conic[1] += ds * h->dx * h->dy;
        o->conic[2] += ds * 0.5 * h->dy * h->dy;
    }
}

/* dL/dcov (symmetric: xx, xy, yy with dL = xx.dxx + 2 xy.dxy + yy.dyy) from
 * dL/dconic: -K G K. */
static void reference_conic_backward(double S[3], const double *G,
                                     const struct reference_point *p,
                                     enum splat_rules rules)
{
    const double *k = p->conic;
    double g[2][2] = {{G[0], G[1] / 2}, {G[1] / 2, G[2]}};
    double K[2][2] = {{k[0], k[1]}, {k[1], k[2]}}, t[2][2], f = -1;

    if (rules == SPLAT_DGR)               /* as the CUDA source guards it */
        f = -p->det * p->det / (p->det * p->det + 1e-7);
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            t[i][j] = K[i][0] * g[0][j] + K[i][1] * g[1][j];
    S[0] = f * (t[0][0] * K[0][0] + t[0][1] * K[1][0]);
    S[1] = f * (t[0][0] * K[0][1] + t[0][1] * K[1][1]);
    S[2] = f * (t[1][0] * K[0][1] + t[1][1] * K[1][1]);
}

/* dL/dquat from dL/dR. */
static void reference_rotation_backward(double *out, const double dR[9],
                                        const double *quat,
                                        enum splat_rules rules)
{
    double n = 1, q[4], d[4];

    if (rules != SPLAT_DGR)
        n = fmax(sqrt(dot_many(quat, quat, 4)), 1e-12);
    for (int k = 0; k < 4; k++)
        q[k] = quat[k] / n;
    double w = q[0], x = q[1], y = q[2], z = q[3];

    d[0] = 2 * (x * (dR[7] - dR[5]) + y * (dR[2] - dR[6]) +
                z * (dR[3] - dR[1]));
    d[1] = 2 * (y * (dR[1] + dR[3]) + z * (dR[2] + dR[6]) +
                w * (dR[7] - dR[5])) - 4 * x * (dR[4] + dR[8]);
    d[2] = 2 * (x * (dR[1] + dR[3]) + z * (dR[5] + dR[7]) +
                w * (dR[2] - dR[6])) - 4 * y * (dR[0] + dR[8]);
    d[3] = 2 * (x * (dR[2] + dR[6]) + y * (dR[5] + dR[7]) +
                w * (dR[3] - dR[1])) - 4 * z * (dR[0] + dR[4]);
    double along = rules != SPLAT_DGR && n > 1e-12 ? dot_many(d, q, 4) : 0;

    for (int k = 0; k < 4; k++)
        out[k] = (d[k] - along * q[k]) / n;
}

/* What one screen axis passes back: its row of J W, its centre. */
static void reference_axis_backward(double dc[3], double *d_rt,
                                    const double dJ[3], double d_center,
                                    double f, double lim, int row,
                                    const double c[3],
                                    const struct reference *t)
{
    const double *P = t->rt;
    double z = c[2], u = c[row] / z, eps = t->rules == SPLAT_DGR ? 1e-7 : 0;
    bool inside = u >= -lim && u <= lim;

    u = fmin(fmax(u, -lim), lim);
    for (int l = 0; l < 3; l++) {
        /* row l of J W was f / z (P[row][l] - u P[2][l]) */
        double du = -f / z * P[8 + l] * dJ[l];

        dc[2] -= f / (z * z) * (P[4 * row + l] - u * P[8 + l]) * dJ[l];
        if (inside)
            dc[row] += du / z;
        if (inside || t->rules == SPLAT_DGR)
            dc[2] -= du * u / z;
        d_rt[4 * row + l] += f / z * dJ[l];
        d_rt[8 + l] -= f / z * u * dJ[l];
    }
    dc[row] += d_center * f / (z + eps);
    dc[2] -= d_center * f * c[row] / ((z + eps) * (z + eps));
}

struct gradient {
    double mean[3], scale[3], quat[4], rt[12];
};

/* From the screen's sums to Gaussian i's parameters and the camera. */
static void reference_gaussian_backward(struct gradient *out,
                                        const struct screen *s,
                                        const struct reference_point *p,
                                        const struct reference *t, size_t i)
{
    const double *P = t->rt, *m = t->mean + 3 * i, *sc = t->scale + 3 * i;
    double S[3], R[9], dR[9], c[3], dc[3] = {0}, dJ[2][3] = {{0}}, J[2][3];
    double lim[2] = {0.65 * t->width / t->fx, 0.65 * t->height / t->fy};
    double f[2] = {t->fx, t->fy}, center[2] = {s->x, s->y};

    memset(out, 0, sizeof *out);
    for (int r = 0; r < 3; r++)
        c[r] = dot_many(P + 4 * r, m, 3) + P[4 * r + 3];
    reference_conic_backward(S, s->conic, p, t->rules);
    reference_rotation(R, t->quat + 4 * i, t->rules);
    for (int r = 0; r < 2; r++)
        for (int l = 0; l < 3; l++) {
            double u = fmin(fmax(c[r] / c[2], -lim[r]), lim[r]);

            J[r][l] = f[r] / c[2] * (P[4 * r + l] - u * P[8 + l]);
        }
    for (int k = 0; k < 3; k++) {
        /* U = J W R diag(s), cov = U U^T: dU = 2 S U */
        double U[2] = {0}, dU[2];

        for (int l = 0; l < 3; l++)
            for (int r = 0; r < 2; r++)
                U[r] += J[r][l] * R[3 * l + k] * sc[k];
        dU[0] = 2 * (S[0] * U[0] + S[1] * U[1]);
        dU[1] = 2 * (S[1] * U[0] + S[2] * U[1]);
        for (int l = 0; l < 3; l++) {
            double da = J[0][l] * dU[0] + J[1][l] * dU[1];

            for (int r = 0; r < 2; r++)
                dJ[r][l] += dU[r] * R[3 * l + k] * sc[k];
            out->scale[k] += da * R[3 * l + k];
            dR[3 * l + k] = da * sc[k];
        }
    }
    reference_rotation_backward(out->quat, dR, t->quat + 4 * i, t->rules);
    for (int r = 0; r < 2; r++)
        reference_axis_backward(dc, out->rt, dJ[r], center[r], f[r], lim[r], r,
                                c, t);
    for (int r = 0; r < 3; r++) {
        for (int l = 0; l < 3; l++) {
            out->mean[l] += dc[r] * P[4 * r + l];
            out->rt[4 * r + l] += dc[r] * m[l];
        }
        out->rt[4 * r + 3] += dc[r];
    }
}

/* Row i of to, which may be NULL. */
static void reference_store_row(double *to, const double *from, size_t i,
                                size_t n)
{
    if (to)
        memcpy(to + i * n, from, n * sizeof *to);
}

/* Gaussian i's gradients to their rows of g, the camera's added to g's. */
static void reference_store(const struct reference_gradients *g,
                            struct screen *s, const struct reference_point *p,
                            const struct reference *t, size_t i)
{
    struct gradient one = {0};

    double center[2] = {s->x, s->y};
    if (g->places)
        reference_places_backward(center,
                                  g->color + i * (size_t)t->channels, p, t,
                                  g->places, i);
    s->x = center[0];
    s->y = center[1];
    if (p->front)
        reference_gaussian_backward(&one, s, p, t, i);
    reference_store_row(g->mean, one.mean, i, 3);
    reference_store_row(g->scale, one.scale, i, 3);
    reference_store_row(g->quat, one.quat, i, 4);
    reference_store_row(g->opacity, &s->opacity, i, 1);
    reference_store_row(g->center, center, i, 2);
    reference_store_row(g->conic, s->conic, i, 3);
    for (int k = 0; g->rt && k < 12; k++)
        g->rt[k] += one.rt[k];
}

int reference_backward(const struct reference_gradients *g,
                       const struct reference *t,
                       const double *d_image, const double *d_alpha,
                       struct error *err)
{
    struct screen *s = calloc(t->n + 1, sizeof *s);
    struct contribution *found = NULL;
    struct traversal w = {0};
    int rc = -1;

    if (!s || traversal_init(&w, t, err) ||
        !(found = malloc((traversal_longest(&w) + 1) * sizeof *found))) {
        if (!w.point || !found)
            error_set(err, EX_OSERR, "out of memory");
        goto out;
    }
    size_t C = (size_t)t->channels;

    if (g->color)
        memset(g->color, 0, t->n * C * sizeof *g->color);
    for (int y = 0; y < t->height; y++)
        for (int x = 0; x < t->width; x++) {
            size_t at = (size_t)y * (size_t)t->width + (size_t)x;
            double T;
            size_t count = traversal_pixel(found, &T, NULL, &w, x, y);

            reference_pixel_backward(s, g->color, found, count, &w,
                                     d_image + at * C,
                                     d_alpha ? d_alpha[at] : 0);
        }
    if (g->rt)
        memset(g->rt, 0, 12 * sizeof *g->rt);
    for (size_t i = 0; i < t->n; i++)
        reference_store(g, &s[i], &w.point[i], t, i);
    rc = 0;
out:
    free(found);
    free(s);
    traversal_release(&w);
    return rc;
}
