/* Gaussians to screen ellipses by EWA splatting (the paper's preliminaries),
 * VEC at a time, and the tiles each may touch. */
#include "lib/splat/state.h"

#include <math.h>

#include "lib/base/isa.h"
#include "lib/base/simd_shuffle.h"

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last);

#define HALF_LOG2E (M_LOG2E / 2)

#define REAL vf
#define MASK vm
#define NAME(x) x
#define load(p) vf_load(p)
#define over(x, min) vf_gt(x, vf_set(min))
#define within(x, max) vf_clamp(x, vf_set(-(max)), vf_set(max))
#define pick(on, x) vf_sel(on, x, vf_set(1))
#define literal(x) ((float)(x))
#include "lib/splat/project_math.inc"

/* Half as many doubles, which are one register again. */
#define HALF (VEC / 2)
typedef double vd __attribute__((vector_size(8 * HALF), may_alias));
typedef int64_t vl __attribute__((vector_size(8 * HALF), may_alias));
typedef float vn __attribute__((vector_size(4 * HALF), may_alias));

/* on ? a : b */
VEC_INLINE vd select_double(vl on, vd a, vd b)
{
    return (vd)((on & (vl)a) | (~on & (vl)b));
}

/* Widened. */
VEC_INLINE vd load_double(const float *p)
{
    vn v;

    memcpy(&v, p, sizeof v);
    return __builtin_convertvector(v, vd);
}

/* Rounded to float, as what the kernels see. */
VEC_INLINE vd rounded(vd x)
{
    return __builtin_convertvector(__builtin_convertvector(x, vn), vd);
}

/* x within -max .. max */
VEC_INLINE vd within_double(vd x, float max)
{
    vd lo = (vd){0} - max, hi = (vd){0} + max;

    return select_double(x < lo, lo, select_double(x > hi, hi, x));
}

#define REAL vd
#define MASK vl
#define NAME(x) x##_double
#define over_double(x, min) (rounded(x) > (double)(min))
#define pick_double(on, x) select_double(on, x, (vd){0} + 1.0)
#define literal_double(x) (x)
#include "lib/splat/project_math.inc"

/* First and last pixel, along an axis of `size`, whose centre lies within
 * [c - r, c + r]; where there is one. */
VEC_INLINE vm project_pixels(vf *lo, vf *hi, vf c, vf r, int size)
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
    return some;
}

/* Fields by column to records. */
VEC_INLINE void project_store(struct splat_state *s, size_t i, vf f[FIELDS])
{
    float *to = (float *)&s->projection[i];

    /* after this, quad q of f[k] is half a record: of 4q + k, its first
     * four fields (k < 4), or of 4q + k - 4, its last */
    vf_transpose_quads(f);
    vf_transpose_quads(f + 4);
#pragma GCC unroll 4
    for (size_t k = 0; k < 4; k++) {
        vf_put_quads(to + FIELDS * k, 4 * FIELDS, f[k]);
        vf_put_quads(to + FIELDS * k + 4, 4 * FIELDS, f[k + 4]);
    }
}

/* The CUDA rasteriser's own choice of tiles. */
VEC_INLINE void project_dgr_rect(struct rect *out, float x, float y, float xx,
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
VEC_INLINE void project_place_fine(struct lanes *l, struct splat_state *s,
                                   size_t i)
{
    vf *to[] = {&l->x, &l->y, &l->z, &l->xx, &l->xy, &l->yy, &l->det,
                &l->falloff, &l->square, &l->sx, &l->sy};
    float narrow[11][VEC], ok[VEC];

    for (size_t part = 0; part < VEC; part += HALF) {
        struct lanes_double d;

        project_place_double(&d, s, i + part);
        const vd *from[] = {&d.x, &d.y, &d.z, &d.xx, &d.xy, &d.yy, &d.det,
                            &d.falloff, &d.square, &d.sx, &d.sy};

        for (int k = 0; k < 11; k++) {
            vn x = __builtin_convertvector(*from[k], vn);
            vd lost = *from[k] - __builtin_convertvector(x, vd);
            vn tail = __builtin_convertvector(lost, vn);

            memcpy(narrow[k] + part, &x, sizeof x);
            if (k < 3)
                memcpy(s->fine[k] + i + part, &tail, sizeof tail);
        }
        vn front = __builtin_convertvector(
            select_double(d.ok, (vd){0} + 1.0, (vd){0}), vn);

        memcpy(ok + part, &front, sizeof front);
    }
    for (int k = 0; k < 11; k++)
        *to[k] = vf_load(narrow[k]);
    l->ok = vf_gt(vf_load(ok), vf_set(0));
}

/* gaussian_more of Gaussians i and on. */
VEC_INLINE vf project_more(const struct splat_state *s, size_t i)
{
    const float *toward = s->view.place.toward;

    return vf_fma(vf_load(s->cloud.tilt[0] + i), vf_set(toward[0]),
                  vf_fma(vf_load(s->cloud.tilt[1] + i), vf_set(toward[1]),
                         vf_set(1)));
}

/* The confidence in what the photograph shows of them: seen times
 * gaussian_visible. */
VEC_INLINE vf project_confidence(const struct splat_state *s, size_t i,
                                 vf more)
{
    vf drawn = (vf_set(1) / vf_max(more, vf_set(1)) - GAUSSIAN_TORN) /
               (GAUSSIAN_DRAWN - GAUSSIAN_TORN);
    vf rotated = (more - GAUSSIAN_GONE) / (GAUSSIAN_ROTATED - GAUSSIAN_GONE);

    return vf_load(s->cloud.seen + i) *
           vf_clamp(vf_min(drawn, rotated), vf_set(0), vf_set(1));
}

/* splat_place_unrolled of Gaussians i and on. */
VEC_INLINE vf project_unrolled(const struct splat_state *s, size_t i,
                               float facing)
{
    const float *rt = s->view.rt;
    vf across = vf_set(0), toward = vf_set(0);

    for (int k = 0; k < 3; k++) {
        vf n = vf_load(s->cloud.normal[k] + i);

        across = vf_fma(n, vf_set(rt[k]), across);
        toward = vf_fma(n, vf_set(-rt[8 + k]), toward);
    }
    vf length = vf_sqrt(vf_fma(across, across, toward * toward));
    vm known = vf_gt(length, vf_set(0));
    vf cosine = vf_max(toward / vf_sel(known, length, vf_set(1)),
                       vf_set(SPLAT_PLACE_STEEPEST));

    return vf_keep(known, vf_set(1) - vf_set(facing) / cosine);
}

/* What the grain adds to row's place channels of Gaussians i and on, which the view
 * takes to `at` (2). */
VEC_INLINE void project_grain(vf row[SPLAT_PLACE_CHANNELS],
                              const struct splat_state *s, size_t i,
                              const struct splat_place_side *side,
                              const vf at[2])
{
    vm has = vf_gt(vf_load(s->cloud.around[0] + i),
                   vf_set(SPLAT_PLACE_NOWHERE)) &
             vf_gt(vf_set(SPLAT_PLACE_SLIGHT), row[2]);

    if (!vm_any(has))
        return;
    vf weight = vf_keep(has, vf_set(SPLAT_PLACE_GRAIN) *
                                 (vf_set(1) - row[2] / SPLAT_PLACE_SLIGHT));
    vf shorter = project_unrolled(s, i, side->facing);
    vf along = shorter * (vf_set(side->e[0]) * at[0] +
                          vf_set(side->e[1]) * at[1]);

    for (int k = 0; k < 2; k++)
        row[k] += vf_keep(has, weight * (vf_load(s->cloud.around[k] + i) -
                                         at[k] + along *
                                         vf_set(side->e[k])));
    row[2] += weight;
    row[3] += weight * shorter;
}

/* Place channels of Gaussians i and on (struct splat_place_view). */
VEC_INLINE void project_channels(struct splat_state *s, size_t i,
                                 const struct splat_place_side *side,
                                 const struct lanes *l, vf surface)
{
    const struct view *v = &s->view;
    vf x = l->x * vf_set(2 / (float)v->width) - vf_set(1);
    vf y = l->y * vf_set(2 / (float)v->height) - vf_set(1);
    vf confidence = project_confidence(s, i, surface), row[4], at[2];
    vf rise = surface - vf_set(1);      /* splat_place_shorter */
    vf shorter = rise / vf_max(vf_set(side->facing) + rise,
                               vf_set(SPLAT_PLACE_STEEPEST));
    vm seen = vf_gt(confidence, vf_set(0));
    const float *n = v->place.neck;
    vf share = vf_clamp(vf_fma(vf_set(n[0]), x,
                               vf_fma(vf_set(n[1]), y, vf_set(n[2]))),
                        vf_set(0), vf_set(1));

    for (int k = 0; k < 2; k++) {
        const float *A = v->place.A + 2 * k, *S = v->place.shoulders + 2 * k;
        at[k] = vf_fma(vf_set(A[0]), x,
                       vf_fma(vf_set(A[1]), y, vf_set(v->place.b[k])));
        vf more = vf_fma(vf_set(S[0]), x,
                         vf_fma(vf_set(S[1]), y,
                                vf_set(v->place.shoulders[4 + k])));

        at[k] = vf_fma(share, more, at[k]);
    }
    vf along = shorter * (vf_set(side->e[0]) * at[0] +
                          vf_set(side->e[1]) * at[1]);
    /* a centre may be anywhere where nothing was seen of it */
    for (int k = 0; k < 2; k++)
        row[k] = vf_keep(seen, confidence * (vf_load(s->cloud.uv[k] + i) -
                                             at[k] + along *
                                             vf_set(side->e[k])));
    row[2] = confidence;
    row[3] = vf_keep(seen, confidence * shorter);
    if (s->grained)
        project_grain(row, s, i, side, at);
    vf_put_rows(s->place[i], row, 4);
}

/* The tiles of VEC Gaussians from i on by the rules of dgr; a Gaussian that has
 * none is hidden. */
VEC_INLINE void project_dgr_rects(struct splat_state *s, size_t i,
                                  const struct lanes *l)
{
    for (size_t k = 0; k < VEC; k++) {
        struct rect *r = &s->rect[i + k];

        if (s->key[i + k] == HIDDEN)
            continue;
        project_dgr_rect(r, l->x[k], l->y[k], l->xx[k], l->yy[k], l->det[k],
                         &s->view);
        if (r->x0 >= r->x1 || r->y0 >= r->y1)
            s->key[i + k] = HIDDEN;
    }
}

void ISA(splat_project)(struct splat_state *s, size_t first, size_t last)
{
    const struct view *v = &s->view;
    const struct splat_place_side side = splat_place_side(&v->place);
    const vf zero = vf_set(0), big = vf_set(1e36f);

    for (size_t i = first; i < last; i += VEC) {
        struct lanes l;
        vf row[FIELDS], x0, x1, y0, y1;

        if (s->fine[0])
            project_place_fine(&l, s, i);
        else
            project_place(&l, s, i);
        /* beyond float's range a Gaussian is flat over any picture */
        vm sane = vf_gt(big, l.det);
        vf top = vf_load(s->cloud.top + i), surface = vf_set(1);
        if (s->place) {
            surface = project_more(s, i);
            top -= vf_load(s->cloud.thin + i) *         /* gaussian_halved */
                   vf_max(surface - vf_set(1 / GAUSSIAN_DRAWN), zero);
        }
        vf room = top - vf_set(v->cut);
        vf reach = vf_max(room, zero) * vf_set(2 / (float)M_LOG2E * 1.0002f);
        vf rx = vf_sqrt(reach * vf_min(l.xx, big)) + vf_set(2e-3f);
        vf ry = vf_sqrt(reach * vf_min(l.yy, big)) + vf_set(2e-3f);

        row[FX] = l.x;
        row[FY] = l.y;
        row[FTOP] = top;
        row[FFALLOFF] = vf_keep(sane, l.falloff);
        row[FSX] = vf_keep(sane, l.sx);
        row[FSY] = vf_keep(sane, l.sy);
        row[FWIDE] = rx;
        row[FROOT] = vf_sqrt(vf_keep(sane, l.square));
        vm ok = l.ok & vf_ge(room, zero);

        ok &= project_pixels(&x0, &x1, l.x, rx, v->width);
        ok &= project_pixels(&y0, &y1, l.y, ry, v->height);
        vi tx0 = vf_round(x0) >> 4, tx1 = (vf_round(x1) >> 4) + 1;
        vi ty0 = vf_round(y0) >> 4, ty1 = (vf_round(y1) >> 4) + 1;

        vi_store(&s->key[i], (vi)vf_sel(ok, l.z, (vf)vi_set(-1)));
        if (s->place)
            project_channels(s, i, &side, &l, surface);
        vi_put_pairs(&s->rect[i], tx0 | tx1 << 16, ty0 | ty1 << 16);
        if (v->dgr)
            project_dgr_rects(s, i, &l);
        project_store(s, i, row);
    }
}
