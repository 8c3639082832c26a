/* Laying a head over its keyframes: the points, the Gauss-Newton steps, and
 * when a frame becomes a keyframe.  What a frame shows at the points is
 * align_tmpl.c's. */
#include "lib/track/align.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/camera.h"
#include "lib/base/cholesky.h"
#include "lib/base/rotation.h"
#include "lib/track/align_kernel.h"

#define N ALIGN_SIDE
#define UNKNOWNS ALIGN_UNKNOWNS
#define STEPS 8                 /* at most */
#define SMALL 0.003             /* a step of this share of E_m's deviations is
                                 * the last */
#define MARGIN 3.0              /* pixels from the picture's border */

/* Standard deviations of E_m's error: rotations in radians, translations as
 * shares of the distance. */
static const double align_spread[6] = {0.026, 0.026, 0.013,
                                       0.003, 0.003, 0.02};
/* Factor of the prior on the pose, above 1 since errors of neighbouring points
 * are correlated; it grows with the square of the distance to the keyframe,
 * where errors of the shape and the light show. */
#define PRIOR 4.0
#define PRIOR_FAR 10.0
/* Heads mostly keep still, and a smile moves points much as a rotation does.
 * So rotations since the keyframe have a prior about 0, too, with Cauchy's
 * weights: strong below STILL radians, weak above. */
#define STILL 0.0087
#define STILL_PRIOR (20 * PRIOR)

#define ACT 0.6                 /* size of the expressions, ... */
#define JAW_ACT 0.15            /* ... radians of the jaw, that tell which
                                 * points move */
#define MOVES 8.0               /* millimetres: a point that moves so far has
                                 * half the weight */
#define STEADY 0.05             /* least weight of a point that is used */
#define AGREEMENT 0.8           /* correlation of aligned points, at least */
/* A frame becomes a keyframe when its distance to the nearest one is 1: */
#define TURN_ON 0.08            /* radians of rotation per unit, and ... */
#define SCALE_ON 0.2            /* ... logarithm of the depths' ratio */
#define MISSES 10               /* in a row: the keyframes are discarded */

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

/* a's points: those of the skull, at rest and with the jaw opened (V,3). */
static void align_choose(struct align *a, const struct head *h,
                         const float *rest, const float *jaw,
                         const float *normal)
{
    const double half = MOVES * 1e-3 * h->scale;

    for (size_t v = 0; v < h->V; v++) {
        double moves = align_expression(h, v);

        if (!align_on_skull(h, v))
            continue;
        for (size_t c = 0; c < 3; c++) {
            moves += pow((double)jaw[3 * v + c] - rest[3 * v + c], 2);
            a->point[c * a->room + a->count] = rest[3 * v + c];
            a->normal[c * a->room + a->count] = normal[3 * v + c];
            a->middle[c] += rest[3 * v + c];
        }
        a->steady[a->count++] = (float)(1 / (1 + moves / (half * half)));
    }
    for (size_t c = 0; c < 3; c++)
        a->middle[c] /= a->count ? (double)a->count : 1;
}

int align_init(struct align *a, const struct identity *id, struct error *err)
{
    const struct head *h = id->head;
    const struct head_motion open = {.jaw = {JAW_ACT, 0, 0}};
    const size_t room = align_room(h->V);
    const size_t work = room > N * N ? room : N * N;
    float *rest = malloc(9 * h->V * sizeof *rest);

    memset(a, 0, sizeof *a);
    a->point = calloc(7 * room, sizeof *a->point);
    a->picture = aligned_alloc(16, N * N * sizeof *a->picture);
    a->work = malloc(2 * work * sizeof *a->work);
    if (!rest || !a->point || !a->picture || !a->work) {
        free(rest);
        align_release(a);
        return error_set(err, EX_OSERR, "no memory to align frames");
    }
    float *jaw = rest + 3 * h->V, *normal = rest + 6 * h->V;
    a->room = room;
    a->normal = a->point + 3 * room;
    a->steady = a->point + 6 * room;
    identity_rest(rest, id);
    head_pose(jaw, id, &open);
    head_normals(normal, h, rest);
    align_choose(a, h, rest, jaw, normal);
    free(rest);
    if (align_face_init(&a->face, id, err) == 0)
        return 0;
    align_release(a);
    return -1;
}

void align_release(struct align *a)
{
    align_restart(a);
    align_face_release(&a->face);
    free(a->point);
    free(a->picture);
    free(a->work);
    memset(a, 0, sizeof *a);
}

void align_restart(struct align *a)
{
    while (a->keys) {
        free(a->key[--a->keys].visibility);
        free(a->key[a->keys].face);
    }
    a->misses = 0;
}

/* ---- a pose ------------------------------------------------------------- */

/* What a frame is seen through: pixels of a->picture = focal * normalised
 * position + corner; and what of it may be looked at. */
struct align_view {
    double focal, corner[2];
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
        .corner = {(size / 2 - q.x + q.size / 2) * scale,
                   (size / 2 - q.y + q.size / 2) * scale},
        .low = {fmax(in.left, 0) * N + MARGIN, fmax(in.top, 0) * N + MARGIN},
        .high = {fmin(in.right, 1) * N - MARGIN,
                 fmin(in.bottom, 1) * N - MARGIN},
    };
}

/* Pose and view as the kernels take them. */
static struct align_camera align_camera(const struct align_pose *p,
                                        const struct align_view *v)
{
    struct align_camera camera = {.focal = (float)v->focal};

    for (int k = 0; k < 9; k++)
        camera.R[k] = (float)p->R[k];
    for (int k = 0; k < 3; k++)
        camera.t[k] = (float)p->t[k];
    for (int k = 0; k < 2; k++) {
        camera.corner[k] = (float)v->corner[k];
        camera.low[k] = (float)v->low[k];
        camera.high[k] = (float)v->high[k];
    }
    return camera;
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

/* Residuals of pose p, turning about c (3), against a keyframe; `step`: with
 * what a step takes. */
static void align_sum(struct align_sums *s, const struct align *a,
                      const struct align_keyframe *k,
                      const struct align_pose *p, const struct align_view *v,
                      const double c[3], double sigma, bool step)
{
    const struct align_camera camera = align_camera(p, v);
    const struct align_residual r = {
        (float)p->gain, (float)p->bias,
        {(float)c[0], (float)c[1], (float)c[2]}, (float)sigma};

    CPU_PICK(align_kernels)->sum(s, k->visibility, k->room, a->picture, &camera,
                                 &r, step);
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
static void align_difference(double e[6], const struct align_pose *p,
                             const struct align_pose *from, const double c[3],
                             const double c0[3])
{
    double turn[9];

    mat3_mul_nt_d(turn, p->R, from->R);
    rotation_log_d(e, turn);
    for (int k = 0; k < 3; k++)
        e[3 + k] = c[k] - c0[k];
}

/* Hold a small turn of p since its keyframe near none. */
static void align_add_still_prior(struct align_sums *s,
                                  const struct align_pose *p,
                                  const struct align_keyframe *k, double sigma)
{
    double R[9], turn[9], r[3];

    for (int i = 0; i < 9; i++)
        R[i] = k->R[i];
    mat3_mul_nt_d(turn, p->R, R);
    rotation_log_d(r, turn);
    const double square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    const double hold = STILL_PRIOR * sigma * sigma /
                        (1 + square / (STILL * STILL));
    for (int m = 0; m < 3; m++) {
        const double w = hold / (align_spread[m] * align_spread[m]);

        s->a[UNKNOWNS * m + m] += w;
        s->b[m] += w * r[m];
    }
}

/* One step of p, with `from` as the prior, `times` as strong as E_m's
 * deviations say; returns its size in those deviations. */
static double align_improve(struct align_pose *p, struct align_sums *s,
                            const struct align_pose *from, const double c[3],
                            const double c0[3], double sigma, double times)
{
    double x[UNKNOWNS], e[6], size = 0;

    align_difference(e, p, from, c, c0);
    for (int m = 0; m < UNKNOWNS; m++) {
        double spread = m < 3   ? align_spread[m]
                        : m < 6 ? align_spread[m] * c0[2]
                        : m == 6 ? ALIGN_GAIN_SPREAD : INFINITY;
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

/* Align p with a keyframe at distance `far` (align_distance); returns the
 * correlation. */
static double align_fit(struct align_pose *p, const struct align *a,
                        const struct align_keyframe *k, double far,
                        const struct align_view *v)
{
    const struct align_pose from = *p;
    const double hold = PRIOR * (1 + PRIOR_FAR * far * far);
    double c0[3], c[3], sigma = 255;
    struct align_sums s;
    bool small = false;

    align_middle(c0, a, p);
    for (int step = 0; step < STEPS && !small; step++) {
        align_middle(c, a, p);
        align_sum(&s, a, k, p, v, c, sigma, true);
        if (s.weight <= 0)
            return 0;
        sigma = align_sigma(s.off, s.weight);
        align_add_still_prior(&s, p, k, sigma);
        small = align_improve(p, &s, &from, c, c0, sigma, hold) < SMALL;
    }
    align_sum(&s, a, k, p, v, c, sigma, false);
    return align_correlation(&s);
}

/* ---- keyframes ---------------------------------------------------------- */

/* The distance of a pose from a keyframe: above 1, a new keyframe is made. */
static double align_distance(const struct align_keyframe *k, const float R[9],
                             const float t[3])
{
    return rotation_distance(R, k->R) / TURN_ON +
           fabs(log((double)t[2] / k->t[2])) / SCALE_ON;
}

/* Where a new keyframe goes: behind the others or, when there is no room, in
 * the place of the one that was of no use for longest. */
static struct align_keyframe *align_keyframe_room(struct align *a)
{
    struct align_keyframe *k = a->key;

    if (a->keys < ALIGN_KEYFRAMES)
        return &a->key[a->keys++];
    for (size_t i = 1; i < a->keys; i++)
        if (a->key[i].used < k->used)
            k = &a->key[i];
    free(k->visibility);
    free(k->face);
    return k;
}

/* Keep this frame as a keyframe, if memory can be had. */
static void align_add_keyframe(struct align *a, const struct motion *m,
                               const struct align_pose *p,
                               const struct align_view *v)
{
    const struct align_camera camera = align_camera(p, v);
    float *level = a->work, *weight = level + a->room, *visibility;
    size_t n = 0, room;

    CPU_PICK(align_kernels)->show(level, weight, a->point, a->normal, a->room,
                                  a->picture, &camera);
    for (size_t i = 0; i < a->count; i++) {
        const bool well = weight[i] > 0 && a->steady[i] >= STEADY;

        weight[i] *= well ? a->steady[i] : 0;
        n += well;
    }
    room = align_room(n);
    visibility = calloc(5 * room + 1, sizeof *visibility);
    if (!visibility)
        return;
    struct align_keyframe *k = align_keyframe_room(a);
    k->visibility = visibility;
    k->room = room;
    k->used = a->frames;
    k->face = a->face.codes ? malloc(2 * a->face.room * sizeof *k->face)
                            : NULL;
    if (k->face)
        align_face_show(k->face, &a->face, m, a->picture, &camera);
    memcpy(k->R, m->R, sizeof k->R);
    memcpy(k->t, m->t, sizeof k->t);
    for (size_t i = 0, to = 0; i < a->count; i++) {
        if (!(weight[i] > 0))
            continue;
        for (size_t c = 0; c < 3; c++)
            k->visibility[c * room + to] = a->point[c * a->room + i];
        k->visibility[3 * room + to] = level[i];
        k->visibility[4 * room + to++] = weight[i];
    }
}

/* m's expression, its pose p being aligned with keyframe k. */
static void align_fit_face(struct motion *m, struct align *a,
                           const struct align_keyframe *k,
                           const struct align_pose *p,
                           const struct align_view *v)
{
    const struct align_camera camera = align_camera(p, v);

    if (k->face)
        align_face_fit(&a->face, m, k->face, a->picture, &camera,
                       (float)p->gain, (float)p->bias);
}

bool align_step(struct align *a, struct motion *m, const float *rgb,
                struct square q, struct align_bounds in, double size)
{
    const struct align_view v = align_make_view(q, in, size);
    struct align_keyframe *nearest = NULL;
    struct align_pose p = {.gain = 1};
    double min = INFINITY;

    for (int k = 0; k < 9; k++)
        p.R[k] = m->R[k];
    for (int k = 0; k < 3; k++)
        p.t[k] = m->t[k];
    CPU_PICK(align_kernels)->picture(a->picture, a->work, rgb);
    for (size_t k = 0; k < a->keys; k++) {
        double far = align_distance(&a->key[k], m->R, m->t);

        if (far < min) {
            min = far;
            nearest = &a->key[k];
        }
    }
    if (nearest) {
        if (align_fit(&p, a, nearest, min, &v) < AGREEMENT) {
            if (++a->misses == MISSES)
                align_restart(a);
            return false;
        }
        for (int k = 0; k < 9; k++)
            m->R[k] = (float)p.R[k];
        for (int k = 0; k < 3; k++)
            m->t[k] = (float)p.t[k];
        align_fit_face(m, a, nearest, &p, &v);
        nearest->used = ++a->frames;
        min = align_distance(nearest, m->R, m->t);
    }
    a->misses = 0;
    if (!nearest || min > 1)
        align_add_keyframe(a, m, &p, &v);
    return true;
}
