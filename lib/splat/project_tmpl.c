/* Gaussians to screen ellipses, 16 at a time. */
#include "lib/splat/state.h"

#include <math.h>

#include "lib/base/isa.h"
#include "lib/splat/vec.h"

#define LOG2E 1.44269504f

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last);

#define HALF_LOG2E 0.72134752044448170368

#define REAL vf
#define NAME(x) x
#define load(p) vf_load(p)
#define narrow(x) (x)
#define within(x, most) vf_clamp(x, vf_set(-(most)), vf_set(most))
#define pick(on, x) vf_sel(on, x, vf_set(1))
#define literal(x) ((float)(x))
#include "lib/splat/project_math.inc"

typedef double vd __attribute__((vector_size(128), may_alias));

#define REAL vd
#define NAME(x) x##_double
#define load_double(p) __builtin_convertvector(vf_load(p), vd)
#define narrow_double(x) __builtin_convertvector(x, vf)
#define literal_double(x) (x)

/* x within -most .. most */
VEC_INLINE vd within_double(vd x, float most)
{
    for (int k = 0; k < VEC; k++)
        x[k] = x[k] < -most ? -most : x[k] > most ? most : x[k];
    return x;
}

/* x where on, else 1 */
VEC_INLINE vd pick_double(vm on, vd x)
{
    uint32_t bits = vm_bits(on);

    for (int k = 0; k < VEC; k++)
        x[k] = bits >> k & 1 ? x[k] : 1;
    return x;
}

#include "lib/splat/project_math.inc"

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

VEC_INLINE void store_records(struct splat_state *s, size_t i, vf f[FIELDS])
{
    float *to = (float *)&s->record[i];

    /* after this, quad q of f[k] is half a record: of 4q + k, its first
     * four fields (k < 4), or of 4q + k - 4, its last */
    vf_transpose_quads(f);
    vf_transpose_quads(f + 4);
#ifdef ISA_AVX512
    for (int k = 0; k < 4; k++) {
        __m512 a = (__m512)f[k], b = (__m512)f[k + 4];

#define PUT(q) _mm256_storeu_ps(to + FIELDS * (4 * q + k), \
            _mm256_insertf128_ps(_mm256_castps128_ps256( \
                _mm512_extractf32x4_ps(a, q)), _mm512_extractf32x4_ps(b, q), 1))
        PUT(0);
        PUT(1);
        PUT(2);
        PUT(3);
#undef PUT
    }
#else
    for (int k = 0; k < 8; k++)
        for (int q = 0; q < 4; q++)
            memcpy(to + FIELDS * (4 * q + k % 4) + k / 4 * 4,
                   (const char *)&f[k] + 16 * q, 16);
#endif
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

/* The same from double, with what float loses of place and depth. */
static void place_fine(struct lanes *l, struct splat_state *s, size_t i)
{
    struct lanes_double d;

    place_double(&d, s, i);
    const vd *from[] = {&d.x, &d.y, &d.z, &d.xx, &d.xy, &d.yy, &d.det,
                        &d.fall, &d.square, &d.sx, &d.sy};
    vf *to[] = {&l->x, &l->y, &l->z, &l->xx, &l->xy, &l->yy, &l->det,
                &l->fall, &l->square, &l->sx, &l->sy};

    for (int k = 0; k < 11; k++) {
        *to[k] = __builtin_convertvector(*from[k], vf);
        if (k < 3)
            vf_store(s->fine[k] + i, __builtin_convertvector(
                *from[k] - __builtin_convertvector(*to[k], vd), vf));
    }
    l->ok = d.ok;
}

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last)
{
    const struct view *v = &s->view;
    const vf zero = vf_set(0), big = vf_set(1e36f);

    for (size_t i = first; i < last; i += VEC) {
        struct lanes l;
        vf row[FIELDS], x0, x1, y0, y1;

        if (s->fine[0])
            place_fine(&l, s, i);
        else
            place(&l, s, i);
        /* beyond float's range a Gaussian is flat over any picture */
        vm sane = vf_gt(big, l.det);
        vf top = vf_load(s->cloud.top + i), room = top - vf_set(v->cut);
        vf reach = vf_max(room, zero) * vf_set(2 / LOG2E * 1.0002f);
        vf rx = vf_sqrt(reach * vf_min(l.xx, big)) + vf_set(2e-3f);
        vf ry = vf_sqrt(reach * vf_min(l.yy, big)) + vf_set(2e-3f);

        row[FX] = l.x;
        row[FY] = l.y;
        row[FTOP] = top;
        row[FFALL] = vf_keep(sane, l.fall);
        row[FSX] = vf_keep(sane, l.sx);
        row[FSY] = vf_keep(sane, l.sy);
        row[FWIDE] = rx;
        row[FROOT] = vf_sqrt(vf_keep(sane, l.square));
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
        store_records(s, i, row);
    }
}
