/* From sums on the screen to the parameters of the Gaussians, VEC at a time:
 * the chain rule through the EWA projection, backwards. */
#include <string.h>

#include "lib/base/isa.h"
#include "lib/splat/backward.h"
#include "lib/base/simd_shuffle.h"

#define LN2 ((float)M_LN2)
#define AHEAD 24               /* pairs fetched early */

void ISA(splat_gaussian_backward)(const struct splat *s, size_t first,
                                  size_t last,
                                  const struct splat_gradients *g,
                                  double *rt);

/* dL of VEC Gaussians. */
struct lanes {
    vf x, y, a, b, c;          /* of the screen record ... */
    vf top;                    /* ... and of log opacity */
    vf mean[3], scale[3], quat[4];
    vf P[12];                  /* of [R|t], summed over all */
};

/* First pair of a Gaussian. */
static size_t gradient_first_pair(const struct splat *s, size_t i)
{
    struct rect r = s->state->rect[i];
    struct pair_range p;

    if (i >= s->n)
        return s->pairs;
    p = s->state->gradient->range[i];
    return (uint32_t)(p.origin + r.y0 * p.across + r.x0);
}

/* Add up the pairs of VEC Gaussians, `stride` numbers each: of Gaussian i + k
 * into row k + 1 of out, pairs that nothing was written to into row 0. */
VEC_INLINE void gradient_sum_pairs(float *out, const struct splat *s, size_t i,
                                   const size_t stride)
{
    const struct splat_gradient_state *b = s->state->gradient;
    size_t end = gradient_first_pair(s, i + VEC);

    memset(out, 0, (VEC + 1) * stride * sizeof *out);
    for (size_t at = gradient_first_pair(s, i); at < end; at++) {
        const float *pair = b->pair + at * stride;
        float *to = out + b->seen[at] * stride;

        __builtin_prefetch(pair + AHEAD * stride);
        for (size_t k = 0; k < stride; k += VEC)
            vf_store(to + k, vf_load(to + k) + vf_load(pair + k));
    }
}

/* q = top - (a dx^2 + b dx dy + c dy^2), dx = pixel - x; a = root^2, b = -2 a
 * sy, c = falloff + a sy^2.  The sums are of d log alpha = ln 2 dq. */
VEC_INLINE void gradient_of_screen(struct lanes *d, const vf m[16],
                                   const vf r[FIELDS])
{
    vf x = vf_set(LN2) * m[MOMENT(1, 0)], y = vf_set(LN2) * m[MOMENT(0, 1)];
    vf along = r[FROOT] * r[FROOT] * (x - r[FSY] * y);

    d->top = m[MOMENT(0, 0)];
    d->x = along + along;
    d->y = vf_set(2) * (r[FFALLOFF] * y - r[FSY] * along);
    d->a = -vf_set(LN2) * m[MOMENT(2, 0)];
    d->b = -vf_set(LN2) * m[MOMENT(1, 1)];
    d->c = -vf_set(LN2) * m[MOMENT(0, 2)];
}

/* dL/dcov2d as S = (xx, xy, yy) with dL = S0 dxx + 2 S1 dxy + S2 dyy, from
 * (a, b, c) = log2e (A/2, B, C/2), conic K = cov^-1: S = -K G K.  K as
 * L^T L, L = (root, -root sy; 0, sqrt(falloff)), which needles need. */
VEC_INLINE void gradient_of_cov(vf S[3], const struct lanes *d,
                                const vf r[FIELDS])
{
    vf sy = r[FSY], falloff = r[FFALLOFF], root = r[FROOT];
    vf flat = vf_sqrt(falloff);
    vf f = vf_set(-2 / (float)M_LOG2E), two = vf_set(2);
    vf mix = d->b - sy * d->c;
    vf h00 = root * root * (d->a - sy * (d->b + mix));
    vf h01 = root * flat * mix, h11 = falloff * d->c;
    vf tilt = root * sy;

    S[0] = f * root * root * h00;
    S[1] = f * root * (flat * h01 - tilt * h00);
    S[2] = f * (tilt * tilt * h00 - two * tilt * flat * h01 + falloff * h11);
}

/* R of normalised quaternions. */
VEC_INLINE void gradient_rotation(vf R[3][3], const vf q[4])
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
VEC_INLINE void gradient_of_quat(vf out[4], vf dR[3][3], const vf q[4],
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
VEC_INLINE void gradient_of_axis(struct lanes *d, vf dc[3], const vf dJ[3],
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
VEC_INLINE void gradient_centers(vf c[3], const struct splat_state *st,
                                 size_t i, const vf r[FIELDS])
{
    const struct view *v = &st->view;
    vf x = r[FX] - vf_set(v->cx) + vf_load(st->fine[0] + i);
    vf y = r[FY] - vf_set(v->cy) + vf_load(st->fine[1] + i);

    c[2] = vf_max(vf_load((const float *)st->key + i), vf_set(v->near));
    c[0] = x * c[2] / vf_set(v->fx);
    c[1] = y * c[2] / vf_set(v->fy);
}

/* dL of mean, scale, quat and camera from that of the screen covariance (S) and
 * of the centre (d->x, d->y): cov = U U^T + 0.3 with U = J W R diag(s). */
VEC_INLINE void gradient_of_parameters(struct lanes *d,
                                       const struct splat_state *st, size_t i,
                                       const vf S[3], const vf c[3])
{
    const struct view *v = &st->view;
    const float *P = v->rt;
    vf q[4], R[3][3], dR[3][3], m[3], J[2][3], dJ[2][3], dc[3];
    float f[2] = {v->fx, v->fy}, lim[2] = {v->limx, v->limy};

    for (int k = 0; k < 4; k++)
        q[k] = vf_load(st->cloud.quat[k] + i);
    for (int k = 0; k < 3; k++)
        m[k] = vf_load(st->cloud.mean[k] + i);
    gradient_rotation(R, q);
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
    gradient_of_quat(d->quat, dR, q, vf_load(st->gradient->inverse_length + i),
                     !v->dgr);
    gradient_of_axis(d, dc, dJ[0], d->x, c, f[0], lim[0], 0, v);
    gradient_of_axis(d, dc, dJ[1], d->y, c, f[1], lim[1], 1, v);
    for (int l = 0; l < 3; l++)
        d->mean[l] = dc[0] * vf_set(P[l]) + dc[1] * vf_set(P[4 + l]) +
                     dc[2] * vf_set(P[8 + l]);
    for (int r = 0; r < 3; r++) {
        for (int l = 0; l < 3; l++)
            d->P[4 * r + l] += dc[r] * m[l];
        d->P[4 * r + 3] += dc[r];
    }
}

/* Places pull at the centre (r), through what the view makes of it: dplace are
 * the channels' gradients, c and c s what splat_project left there (struct
 * splat_place_view). */
VEC_INLINE void gradient_of_place(struct lanes *d, const vf dplace[2],
                                  const struct splat_state *st, size_t i,
                                  const vf r[FIELDS])
{
    const struct view *v = &st->view;
    const float *A = v->place.A, *S = v->place.shoulders, *n = v->place.neck;
    const vf x = r[FX] * vf_set(2 / (float)v->width) - vf_set(1);
    const vf y = r[FY] * vf_set(2 / (float)v->height) - vf_set(1);
    const vf zero = vf_set(0), one = vf_set(1);
    const vf share = vf_set(n[0]) * x + vf_set(n[1]) * y + vf_set(n[2]);
    const vm part = vf_gt(share, zero) & vf_gt(one, share);
    const struct splat_place_side side = splat_place_side(&v->place);
    const vf e[2] = {vf_set(side.e[0]), vf_set(side.e[1])};
    vf J[4];
    float kept[2][VEC];

    /* splat_place_slope */
    for (int k = 0; k < 4; k++) {
        const float *row = S + k / 2 * 2;
        const vf more = vf_set(row[0]) * x + vf_set(row[1]) * y +
                        vf_set(S[4 + k / 2]);

        J[k] = vf_set(A[k]) + vf_clamp(share, zero, one) * vf_set(S[k]) +
               vf_keep(part, more * vf_set(n[k % 2]));
    }
    for (size_t k = 0; k < VEC; k++)
        for (int q = 0; q < 2; q++)
            kept[q][k] = st->place[i + k][2 + q];
    vf confidence = vf_load(kept[0]);
    vf along = vf_load(kept[1]) * (e[0] * dplace[0] + e[1] * dplace[1]);
    vf u = confidence * dplace[0] - along * e[0];
    vf w = confidence * dplace[1] - along * e[1];

    d->x -= vf_set(2 / (float)v->width) * (J[0] * u + J[2] * w);
    d->y -= vf_set(2 / (float)v->height) * (J[1] * u + J[3] * w);
}

/* VEC Gaussians of those drawn, i and on; `left` of them are in the arrays. */
struct drawn {
    size_t i, left;
    vm on;
};

/* to (N, width) += lanes of v, of those that are drawn. */
VEC_INLINE void gradient_add(float *to, const vf *v, const size_t width,
                             const struct drawn *d)
{
    float flat[4 * VEC];
    vf row[4];

    if (!to)
        return;
    to += d->i * width;
    for (size_t k = 0; k < width; k++)
        row[k] = vf_keep(d->on, v[k]);
    vf_put_rows(flat, row, width);
    if (d->left >= VEC) {
        for (size_t k = 0; k < width; k++)
            vf_store(to + VEC * k, vf_load(to + VEC * k) +
                     vf_load(flat + VEC * k));
        return;
    }
    for (size_t k = 0; k < d->left * width; k++)
        to[k] += flat[k];
}

/* dL/dcolor of Gaussian i and on: up to three channels from the transposed
 * sums m, more from behind the sums. */
static void gradient_add_colors(float *to, const struct splat *s,
                                const vf m[16], const float *sum,
                                const struct drawn *d)
{
    size_t C = (size_t)s->opt.channels, row = (size_t)s->state->row;
    vf rgb[3] = {m[GRAD_COLOR(0)], m[GRAD_COLOR(1)], m[GRAD_COLOR(2)]};

    if (!to)
        return;
    if (!row) {
        if (C == 3)
            gradient_add(to, rgb, 3, d);
        else
            gradient_add(to, rgb, C, d);
        return;
    }
    for (size_t n = 0; n < VEC && n < d->left; n++) {
        const float *from = sum + (1 + n) * (16 + row) + 16;

        for (size_t c = 0; c < C; c++)
            to[(d->i + n) * C + c] += from[c];
    }
}

/* All Gaussians of first .. last - 1.  Compiled apart for places: a branch in
 * between would change which products the compiler fuses with sums. */
VEC_INLINE void gradient_of_gaussians(const struct splat *s, size_t first,
                                      size_t last,
                                      const struct splat_gradients *g,
                                      double *rt, const bool places)
{
    const struct splat_state *st = s->state;
    const size_t stride = 16 + (size_t)st->row;
    struct lanes d;

    for (int k = 0; k < 12; k++)
        d.P[k] = vf_set(0);
    for (size_t i = first; i < last; i += VEC) {
        float sum[3 * 16 * (VEC + 1)];
        const float *pair[VEC], *record[VEC];
        vf m[16], r[FIELDS], S[3], c[3], before[12];
        /* the key of a hidden one is no number */
        vm on = vf_gt(vf_load((const float *)&st->key[i]), vf_set(0));
        struct drawn here = {i, last - i, on};

        if (!vm_any(on))
            continue;
        gradient_sum_pairs(sum, s, i, stride);
        for (size_t k = 0; k < VEC; k++) {
            pair[k] = sum + (1 + k) * stride;
            record[k] = (const float *)&st->projection[i + k];
        }
        vf_columns(m, pair, 4);
        vf_columns(r, record, 2);
        for (int k = 0; k < FIELDS; k++)
            r[k] = vf_keep(on, r[k]);
        gradient_of_screen(&d, m, r);
        if (places) {
            vf place[SPLAT_PLACE_CHANNELS] = {
                m[GRAD_COLOR(0)], m[GRAD_COLOR(1)], m[GRAD_COLOR(2)],
                m[GRAD_COLOR(3)]};

            gradient_of_place(&d, place, st, i, r);
            gradient_add(g->place, place, SPLAT_PLACE_CHANNELS, &here);
        }
        gradient_of_cov(S, &d, r);
        memcpy(before, d.P, sizeof before);
        gradient_centers(c, st, i, r);
        gradient_of_parameters(&d, st, i, S, c);
        for (int k = 0; k < 12; k++)
            d.P[k] = vf_sel(on, d.P[k], before[k]);
        d.top *= vf_load(st->gradient->inverse_opacity + i);
        gradient_add(g->opacity, &d.top, 1, &here);
        gradient_add(g->mean, d.mean, 3, &here);
        gradient_add(g->scale, d.scale, 3, &here);
        gradient_add(g->quat, d.quat, 4, &here);
        gradient_add_colors(g->color, s, m, sum, &here);
    }
    for (int k = 0; k < 12; k++)
        rt[k] = vf_sum(d.P[k]);
}

void ISA(splat_gaussian_backward)(const struct splat *s, size_t first,
                                  size_t last,
                                  const struct splat_gradients *g,
                                  double *rt)
{
    if (s->state->gradient->pulled)
        gradient_of_gaussians(s, first, last, g, rt, true);
    else
        gradient_of_gaussians(s, first, last, g, rt, false);
}
