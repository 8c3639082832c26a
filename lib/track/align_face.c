/* Alignment of an expression with a keyframe's: the points, the directions, and
 * the Gauss-Newton steps (align_face.h). */
#include "lib/track/align_face.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cholesky.h"
#include "lib/base/cpu.h"

/* Standard deviations of E_m's error: */
#define SPREAD 0.15f            /* of a component of the expression */
#define LID_SPREAD 0.06f        /* of a lid: 1.25 times the mean of 0.045 (tests/
                                 * bench/README.md, "Lids"), as normal errors
                                 * have */
#define GAP_SPREAD 3e-4f        /* metres, of the mouth's opening, */
#define WIDTH_SPREAD 1.3e-3f    /* and of its width (tests/bench/README.md,
                                 * "Where a mouth's width was lost") */
#define PRIOR 16.0              /* factor of the prior: errors of neighbouring
                                 * points are correlated, so they count less */
#define EDGE 8e-3f              /* metres from the lips' inner edge, where a
                                 * picture shows the mouth or the line between
                                 * closed lips: 2.7 deviations of its blur of
                                 * 1.41 pixels of 2.1 mm, for what is dark in
                                 * one frame and teeth in another drags what is
                                 * about it */
#define STEPS 2                 /* more make no visible difference */
#define MOVES 1e-3              /* metres: points that no direction moves
                                 * further are not used */
#define STILL 0.02              /* share of the strongest direction's movement:
                                 * directions of less are not used */
#define OPEN 0.35f              /* lids of a keyframe whose eyelids are fully
                                 * used, ... */
#define SHUT 0.6f               /* and from which on they are not: skin that
                                 * goes into the crease when they open */

/* What E_m says of the mouth better than its components, whose errors make up
 * for each other: from landmark to landmark along an axis of the head. */
static const struct {
    int end[2], axis;
    float spread;
} align_face_mouth[ALIGN_FACE_MEASURES] = {
    {{67, 61}, 1, GAP_SPREAD}, {{66, 62}, 1, GAP_SPREAD},
    {{65, 63}, 1, GAP_SPREAD}, {{60, 64}, 0, WIDTH_SPREAD}};

/* Whether vertex v is skin that expressions move. */
static bool align_face_is_skin(const struct head *h, size_t v)
{
    switch (h->region[v]) {
    case REGION_SKIN:
    case REGION_FACE:
    case REGION_EYELID:
    case REGION_NOSE:
    case REGION_BROW:
    case REGION_LIPS:
        return true;
    default:
        return false;
    }
}

/* Whether v of verts (V,3) is so near the lips' inner edge that a picture shows
 * the mouth's inside there, or the line between closed lips. */
static bool align_face_at_edge(const struct head *h, const float *verts,
                               size_t v)
{
    const float near = EDGE * h->scale;

    for (size_t i = 0; i < h->nlip_inner; i++) {
        const float *p = verts + 3 * v, *q = verts + 3 * h->lip_inner[i];
        const float d[3] = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};

        if (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < near * near)
            return true;
    }
    return false;
}

/* d (V,3): how the head moves with a parameter, per unit. */
static void align_face_get_direction(float *d, const struct align_face *f,
                                     int code)
{
    const struct head *h = f->id->head;

    if (code < 0)
        head_direction(d, h, f->id->lids, 2, (size_t)ALIGN_FACE_LID(code));
    else
        head_direction(d, h, h->exp_dirs, h->nexp, (size_t)code);
}

/* Squared movement of a direction (V,3). */
static double align_face_moves(const float *d, size_t V)
{
    double sum = 0;

    for (size_t i = 0; i < 3 * V; i++)
        sum += (double)d[i] * d[i];
    return sum;
}

/* How direction d (V,3) changes the mouth's measures, in their spreads. */
static void align_face_measure(struct align_face *f, size_t k, const float *d)
{
    const struct head *h = f->id->head;

    for (int j = 0; h->has_landmarks && j < ALIGN_FACE_MEASURES; j++) {
        const float scale = f->spread[k] /
                            (align_face_mouth[j].spread * h->scale);

        for (int end = 0; end < 2; end++) {
            const int l = align_face_mouth[j].end[end];
            const int32_t *face = h->f + 3 * h->landmark_faces[l];
            const float *share = h->landmark_bary + 3 * l;

            for (int c = 0; c < 3; c++)
                f->measure[j][k] += (end ? scale : -scale) * share[c] *
                                    d[3 * face[c] + align_face_mouth[j].axis];
        }
    }
}

/* The components that are sought, and how far each vertex goes in them, moves
 * (V), squared; d (V,3) is scratch. */
static void align_face_choose(struct align_face *f, double *moves, float *d)
{
    const struct head *h = f->id->head;
    const int first = ALIGN_FACE_LID(1), end = (int)h->nexp;
    double all[HEAD_MAX_EXP + 2], *whole = all - first, max = 0;

    for (int k = first; k < end; k++) {
        align_face_get_direction(d, f, k);
        whole[k] = align_face_moves(d, h->V);
        max = k < 0 ? 0 : fmax(max, whole[k]);
    }
    for (int k = first; k < end && f->codes < ALIGN_FACE_CODES; k++) {
        if (whole[k] < STILL * STILL * max)
            continue;
        align_face_get_direction(d, f, k);
        for (size_t i = 0; i < 3 * h->V; i++)
            moves[i / 3] += (double)d[i] * d[i];
        f->spread[f->codes] = k < 0 ? LID_SPREAD : SPREAD;
        f->code[f->codes++] = k;
    }
}

/* The points: skin that moves. */
static void align_face_points(struct align_face *f, const double *moves)
{
    const struct head *h = f->id->head;
    const double min = MOVES * h->scale;

    identity_rest(f->verts, f->id);
    for (size_t v = 0; v < h->V; v++)
        if (align_face_is_skin(h, v) && moves[v] > min * min &&
            !align_face_at_edge(h, f->verts, v))
            f->vertex[f->count++] = (int32_t)v;
    f->room = align_room(f->count);
}

/* The directions of the points; d (V,3) is scratch. */
static void align_face_direct(struct align_face *f, float *d)
{
    for (size_t k = 0; k < f->codes; k++) {
        float *to = f->direction + 3 * f->room * k;

        align_face_get_direction(d, f, f->code[k]);
        for (size_t i = 0; i < f->count; i++)
            for (size_t c = 0; c < 3; c++)
                to[c * f->room + i] = f->spread[k] * d[3 * f->vertex[i] + c];
        align_face_measure(f, k, d);
    }
}

/* Points and directions of f's head; moves (V) is 0. */
static int align_face_prepare(struct align_face *f, double *moves,
                              struct error *err)
{
    align_face_choose(f, moves, f->verts);
    align_face_points(f, moves);
    f->unknowns = (ALIGN_FACE_LIGHT + f->codes + 3) / 4 * 4;
    f->point = calloc(6 * f->room + 1, sizeof *f->point);
    f->direction = calloc(3 * f->room * f->codes + 1, sizeof *f->direction);
    if (!f->point || !f->direction)
        return -1;
    f->facing = f->point + 3 * f->room;
    align_face_direct(f, f->verts);
    return head_part_init(&f->part, f->id, f->vertex, f->count, err);
}

int align_face_init(struct align_face *f, const struct identity *id,
                    struct error *err)
{
    const struct head *h = id->head;
    double *moves = calloc(h->V, sizeof *moves);
    int rc = -1;

    memset(f, 0, sizeof *f);
    f->id = id;
    f->vertex = malloc(h->V * sizeof *f->vertex);
    f->verts = malloc(6 * h->V * sizeof *f->verts);
    if (moves && f->vertex && f->verts) {
        f->normal = f->verts + 3 * h->V;
        rc = h->region ? align_face_prepare(f, moves, err) : 0;
    }
    free(moves);
    if (rc == 0)
        return 0;
    align_face_release(f);
    return error_set(err, EX_OSERR, "no memory to align expressions");
}

void align_face_release(struct align_face *f)
{
    head_part_release(&f->part);
    free(f->vertex);
    free(f->verts);
    free(f->point);
    free(f->direction);
    memset(f, 0, sizeof *f);
}

/* m's pose with its expression. */
static struct head_motion align_face_motion(const struct motion *m)
{
    struct head_motion pose = m->pose;

    pose.exp = m->exp;
    return pose;
}

/* The points of m. */
static void align_face_pose(struct align_face *f, const struct motion *m)
{
    const struct head_motion pose = align_face_motion(m);
    const float *at = head_part_pose(&f->part, &pose);

    for (size_t i = 0; i < f->count; i++)
        for (size_t c = 0; c < 3; c++)
            f->point[c * f->room + i] = at[3 * i + c];
}

/* Their normals, of the whole head. */
static void align_face_normals(struct align_face *f, const struct motion *m)
{
    const struct head_motion pose = align_face_motion(m);

    head_pose(f->verts, f->id, &pose);
    head_normals(f->normal, f->id->head, f->verts);
    for (size_t i = 0; i < f->count; i++)
        for (size_t c = 0; c < 3; c++)
            f->facing[c * f->room + i] = f->normal[3 * f->vertex[i] + c];
}

/* How well a keyframe with these lids (2) shows the skin about an open eye. */
static float align_face_openness(const float *lid)
{
    const float t = (SHUT - fmaxf(lid[0], lid[1])) / (SHUT - OPEN);

    return fminf(fmaxf(t, 0), 1);
}

void align_face_show(float *shown, struct align_face *f,
                     const struct motion *m, const align_pixel *picture,
                     const struct align_camera *camera)
{
    const float open = align_face_openness(m->pose.lid);
    float *weight = shown + f->room;

    align_face_pose(f, m);
    align_face_normals(f, m);
    CPU_PICK(align_kernels)->show(shown, weight, f->point, f->facing, f->room,
                                  picture, camera);
    for (size_t i = 0; i < f->room; i++)
        if (i >= f->count || weight[i] < 0)
            weight[i] = 0;
        else if (f->id->head->region[f->vertex[i]] == REGION_EYELID)
            weight[i] *= open;
}

/* Add the priors on the expression x and on the mouth's measures. */
static void align_face_add_priors(struct align_face_sums *s,
                                  const struct align_face *f, const float *x,
                                  double sigma)
{
    const size_t U = f->unknowns, first = ALIGN_FACE_LIGHT;
    const double hold = PRIOR * sigma * sigma;

    for (size_t k = first; k < U; k++) {
        s->a[U * k + k] += hold;
        s->b[k] += hold * x[k];
    }
    for (int j = 0; j < ALIGN_FACE_MEASURES; j++) {
        const double *measure = f->measure[j];
        double off = 0;

        for (size_t k = 0; k < f->codes; k++)
            off += measure[k] * x[first + k];
        for (size_t k = 0; k < f->codes; k++) {
            s->b[first + k] += hold * off * measure[k];
            for (size_t i = 0; i <= k; i++)
                s->a[U * (first + k) + first + i] += hold * measure[k] *
                                                     measure[i];
        }
    }
}

/* One step of x (unknowns): gain, bias and the expression beyond E_m's, in
 * spreads. */
static void align_face_improve(float *x, struct align_face_sums *s,
                               const struct align_face *f, double gain,
                               double sigma)
{
    const size_t U = f->unknowns;
    const double hold = sigma * sigma /
                        (ALIGN_GAIN_SPREAD * ALIGN_GAIN_SPREAD);

    align_face_add_priors(s, f, x, sigma);
    s->a[0] += hold;
    s->b[0] += hold * (x[0] - gain);
    cholesky_solve(s->b, s->a, U);
    for (size_t k = 0; k < U; k++)
        x[k] -= (float)s->b[k];
}

/* Add the steps' result, x (codes) in spreads, to m's parameters. */
static void align_face_store(struct motion *m, const struct align_face *f,
                             const float *x)
{
    float *lid = m->pose.lid;

    for (size_t k = 0; k < f->codes; k++) {
        const int code = f->code[k];
        float *to = code < 0 ? &lid[ALIGN_FACE_LID(code)] : &m->exp[code];

        if (isfinite(x[k]))
            *to += f->spread[k] * x[k];
    }
    for (int side = 0; side < 2; side++)
        lid[side] = fminf(fmaxf(lid[side], 0), 1);
}

void align_face_fit(struct align_face *f, struct motion *m,
                    const float *shown, const align_pixel *picture,
                    const struct align_camera *camera, float gain, float bias)
{
    const struct align_face_points points = {
        f->point, f->direction, shown, shown + f->room, f->room, f->codes};
    float x[ALIGN_FACE_UNKNOWNS] = {gain, bias};
    struct align_face_sums s;
    double sigma = 255;

    if (f->codes == 0)
        return;
    align_face_pose(f, m);
    for (int step = 0; step < STEPS; step++) {
        CPU_PICK(align_kernels)->face(&s, &points, x, f->unknowns, picture,
                                      camera, (float)sigma);
        if (!(s.weight > 0))
            return;
        sigma = align_sigma(s.off, s.weight);
        align_face_improve(x, &s, f, gain, sigma);
    }
    align_face_store(m, f, x + ALIGN_FACE_LIGHT);
}
