/* The inner loops of photometric alignment: the picture's levels and slopes,
 * what points show in it, and Gauss-Newton's sums over them.  Positions and
 * levels are floats, a block's sums are added up as doubles. */
#include "lib/track/align_kernel.h"

#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/simd_shuffle.h"

#define N ALIGN_SIDE
#define BORDER 2                /* of a line: the blur's reach */

_Static_assert(N % VEC == 0, "a line is a number of vectors");

/* ---- the picture --------------------------------------------------------- */

/* line (N + 2 BORDER) = a row whose ends go on. */
VEC_INLINE void align_line(float *line, const float *row)
{
    memcpy(line + BORDER, row, N * sizeof *row);
    for (int i = 0; i < BORDER; i++) {
        line[i] = row[0];
        line[N + BORDER + i] = row[N - 1];
    }
}

/* Row y, clamped inside. */
VEC_INLINE const float *align_row(const float *plane, ptrdiff_t y)
{
    return plane + N * (y < 0 ? 0 : y >= N ? N - 1 : y);
}

/* Binomial weights (1 4 6 4 1) / 16. */
VEC_INLINE vf align_binomial(const float *a, const float *b, const float *c,
                             const float *d, const float *e)
{
    return (6 * vf_load(c) + 4 * (vf_load(b) + vf_load(d)) +
            (vf_load(a) + vf_load(e))) * (1.0f / 16);
}

/* out = in, blurred along both axes; in is lost. */
static void align_blur(float *out, float *in)
{
    float line[N + 2 * BORDER];

    for (size_t y = 0; y < N; y++) {
        align_line(line, in + N * y);
        for (const float *p = line; p < line + N; p += VEC)
            vf_store(in + N * y + (p - line),
                     align_binomial(p, p + 1, p + 2, p + 3, p + 4));
    }
    for (ptrdiff_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x += VEC)
            vf_store(out + N * y + x,
                     align_binomial(align_row(in, y - 2) + x,
                                    align_row(in, y - 1) + x,
                                    align_row(in, y) + x,
                                    align_row(in, y + 1) + x,
                                    align_row(in, y + 2) + x));
}

/* A row of grey levels from two of rgb. */
static void align_grey(float *grey, const float *rgb)
{
    float sum[6 * N];

    for (size_t i = 0; i < 6 * N; i++)
        sum[i] = rgb[i] + rgb[6 * N + i];
    for (size_t x = 0; x < N; x++) {
        const float *p = sum + 6 * x;

        grey[x] = (p[0] + p[1] + p[2] + p[3] + p[4] + p[5]) * (255.0f / 12);
    }
}

static void ISA(align_picture)(align_pixel *picture, float *work,
                               const float *rgb)
{
    float *grey = work, line[N + 2 * BORDER];

    for (size_t y = 0; y < N; y++)
        align_grey(grey + N * y, rgb + 12 * N * y);
    align_blur(work + N * N, grey);
    align_blur(grey, work + N * N);
    for (ptrdiff_t y = 0; y < N; y++) {
        align_line(line, grey + N * y);
        for (size_t x = 0; x < N; x += VEC) {
            const float *p = line + BORDER + x;
            const vf level[4] = {
                vf_load(p), 0.5f * (vf_load(p + 1) - vf_load(p - 1)),
                0.5f * (vf_load(align_row(grey, y + 1) + x) -
                        vf_load(align_row(grey, y - 1) + x)), vf_set(0)};

            vf_put_rows((float *)(picture + N * y + x), level, 4);
        }
    }
}

/* ---- points in it -------------------------------------------------------- */

/* VEC points: positions by the camera, whether they may be looked at, and
 * level and slopes there. */
struct align_points {
    vf x[3], level[3];
    vm inside;
};

/* Bilinear, at (u,v) in pixels from the first one's middle, not negative. */
VEC_INLINE void align_sample(vf level[3], const align_pixel *picture, vf u,
                             vf v)
{
    const vi x = __builtin_convertvector(u, vi);
    const vi y = __builtin_convertvector(v, vi);
    const vf wx = u - __builtin_convertvector(x, vf);
    const vf wy = v - __builtin_convertvector(y, vf);
    const float *row[VEC];
    int32_t at[VEC];
    vf a[4], b[4], c[4], d[4];

    vi_store(at, x + N * y);
    for (int k = 0; k < VEC; k++)
        row[k] = (const float *)(picture + at[k]);
    vf_columns(a, row, 1);
    for (int k = 0; k < VEC; k++)
        row[k] += 4;
    vf_columns(b, row, 1);
    for (int k = 0; k < VEC; k++)
        row[k] += 4 * (N - 1);
    vf_columns(c, row, 1);
    for (int k = 0; k < VEC; k++)
        row[k] += 4;
    vf_columns(d, row, 1);
    for (int k = 0; k < 3; k++) {
        vf top = a[k] + wx * (b[k] - a[k]);
        vf bottom = c[k] + wx * (d[k] - c[k]);

        level[k] = top + wy * (bottom - top);
    }
}

/* Coordinate k of the rotated q. */
VEC_INLINE vf align_turn(const struct align_camera *camera, int k,
                         const vf q[3])
{
    const float *R = camera->R + 3 * k;

    return R[0] * q[0] + R[1] * q[1] + R[2] * q[2];
}

/* Points point[0], point[room], point[2 room] and on. */
VEC_INLINE void align_project_points(struct align_points *p, const float *point,
                                     size_t room, const align_pixel *picture,
                                     const struct align_camera *camera)
{
    const vf q[3] = {vf_load(point), vf_load(point + room),
                     vf_load(point + 2 * room)};
    const vf near = vf_set(CAMERA_NEAR);
    vf uv[2];

    for (int k = 0; k < 3; k++)
        p->x[k] = align_turn(camera, k, q) + camera->t[k];
    p->inside = vf_gt(p->x[2], near);
    for (int k = 0; k < 2; k++) {
        uv[k] = camera->focal * p->x[k] / vf_max(p->x[2], near) +
                camera->corner[k];
        p->inside = vf_gt_and(p->inside, uv[k], vf_set(camera->low[k]));
        p->inside = vf_gt_and(p->inside, vf_set(camera->high[k]), uv[k]);
    }
    align_sample(p->level, picture, vf_keep(p->inside, uv[0] - 0.5f),
                 vf_keep(p->inside, uv[1] - 0.5f));
}

static void ISA(align_show)(float *level, float *facing, const float *point,
                            const float *normal, size_t room,
                            const align_pixel *picture,
                            const struct align_camera *camera)
{
    for (size_t i = 0; i < room; i += VEC) {
        const vf n[3] = {vf_load(normal + i), vf_load(normal + room + i),
                         vf_load(normal + 2 * room + i)};
        struct align_points p;
        vf along = vf_set(0), square = vf_set(0);

        align_project_points(&p, point + i, room, picture, camera);
        for (int k = 0; k < 3; k++) {
            along -= p.x[k] * align_turn(camera, k, n);
            square += p.x[k] * p.x[k];
        }
        vf_store(level + i, vf_keep(p.inside, p.level[0]));
        vf_store(facing + i, vf_keep(p.inside, along / vf_sqrt(square)));
    }
}

/* ---- sums ---------------------------------------------------------------- */

#define BLOCK 512               /* points whose rows lie side by side */

/* How the levels of some points change with each unknown, how far off they
 * are, and what they count. */
struct align_block {
    _Alignas(64) float row[ALIGN_UNKNOWNS][BLOCK];
    float off[BLOCK], weight[BLOCK];
};

/* Sums that are made on the way. */
struct align_lanes {
    vf weight, off, x, y, xx, xy, yy;
};

/* Rows of the points p at i: turns about the centre, moves, gain, bias. */
VEC_INLINE void align_rows(struct align_block *b, size_t i,
                           const struct align_points *p, float focal,
                           const struct align_residual *r)
{
    const vf *s = p->level;
    const vf f = r->gain * focal / p->x[2];
    const vf g[3] = {f * s[1], f * s[2],
                     -f * (s[1] * p->x[0] + s[2] * p->x[1]) / p->x[2]};
    const vf o[3] = {p->x[0] - r->centre[0], p->x[1] - r->centre[1],
                     p->x[2] - r->centre[2]};

    vf_store(b->row[0] + i, vf_keep(p->inside, g[2] * o[1] - g[1] * o[2]));
    vf_store(b->row[1] + i, vf_keep(p->inside, g[0] * o[2] - g[2] * o[0]));
    vf_store(b->row[2] + i, vf_keep(p->inside, g[1] * o[0] - g[0] * o[1]));
    for (int k = 0; k < 3; k++)
        vf_store(b->row[3 + k] + i, vf_keep(p->inside, g[k]));
    vf_store(b->row[6] + i, s[0]);
    vf_store(b->row[7] + i, vf_set(1));
}

/* VEC points of a keyframe, from visibility[0] on, to i of the block. */
VEC_INLINE void align_add(struct align_lanes *l, struct align_block *b,
                          size_t i, const float *visibility, size_t room,
                          const align_pixel *picture,
                          const struct align_camera *camera,
                          const struct align_residual *r, bool step)
{
    const vf seen = vf_load(visibility + 3 * room);
    const float narrow = 1 / (4 * r->sigma * r->sigma);
    struct align_points p;
    vf w, off, x, y;

    align_project_points(&p, visibility, room, picture, camera);
    w = vf_keep(p.inside, vf_load(visibility + 4 * room));
    off = r->gain * p.level[0] + r->bias - seen;
    x = w * p.level[0];
    y = w * seen;
    l->weight += w;
    l->off += w * vf_abs(off);
    l->x += x;
    l->y += y;
    l->xx += x * p.level[0];
    l->xy += x * seen;
    l->yy += y * seen;
    if (!step)
        return;
    align_rows(b, i, &p, camera->focal, r);
    vf_store(b->off + i, off);
    vf_store(b->weight + i, w / (1 + off * off * narrow));
}

/* Row m of s->a and s->b, n points of the block added; m a constant. */
VEC_INLINE void align_product(struct align_sums *s,
                              const struct align_block *b, size_t n,
                              const int m)
{
    vf a[ALIGN_UNKNOWNS] = {{0}}, off = vf_set(0);

    for (size_t i = 0; i < n; i += VEC) {
        const vf row = vf_load(b->weight + i) * vf_load(b->row[m] + i);

        off += row * vf_load(b->off + i);
#pragma GCC unroll 8
        for (int k = 0; k <= m; k++)
            a[k] += row * vf_load(b->row[k] + i);
    }
    s->b[m] += (double)vf_sum(off);
    for (int k = 0; k <= m; k++)
        s->a[ALIGN_UNKNOWNS * m + k] += (double)vf_sum(a[k]);
}

static void ISA(align_sum)(struct align_sums *s, const float *visibility,
                           size_t room, const align_pixel *picture,
                           const struct align_camera *camera,
                           const struct align_residual *r, bool step)
{
    struct align_block b;

    memset(s, 0, sizeof *s);
    for (size_t at = 0; at < room; at += BLOCK) {
        const size_t n = room - at < BLOCK ? room - at : BLOCK;
        struct align_lanes l = {0};

        for (size_t i = 0; i < n; i += VEC)
            align_add(&l, &b, i, visibility + at + i, room, picture, camera, r,
                      step);
        s->weight += (double)vf_sum(l.weight);
        s->off += (double)vf_sum(l.off);
        s->x += (double)vf_sum(l.x);
        s->y += (double)vf_sum(l.y);
        s->xx += (double)vf_sum(l.xx);
        s->xy += (double)vf_sum(l.xy);
        s->yy += (double)vf_sum(l.yy);
        if (!step)
            continue;
#pragma GCC unroll 8
        for (int m = 0; m < ALIGN_UNKNOWNS; m++)
            align_product(s, &b, n, m);
    }
}

/* ---- a face -------------------------------------------------------------- */

/* The same of a face: its points, moved, and their rows. */
struct align_face_block {
    float at[3][BLOCK];
    _Alignas(64) float row[ALIGN_FACE_UNKNOWNS][BLOCK];
    float off[BLOCK], weight[BLOCK];
};

/* Points from `from` on, to i of the block, moved by x (codes). */
VEC_INLINE void align_face_move(struct align_face_block *b, size_t i,
                                const struct align_face_points *f,
                                size_t from, const float *x)
{
    vf q[3];

    for (size_t c = 0; c < 3; c++)
        q[c] = vf_load(f->point + c * f->room + from);
    for (size_t k = 0; k < f->codes; k++)
        for (size_t c = 0; c < 3 && x[k] != 0; c++)
            q[c] += x[k] * vf_load(f->direction + (3 * k + c) * f->room + from);
    for (size_t c = 0; c < 3; c++)
        vf_store(b->at[c] + i, q[c]);
}

/* Rows of the points p: how their levels change with light and directions. */
VEC_INLINE void align_face_rows(struct align_face_block *b, size_t i,
                                const struct align_points *p,
                                const struct align_face_points *f,
                                size_t from, const struct align_camera *camera,
                                float gain)
{
    const vf *s = p->level;
    const vf share = gain * camera->focal / p->x[2];
    const vf g[3] = {share * s[1], share * s[2],
                     -share * (s[1] * p->x[0] + s[2] * p->x[1]) / p->x[2]};
    vf h[3];

    for (size_t c = 0; c < 3; c++)
        h[c] = vf_keep(p->inside, camera->R[c] * g[0] +
                                      camera->R[3 + c] * g[1] +
                                      camera->R[6 + c] * g[2]);
    vf_store(b->row[0] + i, s[0]);
    vf_store(b->row[1] + i, vf_set(1));
    for (size_t k = 0; k < f->codes; k++) {
        const float *d = f->direction + 3 * k * f->room + from;

        vf_store(b->row[ALIGN_FACE_LIGHT + k] + i,
                 h[0] * vf_load(d) + h[1] * vf_load(d + f->room) +
                     h[2] * vf_load(d + 2 * f->room));
    }
}

/* Rows m and m + 1 of s->a by columns k to k + 3: row (2,BLOCK) has the rows'
 * weights in. */
VEC_INLINE void align_face_tile(struct align_face_sums *s,
                                const struct align_face_block *b,
                                const float row[2][BLOCK], size_t n,
                                size_t unknowns, size_t m, size_t k)
{
    vf a[2][4] = {{{0}}};

    for (size_t i = 0; i < n; i += VEC) {
        const vf one = vf_load(row[0] + i), two = vf_load(row[1] + i);

#pragma GCC unroll 4
        for (size_t j = 0; j < 4; j++) {
            const vf column = vf_load(b->row[k + j] + i);

            a[0][j] += one * column;
            a[1][j] += two * column;
        }
    }
    for (size_t j = 0; j < 4; j++) {
        s->a[unknowns * m + k + j] += (double)vf_sum(a[0][j]);
        s->a[unknowns * (m + 1) + k + j] += (double)vf_sum(a[1][j]);
    }
}

/* s += the block's n points. */
static void align_face_product(struct align_face_sums *s,
                               const struct align_face_block *b, size_t n,
                               size_t unknowns)
{
    for (size_t m = 0; m < unknowns; m += 2) {
        float row[2][BLOCK];
        vf off[2] = {{0}};

        for (size_t i = 0; i < n; i += VEC)
            for (size_t j = 0; j < 2; j++) {
                const vf w = vf_load(b->weight + i) *
                             vf_load(b->row[m + j] + i);

                vf_store(row[j] + i, w);
                off[j] += w * vf_load(b->off + i);
            }
        for (size_t j = 0; j < 2; j++)
            s->b[m + j] += (double)vf_sum(off[j]);
        for (size_t k = 0; k <= m + 1; k += 4)
            align_face_tile(s, b, row, n, unknowns, m, k);
    }
}

static void ISA(align_face)(struct align_face_sums *s,
                            const struct align_face_points *f, const float *x,
                            size_t unknowns, const align_pixel *picture,
                            const struct align_camera *camera, float sigma)
{
    const float narrow = 1 / (4 * sigma * sigma);
    struct align_face_block b;

    memset(s, 0, sizeof *s);
    for (size_t k = ALIGN_FACE_LIGHT + f->codes; k < unknowns; k++)
        memset(b.row[k], 0, sizeof b.row[k]);
    for (size_t at = 0; at < f->room; at += BLOCK) {
        const size_t n = f->room - at < BLOCK ? f->room - at : BLOCK;
        vf weight = vf_set(0), away = vf_set(0);

        for (size_t i = 0; i < n; i += VEC) {
            struct align_points p;
            vf w, off;

            align_face_move(&b, i, f, at + i, x + ALIGN_FACE_LIGHT);
            align_project_points(&p, b.at[0] + i, BLOCK, picture, camera);
            w = vf_keep(p.inside, vf_load(f->weight + at + i));
            off = x[0] * p.level[0] + x[1] - vf_load(f->level + at + i);
            weight += w;
            away += w * vf_abs(off);
            align_face_rows(&b, i, &p, f, at + i, camera, x[0]);
            vf_store(b.off + i, off);
            vf_store(b.weight + i, w / (1 + off * off * narrow));
        }
        s->weight += (double)vf_sum(weight);
        s->off += (double)vf_sum(away);
        align_face_product(s, &b, n, unknowns);
    }
}

const struct align_kernels ISA(align_kernels) = {
    ISA(align_picture), ISA(align_show), ISA(align_sum), ISA(align_face)
};
