/* From sums on the screen to the parameters of the Gaussians, 16 at a time. */
#include <string.h>

#include "lib/base/isa.h"
#include "lib/splat/backward.h"
#include "lib/splat/vec.h"

#define LOG2E 1.44269504f

void ISA(splat_gaussian_backward)(const struct splat *s, size_t first,
                                  size_t last,
                                  const struct splat_gradients *g,
                                  double *rt);

/* dL of sixteen Gaussians. */
struct lanes {
    vf x, y, a, b, c, top;     /* of the screen record */
    vf mean[3], scale[3], quat[4];
    vf P[12];                  /* of [R|t], summed over all */
};

/* Add up a Gaussian's pairs: moments about its own centre into out[0..5], and
 * its colour. */
static void sum_pairs(float out[16], const struct splat *s, size_t i,
                      float *d_color)
{
    const struct splat_state *st = s->state;
    const struct splat_gradient_state *b = st->gradient;
    struct rect r = st->rect[i];
    int C = s->opt.channels;
    float color[SPLAT_MAX_CHANNELS] = {0};
    double sum[MOMENTS] = {0};
    size_t at = b->base[i];

    for (int y = r.y0; y < r.y1; y++)
        for (int x = r.x0; x < r.x1; x++, at++) {
            const float *p = b->pair + at * (size_t)b->stride;

            if (!b->seen[at])
                continue;
            double u = st->record[i].x - (double)(16 * x + 8) + st->fine[0][i];
            double v = st->record[i].y - (double)(16 * y + 8) + st->fine[1][i];

            sum[0] += p[0];
            sum[1] += p[1] - u * p[0];
            sum[2] += p[2] - v * p[0];
            sum[3] += p[3] - 2 * u * p[1] + u * u * p[0];
            sum[4] += p[4] - u * p[2] - v * p[1] + u * v * p[0];
            sum[5] += p[5] - 2 * v * p[2] + v * v * p[0];
            for (int c = 0; c < C; c++)
                color[c] += p[MOMENTS + c];
        }
    for (int k = 0; k < MOMENTS; k++)
        out[k] = (float)sum[k];
    for (int c = 0; d_color && c < C; c++)
        d_color[i * (size_t)C + (size_t)c] += color[c];
}

/* q = top - (a dx^2 + b dx dy + c dy^2), dx = pixel - x; a = root^2, b = -2 a
 * sy, c = fall + a sy^2. */
VEC_INLINE void screen_backward(struct lanes *d, const vf m[16],
                                const vf r[FIELDS])
{
    vf along = r[FROOT] * r[FROOT] * (m[1] - r[FSY] * m[2]);

    d->top = m[0];
    d->x = along + along;
    d->y = vf_set(2) * (r[FFALL] * m[2] - r[FSY] * along);
    d->a = -m[3];
    d->b = -m[4];
    d->c = -m[5];
}

/* dL/dcov2d as S = (xx, xy, yy) with dL = S0 dxx + 2 S1 dxy + S2 dyy, from
 * (a, b, c) = log2e (A/2, B, C/2), conic K = cov^-1: S = -K G K.  K as
 * L^T L, L = (root, -root sy; 0, sqrt(fall)), which needles need. */
VEC_INLINE void cov_backward(vf S[3], const struct lanes *d, const vf r[16])
{
    vf sy = r[FSY], fall = r[FFALL], root = r[FROOT], flat = vf_sqrt(fall);
    vf f = vf_set(-2 / LOG2E), two = vf_set(2);
    vf mix = d->b - sy * d->c;
    vf h00 = root * root * (d->a - sy * (d->b + mix));
    vf h01 = root * flat * mix, h11 = fall * d->c;
    vf tilt = root * sy;

    S[0] = f * root * root * h00;
    S[1] = f * root * (flat * h01 - tilt * h00);
    S[2] = f * (tilt * tilt * h00 - two * tilt * flat * h01 + fall * h11);
}

VEC_INLINE void rotation(vf R[3][3], const vf q[4])
{
    vf w = q[0], x = q[1], y = q[2], z = q[3], one = vf_set(1);
    vf x2 = x + x, y2 = y + y, z2 = z + z;

    R[0][0] = one - y2 * y - z2 * z;
    R[1][0] = x2 * y + z2 * w;
    R[2][0] = x2 * z - y2 * w;
    R[0][1] = x2 * y - z2 * w;
    R[1][1] = one - x2 * x - z2 * z;
    R[2][1] = y2 * z + x2 * w;
    R[0][2] = x2 * z + y2 * w;
    R[1][2] = y2 * z - x2 * w;
    R[2][2] = one - x2 * x - y2 * y;
}

/* dL/dquat as given, from dL/dR; inverse = 1 / |quat|, along is removed. */
VEC_INLINE void quat_backward(vf out[4], vf dR[3][3], const vf q[4],
                              vf inverse, bool normalised)
{
    vf w = q[0], x = q[1], y = q[2], z = q[3], two = vf_set(2), d[4];
    vf s01 = dR[0][1] + dR[1][0], s02 = dR[0][2] + dR[2][0];
    vf s12 = dR[1][2] + dR[2][1], a12 = dR[2][1] - dR[1][2];
    vf a02 = dR[0][2] - dR[2][0], a01 = dR[1][0] - dR[0][1];

    d[0] = two * (x * a12 + y * a02 + z * a01);
    d[1] = two * (y * s01 + z * s02 + w * a12 -
                  two * x * (dR[1][1] + dR[2][2]));
    d[2] = two * (x * s01 + z * s12 + w * a02 -
                  two * y * (dR[0][0] + dR[2][2]));
    d[3] = two * (x * s02 + y * s12 + w * a01 -
                  two * z * (dR[0][0] + dR[1][1]));
    vf along = d[0] * w + d[1] * x + d[2] * y + d[3] * z;

    if (!normalised)
        along = vf_set(0);
    for (int k = 0; k < 4; k++)
        out[k] = (d[k] - along * q[k]) * inverse;
}

/* One screen axis: its row of J W was f / z (P[row] - u P[2]), its centre
 * f x / z + c. */
VEC_INLINE void axis_backward(struct lanes *d, vf dc[3], const vf dJ[3],
                              vf center, const vf c[3], float f, float lim,
                              const int row, const struct view *v)
{
    const float *P = v->rt;
    vf iz = vf_set(1) / c[2], u = c[row] * iz, du = vf_set(0);
    vf edge = vf_clamp(u, vf_set(-lim), vf_set(lim)), j = vf_set(f) * iz;
    vm inside = vf_ge(vf_set(lim), vf_abs(u));

    u = edge;
    for (int l = 0; l < 3; l++) {
        vf r = j * (vf_set(P[4 * row + l]) - u * vf_set(P[8 + l]));

        du = vf_fnma(j * vf_set(P[8 + l]), dJ[l], du);
        dc[2] = vf_fnma(r * iz, dJ[l], dc[2]);
        d->P[4 * row + l] += j * dJ[l];
        d->P[8 + l] -= j * u * dJ[l];
    }
    vf moving = vf_keep(inside, du);

    dc[row] += moving * iz;
    dc[2] -= (v->dgr ? du : moving) * u * iz;
    if (v->dgr)
        iz = vf_set(1) / (c[2] + vf_set(v->eps));
    j = vf_set(f) * iz;
    dc[row] += center * j;
    dc[2] -= center * j * c[row] * iz;
}

/* Where the centres are in front of the camera, from where the forward pass,
 * in double, has put them on the screen: near the camera float's z is not
 * good enough. */
VEC_INLINE void centers(vf c[3], const struct splat_state *st, size_t i,
                        const vf r[FIELDS])
{
    const struct view *v = &st->view;
    vf x = r[FX] - vf_set(v->cx) + vf_load(st->fine[0] + i);
    vf y = r[FY] - vf_set(v->cy) + vf_load(st->fine[1] + i);

    c[2] = vf_max(vf_load((const float *)st->key + i), vf_set(v->near));
    c[0] = x * c[2] / vf_set(v->fx);
    c[1] = y * c[2] / vf_set(v->fy);
}

VEC_INLINE void parameters(struct lanes *d, const struct splat_state *st,
                           size_t i, const vf S[3], const vf c[3])
{
    const struct view *v = &st->view;
    const float *P = v->rt;
    vf q[4], R[3][3], dR[3][3], m[3], J[2][3], dJ[2][3], dc[3];
    float f[2] = {v->fx, v->fy}, lim[2] = {v->limx, v->limy};

    for (int k = 0; k < 4; k++)
        q[k] = vf_load(st->cloud.quat[k] + i);
    for (int k = 0; k < 3; k++)
        m[k] = vf_load(st->cloud.mean[k] + i);
    rotation(R, q);
    for (int r = 0; r < 3; r++)
        dc[r] = dJ[0][r] = dJ[1][r] = vf_set(0);
    for (int r = 0; r < 2; r++)
        for (int l = 0; l < 3; l++) {
            vf u = vf_clamp(c[r] / c[2], vf_set(-lim[r]), vf_set(lim[r]));

            J[r][l] = vf_set(f[r]) / c[2] *
                      (vf_set(P[4 * r + l]) - u * vf_set(P[8 + l]));
        }
    for (int k = 0; k < 3; k++) {
        /* U = J W R diag(s), cov = U U^T + 0.3: dU = 2 S U */
        vf s = vf_load(st->cloud.scale[k] + i), U[2];

        for (int r = 0; r < 2; r++)
            U[r] = (J[r][0] * R[0][k] + J[r][1] * R[1][k] +
                    J[r][2] * R[2][k]) * s;
        vf d0 = vf_set(2) * (S[0] * U[0] + S[1] * U[1]);
        vf d1 = vf_set(2) * (S[1] * U[0] + S[2] * U[1]);

        d->scale[k] = vf_set(0);
        for (int l = 0; l < 3; l++) {
            vf da = J[0][l] * d0 + J[1][l] * d1, a = R[l][k] * s;

            dJ[0][l] += d0 * a;
            dJ[1][l] += d1 * a;
            d->scale[k] += da * R[l][k];
            dR[l][k] = da * s;
        }
    }
    quat_backward(d->quat, dR, q, vf_load(st->gradient->inverse_length + i),
                  !v->dgr);
    axis_backward(d, dc, dJ[0], d->x, c, f[0], lim[0], 0, v);
    axis_backward(d, dc, dJ[1], d->y, c, f[1], lim[1], 1, v);
    for (int l = 0; l < 3; l++)
        d->mean[l] = dc[0] * vf_set(P[l]) + dc[1] * vf_set(P[4 + l]) +
                     dc[2] * vf_set(P[8 + l]);
    for (int r = 0; r < 3; r++) {
        for (int l = 0; l < 3; l++)
            d->P[4 * r + l] += dc[r] * m[l];
        d->P[4 * r + 3] += dc[r];
    }
}

/* to (N, width) += lanes of v, where bits are set. */
static void add(float *to, const vf *v, size_t i, size_t width, uint32_t bits)
{
    float flat[4][VEC];

    if (!to)
        return;
    for (size_t k = 0; k < width; k++)
        vf_store(flat[k], v[k]);
    for (size_t n = 0; n < VEC; n++)
        for (size_t k = 0; (bits >> n & 1) && k < width; k++)
            to[(i + n) * width + k] += flat[k][n];
}

void ISA(splat_gaussian_backward)(const struct splat *s, size_t first,
                                  size_t last,
                                  const struct splat_gradients *g,
                                  double *rt)
{
    const struct splat_state *st = s->state;
    struct lanes d;

    for (int k = 0; k < 12; k++)
        d.P[k] = vf_set(0);
    for (size_t i = first; i < last; i += VEC) {
        float flat[VEC][VEC] = {{0}};
        vf m[VEC], r[VEC], S[3], c[3], before[12];
        uint32_t bits = 0;

        for (size_t k = 0; k < VEC && i + k < last; k++)
            if (st->key[i + k] != HIDDEN) {
                sum_pairs(flat[k], s, i + k, g->color);
                bits |= 1u << k;
            }
        if (!bits)
            continue;
        for (size_t k = 0; k < VEC; k++) {
            m[k] = vf_load(flat[k]);
            /* and half of the next, which is not looked at */
            r[k] = vf_load((const float *)&st->record[i + k]);
            if (!(bits >> k & 1))
                r[k] = vf_set(0);
        }
        vf_transpose(m);
        vf_transpose(r);
        screen_backward(&d, m, r);
        cov_backward(S, &d, r);
        memcpy(before, d.P, sizeof before);
        centers(c, st, i, r);
        parameters(&d, st, i, S, c);
        vm on = vm_from_bits(bits);

        for (int k = 0; k < 12; k++)
            d.P[k] = vf_sel(on, d.P[k], before[k]);
        /* top = log2 o */
        for (size_t k = 0; g->opacity && k < VEC; k++)
            if (bits >> k & 1)
                g->opacity[i + k] += d.top[k] * LOG2E *
                    __builtin_exp2f(-st->cloud.top[i + k]);
        add(g->mean, d.mean, i, 3, bits);
        add(g->scale, d.scale, i, 3, bits);
        add(g->quat, d.quat, i, 4, bits);
    }
    for (int k = 0; k < 12; k++)
        rt[k] = vf_sum(d.P[k]);
}
