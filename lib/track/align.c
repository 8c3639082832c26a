/* Laying a head over its keyframes: the points, the pictures, the
 * Gauss-Newton steps, and when a frame becomes a keyframe. */
#include "lib/track/align.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"
#include "lib/geom/cholesky.h"
#include "lib/geom/rotation.h"

#define N ALIGN_SIDE
#define UNKNOWNS 8              /* turn, move, gain, bias */
#define STEPS 8                 /* at most, and ... */
#define SMALL 0.003             /* of E_m's spread: such a step is the last */
#define MARGIN 3.0              /* pixels from the picture's border */

/* E_m's spread about the truth: turns in radians, moves in shares of the
 * distance.  Half of each holds the aligned pose, as neighbouring points say
 * the same and count as fewer; far from its keyframe, where a shape and a light
 * not known show, less does. */
static const double align_spread[6] = {0.026, 0.026, 0.013,
                                       0.003, 0.003, 0.02};
#define HOLD 4.0
#define HOLD_FAR 10.0           /* more of it, per square of the distance */
#define GAIN_SPREAD 0.1

#define ACT 0.6                 /* of an expression, to see what moves */
#define JAW_ACT 0.15            /* radians */
#define MOVES 8.0               /* millimetres: such a point counts half */
#define STEADY 0.05             /* what moves more is not looked at */
#define FACING 0.2              /* cosine to the camera: seen well */
#define AGREEMENT 0.8           /* correlation of what is laid over */
#define TURN_ON 0.08            /* radians to the nearest keyframe, and ... */
#define SCALE_ON 0.2            /* ... change of distance: a new one */
#define MISSES 10               /* in a row: the keyframes are of no use */

/* ---- points ------------------------------------------------------------- */

/* Squared distance, head units, that vertex v goes in expressions, blinks. */
static double align_expression(const struct head *h, size_t v)
{
    const size_t b = v / HEAD_BLOCK, i = v % HEAD_BLOCK;
    const size_t line = 3 * HEAD_BLOCK;
    double sum = 0;

    for (size_t k = 0; k < h->nexp; k++)
        for (size_t c = 0; c < 3; c++) {
            double d = ACT * h->exp_dirs[(b * h->nexp + k) * line
                                         + c * HEAD_BLOCK + i];

            sum += d * d;
        }
    for (size_t k = 0; k < 2; k++)
        for (size_t c = 0; c < 3; c++) {
            double d = h->lids[(b * 2 + k) * line + c * HEAD_BLOCK + i];

            sum += d * d;
        }
    return sum;
}

/* Whether vertex v goes with the skull. */
static bool align_on_skull(const struct head *h, size_t v)
{
    const int region = h->region ? h->region[v] : REGION_FACE;

    return h->weights[v * HEAD_JOINTS + JOINT_NECK] > 0.95f &&
           (region == REGION_SKIN || region == REGION_FACE ||
            region == REGION_EYELID || region == REGION_NOSE ||
            region == REGION_BROW);
}

int align_init(struct align *a, const struct identity *id, struct error *err)
{
    const struct head *h = id->head;
    const struct head_motion open = {.jaw = {JAW_ACT, 0, 0}};
    const double half = MOVES * 1e-3 * h->scale;
    float *rest = malloc(9 * h->V * sizeof *rest), *jaw = rest + 3 * h->V;
    float *normal = rest + 6 * h->V;

    memset(a, 0, sizeof *a);
    a->point = malloc(7 * h->V * sizeof *a->point);
    a->picture = aligned_alloc(16, N * N * sizeof *a->picture);
    a->blurred = malloc(2 * N * N * sizeof *a->blurred);
    if (!rest || !a->point || !a->picture || !a->blurred) {
        free(rest);
        align_release(a);
        return error_set(err, EX_OSERR, "no memory to align frames");
    }
    a->normal = a->point + 3 * h->V;
    a->steady = a->point + 6 * h->V;
    identity_rest(rest, id);
    head_pose(jaw, id, &open);
    head_normals(normal, h, rest);
    for (size_t v = 0; v < h->V; v++) {
        double moves = align_expression(h, v);

        if (!align_on_skull(h, v))
            continue;
        for (size_t c = 0; c < 3; c++)
            moves += pow((double)jaw[3 * v + c] - rest[3 * v + c], 2);
        memcpy(a->point + 3 * a->count, rest + 3 * v, 3 * sizeof *rest);
        memcpy(a->normal + 3 * a->count, normal + 3 * v, 3 * sizeof *rest);
        a->steady[a->count++] = (float)(1 / (1 + moves / (half * half)));
    }
    for (size_t i = 0; i < 3 * a->count; i++)
        a->middle[i % 3] += a->point[i] / (double)a->count;
    free(rest);
    return 0;
}

void align_release(struct align *a)
{
    align_restart(a);
    free(a->point);
    free(a->picture);
    free(a->blurred);
    memset(a, 0, sizeof *a);
}

void align_restart(struct align *a)
{
    while (a->keys)
        free(a->key[--a->keys].sight);
    a->misses = 0;
}

/* ---- the picture -------------------------------------------------------- */

/* Index i + d, clamped to the picture. */
static size_t align_near(size_t i, int d)
{
    long j = (long)i + d;

    return j < 0 ? 0 : j >= N ? N - 1 : (size_t)j;
}

/* Binomial blur (1 4 6 4 1)/16 of in (N,N) along a line of pixels `step`
 * apart, lines `next` apart. */
static void align_blur(float *out, const float *in, size_t step, size_t next)
{
    for (size_t l = 0; l < N; l++)
        for (size_t i = 0; i < N; i++) {
            const float *p = in + l * next;
            float sides = p[align_near(i, -1) * step] +
                          p[align_near(i, 1) * step];
            float ends = p[align_near(i, -2) * step] +
                         p[align_near(i, 2) * step];

            out[l * next + i * step] =
                (6 * p[i * step] + 4 * sides + ends) / 16;
        }
}

/* a->picture = grey levels of rgb (2N,2N,3) at half its size, blurred twice
 * (an expression moves fine detail first), and their slopes. */
static void align_take_picture(struct align *a, const float *rgb)
{
    float *grey = a->blurred, *lines = grey + N * N;

    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++) {
            const float *p = rgb + 3 * (2 * y * 2 * N + 2 * x);
            float sum = 0;

            for (size_t k = 0; k < 6; k++)
                sum += p[k] + p[k + 6 * N];
            grey[y * N + x] = sum * (255.0f / 12);
        }
    for (int k = 0; k < 2; k++) {
        align_blur(lines, grey, 1, N);
        align_blur(grey, lines, N, 1);
    }
    for (size_t y = 0; y < N; y++)
        for (size_t x = 0; x < N; x++)
            a->picture[y * N + x] = (align_pixel){
                grey[y * N + x],
                (grey[y * N + align_near(x, 1)] -
                 grey[y * N + align_near(x, -1)]) / 2,
                (grey[align_near(y, 1) * N + x] -
                 grey[align_near(y, -1) * N + x]) / 2, 0};
}

/* Bilinear, at (u,v) in pixels from the corner; it must lie inside. */
static align_pixel align_sample(const struct align *a, double u, double v)
{
    const double x = u - 0.5, y = v - 0.5, fx = floor(x), fy = floor(y);
    const align_pixel *p = a->picture + (size_t)fy * N + (size_t)fx;
    const float wx = (float)(x - fx), wy = (float)(y - fy);
    align_pixel top = p[0] + wx * (p[1] - p[0]);
    align_pixel bottom = p[N] + wx * (p[N + 1] - p[N]);

    return top + wy * (bottom - top);
}

/* ---- a pose ------------------------------------------------------------- */

/* What a frame is seen through: pixels of a->picture = scale * window pixels +
 * shift; and what of it may be looked at. */
struct align_view {
    double focal, middle;       /* of the portrait window */
    double scale, left, top;
    double low[2], high[2];
};

/* A pose being improved. */
struct align_pose {
    double R[9], t[3], gain, bias;
};

static struct align_view align_make_view(struct square q,
                                         struct align_bounds in, double size)
{
    const double scale = N / q.size;

    return (struct align_view){
        .focal = camera_focal((float)size) * scale,
        .middle = size / 2 * scale,
        .scale = scale,
        .left = (q.x - q.size / 2) * scale,
        .top = (q.y - q.size / 2) * scale,
        .low = {fmax(in.left, 0) * N + MARGIN, fmax(in.top, 0) * N + MARGIN},
        .high = {fmin(in.right, 1) * N - MARGIN,
                 fmin(in.bottom, 1) * N - MARGIN},
    };
}

/* x (3) of point i by the camera; uv (2) in a->picture.  Whether it may be
 * looked at. */
static bool align_project(double x[3], double uv[2], const struct align *a,
                          size_t i, const struct align_pose *p,
                          const struct align_view *v)
{
    const float *q = a->point + 3 * i;

    for (int k = 0; k < 3; k++)
        x[k] = p->R[3 * k] * q[0] + p->R[3 * k + 1] * q[1] +
               p->R[3 * k + 2] * q[2] + p->t[k];
    if (!(x[2] > CAMERA_NEAR))
        return false;
    uv[0] = v->focal * x[0] / x[2] + v->middle - v->left;
    uv[1] = v->focal * x[1] / x[2] + v->middle - v->top;
    return uv[0] > v->low[0] && uv[0] < v->high[0] && uv[1] > v->low[1] &&
           uv[1] < v->high[1];
}

/* Where the points' middle is, by the camera. */
static void align_middle(double c[3], const struct align *a,
                         const struct align_pose *p)
{
    for (int k = 0; k < 3; k++)
        c[k] = p->R[3 * k] * a->middle[0] + p->R[3 * k + 1] * a->middle[1] +
               p->R[3 * k + 2] * a->middle[2] + p->t[k];
}

/* Turn p by r (3) about the point c (3) and move it by d (3). */
static void align_move(struct align_pose *p, const double r[3],
                       const double d[3], const double c[3])
{
    double turn[9], R[9], t[3];

    rotation_exp_d(turn, r);
    mat3_mul_d(R, turn, p->R);
    for (int k = 0; k < 3; k++)
        t[k] = turn[3 * k] * (p->t[0] - c[0]) +
               turn[3 * k + 1] * (p->t[1] - c[1]) +
               turn[3 * k + 2] * (p->t[2] - c[2]) + c[k] + d[k];
    memcpy(p->R, R, sizeof R);
    memcpy(p->t, t, sizeof t);
}

/* ---- Gauss-Newton ------------------------------------------------------- */

/* What the points say of a pose. */
struct align_sums {
    double a[UNKNOWNS * UNKNOWNS], b[UNKNOWNS];  /* lower triangle, J^T r */
    double weight, off;         /* sum of weights; of weight * |residual| */
    double x, y, xx, xy, yy;    /* for the correlation */
};

/* row = how the level at a point at x (3), with slopes s, changes with each
 * unknown, turning about c. */
static void align_row(double row[UNKNOWNS], align_pixel s, const double x[3],
                      const double c[3], double focal, double gain)
{
    const double f = gain * focal / x[2];
    const double g[3] = {f * s[1], f * s[2],
                         -f * (s[1] * x[0] + s[2] * x[1]) / x[2]};
    const double o[3] = {x[0] - c[0], x[1] - c[1], x[2] - c[2]};

    row[0] = g[2] * o[1] - g[1] * o[2];
    row[1] = g[0] * o[2] - g[2] * o[0];
    row[2] = g[1] * o[0] - g[0] * o[1];
    for (int k = 0; k < 3; k++)
        row[3 + k] = g[k];
    row[6] = s[0];
    row[7] = 1;
}

/* Residuals of pose p against a keyframe, weighed down beyond 2 * sigma
 * (Cauchy's weights). */
static void align_sum(struct align_sums *s, const struct align *a,
                      const struct align_keyframe *k,
                      const struct align_pose *p, const struct align_view *v,
                      const double c[3], double sigma)
{
    memset(s, 0, sizeof *s);
    for (size_t i = 0; i < k->count; i++) {
        const struct align_sight *seen = &k->sight[i];
        double x[3], uv[2], row[UNKNOWNS], r, w;

        if (!align_project(x, uv, a, seen->point, p, v))
            continue;
        align_pixel level = align_sample(a, uv[0], uv[1]);

        r = p->gain * level[0] + p->bias - seen->level;
        w = seen->weight;
        s->off += w * fabs(r);
        s->weight += w;
        s->x += w * level[0];
        s->y += w * seen->level;
        s->xx += w * level[0] * level[0];
        s->xy += w * level[0] * seen->level;
        s->yy += w * seen->level * seen->level;
        w /= 1 + r * r / (4 * sigma * sigma);
        align_row(row, level, x, c, v->focal, p->gain);
        for (int m = 0; m < UNKNOWNS; m++) {
            s->b[m] += w * row[m] * r;
            for (int n = 0; n <= m; n++)
                s->a[UNKNOWNS * m + n] += w * row[m] * row[n];
        }
    }
}

/* Weighted correlation of the frame's levels with the keyframe's. */
static double align_correlation(const struct align_sums *s)
{
    const double w = s->weight;
    const double xx = w * s->xx - s->x * s->x, yy = w * s->yy - s->y * s->y;

    return xx > 0 && yy > 0 ? (w * s->xy - s->x * s->y) / sqrt(xx * yy) : 0;
}

/* How far p is from E_m's pose: a turn and the way of the middle, which is
 * c (3) now and was at c0 (3). */
static void align_apart(double e[6], const struct align_pose *p,
                        const struct align_pose *from, const double c[3],
                        const double c0[3])
{
    double turn[9];

    mat3_mul_nt_d(turn, p->R, from->R);
    rotation_log_d(e, turn);
    for (int k = 0; k < 3; k++)
        e[3 + k] = c[k] - c0[k];
}

/* One step of p, held near `from` so many times; returns its size in E_m's
 * spreads. */
static double align_improve(struct align_pose *p, struct align_sums *s,
                            const struct align_pose *from, const double c[3],
                            const double c0[3], double sigma, double times)
{
    double x[UNKNOWNS], e[6], size = 0;

    align_apart(e, p, from, c, c0);
    for (int m = 0; m < UNKNOWNS; m++) {
        double spread = m < 3   ? align_spread[m]
                        : m < 6 ? align_spread[m] * c0[2]
                        : m == 6 ? GAIN_SPREAD : INFINITY;
        double hold = sigma * sigma * (m < 6 ? times : 1) / (spread * spread);
        double apart = m < 6 ? e[m] : m == 6 ? p->gain - 1 : 0;

        s->a[UNKNOWNS * m + m] += hold;
        s->b[m] = -s->b[m] - hold * apart;
    }
    memcpy(x, s->b, sizeof x);
    cholesky_solve(x, s->a, UNKNOWNS);
    align_move(p, x, x + 3, c);
    p->gain += x[6];
    p->bias += x[7];
    for (int m = 0; m < 6; m++)
        size = fmax(size, fabs(x[m]) / align_spread[m] / (m < 3 ? 1 : c0[2]));
    return size;
}

/* Lay p over a keyframe so far away; the correlation then. */
static double align_fit(struct align_pose *p, const struct align *a,
                        const struct align_keyframe *k, double far,
                        const struct align_view *v)
{
    const struct align_pose from = *p;
    const double hold = HOLD * (1 + HOLD_FAR * far * far);
    double c0[3], c[3], sigma = 255;
    struct align_sums s;
    bool small = false;

    align_middle(c0, a, p);
    for (int step = 0; step <= STEPS; step++) {
        align_middle(c, a, p);
        align_sum(&s, a, k, p, v, c, sigma);
        if (s.weight <= 0 || step == STEPS || small)
            break;
        sigma = fmax(1.2533 * s.off / s.weight, 1);
        small = align_improve(p, &s, &from, c, c0, sigma, hold) < SMALL;
    }
    return align_correlation(&s);
}

/* ---- keyframes ---------------------------------------------------------- */

/* How far p is from a keyframe: from 1 on it wants one of its own. */
static double align_distance(const struct align_keyframe *k, const float R[9],
                             const float t[3])
{
    return rotation_distance(R, k->R) / TURN_ON +
           fabs(log((double)t[2] / k->t[2])) / SCALE_ON;
}

/* Keep this frame as a keyframe, if memory can be had. */
static void align_keep(struct align *a, const struct motion *m,
                       const struct align_pose *p, const struct align_view *v)
{
    struct align_keyframe *k = &a->key[a->keys];

    if (a->keys == ALIGN_KEYFRAMES ||
        !(k->sight = malloc((a->count + 1) * sizeof *k->sight)))
        return;
    k->count = 0;
    memcpy(k->R, m->R, sizeof k->R);
    memcpy(k->t, m->t, sizeof k->t);
    a->keys++;
    for (size_t i = 0; i < a->count; i++) {
        const float *n = a->normal + 3 * i;
        double x[3], uv[2], facing = 0;

        if (!align_project(x, uv, a, i, p, v))
            continue;
        for (int r = 0; r < 3; r++)
            facing -= x[r] * (p->R[3 * r] * n[0] + p->R[3 * r + 1] * n[1] +
                              p->R[3 * r + 2] * n[2]);
        facing /= sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        if (facing < FACING || a->steady[i] < STEADY)
            continue;
        k->sight[k->count++] = (struct align_sight){
            (uint32_t)i, align_sample(a, uv[0], uv[1])[0],
            a->steady[i] * (float)facing};
    }
}

bool align_step(struct align *a, struct motion *m, const float *rgb,
                struct square q, struct align_bounds in, double size)
{
    const struct align_view v = align_make_view(q, in, size);
    const struct align_keyframe *nearest = NULL;
    struct align_pose p = {.gain = 1};
    double least = INFINITY;

    for (int k = 0; k < 9; k++)
        p.R[k] = m->R[k];
    for (int k = 0; k < 3; k++)
        p.t[k] = m->t[k];
    align_take_picture(a, rgb);
    for (size_t k = 0; k < a->keys; k++) {
        double far = align_distance(&a->key[k], m->R, m->t);

        if (far < least) {
            least = far;
            nearest = &a->key[k];
        }
    }
    if (nearest) {
        if (align_fit(&p, a, nearest, least, &v) < AGREEMENT) {
            if (++a->misses == MISSES)
                align_restart(a);
            return false;
        }
        for (int k = 0; k < 9; k++)
            m->R[k] = (float)p.R[k];
        for (int k = 0; k < 3; k++)
            m->t[k] = (float)p.t[k];
        least = align_distance(nearest, m->R, m->t);
    }
    a->misses = 0;
    if (!nearest || least > 1)
        align_keep(a, m, &p, &v);
    return true;
}
