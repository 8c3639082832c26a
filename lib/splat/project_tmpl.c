/* Gaussians to screen ellipses, 16 at a time. */
#include "lib/splat/state.h"

#include <math.h>

#include "lib/base/isa.h"
#include "lib/splat/vec.h"

#define LOG2E 1.44269504f

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last,
                        size_t n);

/* Sixteen Gaussians on their way to the screen. */
struct lanes {
    vf x, y, z;                /* camera, then pixels and depth */
    vf xx, xy, yy, det;        /* covariance with the 0.3 */
    vm ok;
};

/* Columns of R(q) diag(s): m[row][column]. */
VEC_INLINE void factor(vf m[3][3], const struct cloud *c, size_t i)
{
    vf w = vf_load(c->quat[0] + i), x = vf_load(c->quat[1] + i);
    vf y = vf_load(c->quat[2] + i), z = vf_load(c->quat[3] + i);
    vf s0 = vf_load(c->scale[0] + i), s1 = vf_load(c->scale[1] + i);
    vf s2 = vf_load(c->scale[2] + i), one = vf_set(1), two = vf_set(2);
    vf x2 = two * x, y2 = two * y, z2 = two * z;

    m[0][0] = (one - y2 * y - z2 * z) * s0;
    m[1][0] = (x2 * y + z2 * w) * s0;
    m[2][0] = (x2 * z - y2 * w) * s0;
    m[0][1] = (x2 * y - z2 * w) * s1;
    m[1][1] = (one - x2 * x - z2 * z) * s1;
    m[2][1] = (y2 * z + x2 * w) * s1;
    m[0][2] = (x2 * z + y2 * w) * s2;
    m[1][2] = (y2 * z - x2 * w) * s2;
    m[2][2] = (one - x2 * x - y2 * y) * s2;
}

/* cov2d = J W Sigma W^T J^T + 0.3, its determinant without cancellation. */
VEC_INLINE void ellipse(struct lanes *l, const vf m[3][3],
                        const struct view *v, vf iz)
{
    const float *P = v->rt;
    vf u = vf_clamp(l->x * iz, vf_set(-v->limx), vf_set(v->limx));
    vf t = vf_clamp(l->y * iz, vf_set(-v->limy), vf_set(v->limy));
    vf jx = vf_set(v->fx) * iz, jy = vf_set(v->fy) * iz, a[3], b[3];

    for (int k = 0; k < 3; k++)
        a[k] = b[k] = vf_set(0);
    for (int r = 0; r < 3; r++) {
        vf wx = jx * (vf_set(P[r]) - u * vf_set(P[8 + r]));
        vf wy = jy * (vf_set(P[4 + r]) - t * vf_set(P[8 + r]));

        for (int k = 0; k < 3; k++) {
            a[k] = vf_fma(wx, m[r][k], a[k]);
            b[k] = vf_fma(wy, m[r][k], b[k]);
        }
    }
    vf c0 = a[1] * b[2] - a[2] * b[1], c1 = a[2] * b[0] - a[0] * b[2];
    vf c2 = a[0] * b[1] - a[1] * b[0];
    vf xx = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
    vf yy = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];

    l->xy = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    l->det = c0 * c0 + c1 * c1 + c2 * c2 + vf_set(0.3f) * (xx + yy) +
             vf_set(0.09f);
    l->xx = xx + vf_set(0.3f);
    l->yy = yy + vf_set(0.3f);
}

VEC_INLINE void place(struct lanes *l, vf m[3][3], const struct splat_state *s,
                      size_t i)
{
    const struct view *v = &s->view;
    const float *P = v->rt;
    vf x = vf_load(s->cloud.mean[0] + i), y = vf_load(s->cloud.mean[1] + i);
    vf z = vf_load(s->cloud.mean[2] + i);

#define ROW(r) (vf_set(P[4 * r]) * x + vf_set(P[4 * r + 1]) * y + \
                (vf_set(P[4 * r + 2]) * z + vf_set(P[4 * r + 3])))
    l->x = ROW(0);
    l->y = ROW(1);
    l->z = ROW(2);
#undef ROW
    l->ok = vf_gt(l->z, vf_set(v->near));
    vf deep = vf_sel(l->ok, l->z, vf_set(1)), iz = vf_set(1) / deep;

    factor(m, &s->cloud, i);
    ellipse(l, m, v, iz);
    if (v->dgr)
        iz = vf_set(1) / (deep + vf_set(v->eps));
    l->x = vf_fma(vf_set(v->fx) * l->x, iz, vf_set(v->cx));
    l->y = vf_fma(vf_set(v->fy) * l->y, iz, vf_set(v->cy));
}

/* First tile and one past the last, along one axis, of pixel centres within
 * [c - r, c + r]. */
VEC_INLINE vm tiles(vf *lo, vf *hi, vf c, vf r, int size, int count)
{
    vf p = vf_clamp(c - r, vf_set(-1), vf_set((float)size));
    vf q = vf_clamp(c + r, vf_set(-1), vf_set((float)size));
    vf half = vf_set(0.5f);

    p = __builtin_convertvector(vf_round(p), vf);        /* ceil(p - 1/2) */
    q = __builtin_convertvector(vf_round(q - half - half), vf);
    p = vf_max(p, vf_set(0));
    q = vf_min(q, vf_set((float)(size - 1)));
    vm some = vf_ge(q, p);

    *lo = p;
    *hi = q;
    (void)count;
    return some;
}

/* The first 12 floats of 16 records; the colours behind them stay. */
VEC_INLINE void store_record(struct splat_state *s, size_t i, vf row[16])
{
    vf_transpose(row);
    for (size_t k = 0; k < 16; k++) {
#ifdef ISA_AVX512
        _mm512_mask_storeu_ps(&s->record[i + k], 0x0fff, (__m512)row[k]);
#else
        memcpy(&s->record[i + k], &row[k], 12 * sizeof(float));
#endif
    }
}

/* The CUDA rasteriser's own choice of tiles. */
VEC_INLINE void dgr_rect(struct rect *out, float x, float y, float xx,
                         float yy, float det, const struct view *v)
{
    float mid = 0.5f * (xx + yy);
    float r = ceilf(3 * sqrtf(mid + sqrtf(fmaxf(0.1f, mid * mid - det))));
    float c[2] = {x - 0.5f, y - 0.5f};
    float last[2] = {(float)v->tx, (float)v->ty};
    uint16_t t[4];

    for (int k = 0; k < 2; k++) {
        t[2 * k] = (uint16_t)fminf(fmaxf((c[k] - r) / 16, 0), last[k]);
        t[2 * k + 1] =
            (uint16_t)fminf(fmaxf((c[k] + r + 15) / 16, 0), last[k]);
    }
    *out = (struct rect){t[0], t[1], t[2], t[3]};
}

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last,
                        size_t n)
{
    const struct view *v = &s->view;
    const vf zero = vf_set(0), big = vf_set(1e36f);

    (void)n;                   /* arrays are padded to whole vectors */

    for (size_t i = first; i < last; i += VEC) {
        struct lanes l;
        vf m[3][3], row[16], x0, x1, y0, y1;

        place(&l, m, s, i);
        /* beyond float's range a Gaussian is flat over any picture */
        vm sane = vf_gt(big, l.det);
        vf inv = vf_set(1) / vf_sel(sane, l.det, vf_set(1));
        vf top = vf_load(s->cloud.top + i), room = top - vf_set(v->cut);
        vf scale = vf_set(0.5f * LOG2E) * inv;
        vf reach = vf_max(room, zero) * vf_set(2 / LOG2E * 1.0002f);
        vf rx = vf_sqrt(reach * vf_min(l.xx, big)) + vf_set(2e-3f);
        vf ry = vf_sqrt(reach * vf_min(l.yy, big)) + vf_set(2e-3f);

        row[0] = l.x;
        row[1] = l.y;
        row[2] = vf_keep(sane, scale * l.yy);
        row[3] = vf_keep(sane, vf_set(-2) * scale * l.xy);
        row[4] = vf_keep(sane, scale * l.xx);
        row[5] = top;
        row[6] = vf_keep(sane, l.xy / l.xx);     /* -b / 2c */
        row[7] = vf_keep(sane, l.xy / l.yy);     /* -b / 2a */
        row[8] = l.z;
        row[9] = vf_keep(sane, vf_set(0.5f * LOG2E) / l.yy);
        row[10] = vf_sqrt(row[2]);
        for (int k = 11; k < 16; k++)
            row[k] = zero;
        vm ok = vm_and(l.ok, vf_ge(room, zero));

        ok = vm_and(ok, tiles(&x0, &x1, l.x, rx, v->width, v->tx));
        ok = vm_and(ok, tiles(&y0, &y1, l.y, ry, v->height, v->ty));
        vi tx0 = vf_round(x0) >> 4, tx1 = (vf_round(x1) >> 4) + 1;
        vi ty0 = vf_round(y0) >> 4, ty1 = (vf_round(y1) >> 4) + 1;
        int32_t across[VEC], down[VEC];

        vi_store(&s->key[i], (vi)vf_sel(ok, l.z, (vf)vi_set(-1)));
        vi_store(across, tx0 | tx1 << 16);
        vi_store(down, ty0 | ty1 << 16);
        for (size_t k = 0; k < VEC; k++) {
            memcpy(&s->rect[i + k].x0, &across[k], sizeof across[k]);
            memcpy(&s->rect[i + k].y0, &down[k], sizeof down[k]);
        }
        for (size_t k = 0; v->dgr && k < VEC; k++) {
            struct rect *r = &s->rect[i + k];

            if (s->key[i + k] == HIDDEN)
                continue;
            dgr_rect(r, l.x[k], l.y[k], l.xx[k], l.yy[k], l.det[k], v);
            if (r->x0 >= r->x1 || r->y0 >= r->y1)
                s->key[i + k] = HIDDEN;
        }
        store_record(s, i, row);
    }
}
