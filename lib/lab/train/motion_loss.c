/* The terms of L_aux and L_lmk, forward and backward: the motion is decoded,
 * the head posed and projected, and every term's gradient goes back to E_m's
 * numbers. */
#include "lib/lab/train/motion_loss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/camera.h"
#include "lib/net/motion_code.h"

const char *const motion_term_name[TERM_COUNT] = {
    "vertex", "rotation", "translation", "eye",
    "landmark", "exp", "jaw", "lid", "mesh", "feature", "change"};

void motion_decode(struct motion_state *s, const float *out,
                   const struct data_frame *f, struct square q,
                   const struct identity *id)
{
    motion_code_decode(s->R, s->t, &s->motion, out, q, (double)f->size);
    camera_make(s->cam, s->R, s->t);
    head_pose(s->verts, id, &s->motion);
}

void motion_decode_backward(float *dout, const float *dverts,
                            const float *dcam, const struct motion_state *s,
                            const float *out, const struct data_frame *f,
                            struct square q, const struct identity *id)
{
    struct head_motion_grad g = motion_code_gradient(dout);

    if (dverts)
        head_pose_backward(&g, dverts, NULL, id, &s->motion);
    motion_code_decode_backward(dout, dverts ? &g : NULL, dcam, out, q,
                                (double)f->size);
}

int motion_loss_init(struct motion_loss *l, const struct head *h,
                     struct error *err)
{
    memset(l, 0, sizeof *l);
    l->verts = malloc((3 * 3 + 2 * 2) * h->V * sizeof *l->verts);
    if (!l->verts)
        return error_set(err, EX_OSERR, "out of memory (%zu vertices)",
                         h->V);
    l->truth = l->verts + 3 * h->V;
    l->dverts = l->truth + 3 * h->V;
    l->uv = l->dverts + 3 * h->V;
    l->uv_truth = l->uv + 2 * h->V;
    return 0;
}

void motion_loss_release(struct motion_loss *l)
{
    free(l->verts);
    memset(l, 0, sizeof *l);
}

/* Errors of this size end the squares of Huber's function (1964) at huber 1.
 * Below, the mean is learned; beyond, the median, which of what is rare and not
 * sure is nothing: a smirk in one face of twenty is no smirk. */
static const float motion_loss_unit[TERM_COUNT] = {
    [TERM_VERTEX] = 3e-3f,          /* metres */
    [TERM_LANDMARK] = 6.0f / 64,    /* 6 pixels of 512 */
    [TERM_MESH] = 6.0f / 64,
    [TERM_EXP] = 0.3f,
    [TERM_JAW] = 0.1f,              /* radians */
    [TERM_LID] = 0.3f,
    [TERM_FEATURE] = 4              /* millimetres */
};

/* Huber's function of an error of size r >= 0: r - delta / 2 beyond delta, a
 * parabola below.  *slope = its derivative. */
static double motion_loss_huber(double *slope, double r, double delta)
{
    *slope = r < delta ? r / delta : 1;
    return r < delta ? r * r / (2 * delta) : r - delta / 2;
}

/* weight * mean of Huber's |b - a|; db += scale * gradient. */
static double motion_loss_mean(float *db, const float *b, const float *a,
                               size_t n, double weight, double scale,
                               double delta)
{
    double sum = 0, g = weight * scale / (double)n, slope;

    for (size_t i = 0; i < n; i++) {
        double d = (double)b[i] - a[i];

        sum += motion_loss_huber(&slope, fabs(d), delta);
        db[i] += (float)(d > 0 ? g * slope : -g * slope);
    }
    return weight * sum / (double)n;
}

/* e = b - a (n). */
static void motion_error_numbers(float *e, const float *b, const float *a,
                                 size_t n)
{
    for (size_t i = 0; i < n; i++)
        e[i] = b[i] - a[i];
}

/* What of E_m's numbers is compared as it stands. */
static const struct {
    enum motion_term term;
    size_t at, n;
} motion_loss_part[] = {
    {TERM_TRANSLATION, MOTION_TRANS, 3}, {TERM_EYE, MOTION_EYE, 6},
    {TERM_EXP, MOTION_EXP, DATA_EXP}, {TERM_JAW, MOTION_JAW, 3},
    {TERM_LID, MOTION_LID, 2}
};
enum { PARTS = sizeof motion_loss_part / sizeof *motion_loss_part };

/* A term of n numbers: their distance from the truth, and how much of it the
 * partner's errors (n, or NULL) do not share. */
static void motion_loss_numbers(float *db, double *parts, enum motion_term term,
                                const float *b, const float *a, size_t n,
                                const float *partner,
                                const struct motion_weights *w, double scale)
{
    const double weight = w->term[term];
    const double delta = w->huber * motion_loss_unit[term];
    float error[DATA_EXP];

    parts[term] += motion_loss_mean(db, b, a, n, weight, scale, delta);
    if (!partner)
        return;
    motion_error_numbers(error, b, a, n);
    parts[TERM_CHANGE] += motion_loss_mean(db, error, partner, n,
                                           weight * w->term[TERM_CHANGE],
                                           scale, delta);
}

/* Mean of Huber's distance of uv (n,2) from truth, or of its square, with
 * pixels as if the picture had 512, over 64; uv becomes scale times its
 * gradient. */
static double motion_loss_distance(float *uv, const float *truth, size_t n,
                                   size_t size, bool square, double delta,
                                   double scale)
{
    double unit = 512 / (64 * (double)size), sum = 0;

    for (size_t i = 0; i < n; i++) {
        double a = (uv[2 * i] - truth[2 * i]) * unit;
        double b = (uv[2 * i + 1] - truth[2 * i + 1]) * unit;
        double r2 = a * a + b * b, r = sqrt(r2 + 1e-8), slope;
        double value = motion_loss_huber(&slope, r, delta);
        double k = scale * unit / (double)n * (square ? 2 : slope / r);

        sum += square ? r2 : value;
        uv[2 * i] = (float)(k * a);
        uv[2 * i + 1] = (float)(k * b);
    }
    return sum / (double)n;
}

/* Landmarks of the posed head in the picture; gradients for dverts, dcam. */
static double motion_loss_landmarks(float *dverts, float dcam[12],
                                    const struct motion_state *s,
                                    const struct data_frame *f,
                                    const struct motion_weights *w,
                                    double scale, const struct motion_loss *l)
{
    const struct head *h = l->id->head;
    float x[68 * 3], uv[68 * 2], dx[68 * 3] = {0};
    double weight = w->term[TERM_LANDMARK], mean;

    head_landmarks(x, h, s->verts);
    camera_project(uv, NULL, s->cam, (float)f->size, x, 68);
    mean = motion_loss_distance(uv, &f->lmk[0][0], 68, f->size,
                                w->square_landmarks,
                                w->huber * motion_loss_unit[TERM_LANDMARK],
                                weight * scale);
    camera_project_backward(dx, dcam, uv, NULL, s->cam, (float)f->size, x,
                            68);
    head_landmarks_backward(dverts, dx, h);
    return weight * mean;
}

/* All of the posed head in the picture against the truly posed one (l->truth):
 * what of a wrong camera shows in hair and shoulders, too. */
static double motion_loss_mesh(float *dverts, float dcam[12],
                               const struct motion_state *s,
                               const struct data_frame *f,
                               const struct motion_weights *w, double scale,
                               const struct motion_loss *l)
{
    size_t V = l->id->head->V;
    double weight = w->term[TERM_MESH], mean;
    float cam[12];

    motion_camera(cam, &f->motion);
    camera_project(l->uv_truth, NULL, cam, (float)f->size, l->truth, V);
    camera_project(l->uv, NULL, s->cam, (float)f->size, s->verts, V);
    mean = motion_loss_distance(l->uv, l->uv_truth, V, f->size, false,
                                w->huber * motion_loss_unit[TERM_MESH],
                                weight * scale);
    camera_project_backward(dverts, dcam, l->uv, NULL, s->cam,
                            (float)f->size, s->verts, V);
    return weight * mean;
}

/* What lips, lids and brows of posed vertices do, in millimetres; x (68,3):
 * their landmarks. */
static void motion_loss_measure(float f[EXPRESSION_FEATURES], float *x,
                                const struct head *h, const float *verts)
{
    head_landmarks(x, h, verts);
    expression_features(f, x);
    for (int k = 0; k < EXPRESSION_FEATURES; k++)
        f[k] *= 1000 / h->scale;
}

/* The same against the truly posed head (l->truth). */
static void motion_loss_features(float *dverts, double *parts,
                                 const struct motion_state *s,
                                 const struct motion_weights *w, double scale,
                                 const struct motion_loss *l)
{
    enum { N = EXPRESSION_FEATURES };
    const struct head *h = l->id->head;
    float x[68 * 3], dx[68 * 3] = {0}, f[N], truth[N], df[N] = {0};

    motion_loss_measure(truth, x, h, l->truth);
    motion_loss_measure(f, x, h, s->verts);
    motion_loss_numbers(df, parts, TERM_FEATURE, f, truth, N,
                        l->partner ? l->partner->feature : NULL, w, scale);
    for (int k = 0; k < N; k++)
        df[k] *= 1000 / h->scale;
    expression_features_backward(dx, df, x);
    head_landmarks_backward(dverts, dx, h);
}

/* l->truth = the head as it truly is posed. */
static void motion_loss_pose_truth(struct motion_loss *l,
                                   const struct motion *m)
{
    struct head_motion truth = m->pose;

    truth.exp = m->exp;
    head_pose(l->truth, l->id, &truth);
}

/* code = what E_m should say of f, seen through crop q: those parts. */
static void motion_loss_true_code(float code[MOTION_OUT],
                                  const struct data_frame *f, struct square q)
{
    const struct motion *m = &f->motion;
    double precise[3];

    data_net_translation(precise, f, q);
    for (int k = 0; k < 3; k++)
        code[MOTION_TRANS + k] = (float)precise[k];
    memcpy(code + MOTION_EYE, m->pose.eye, sizeof m->pose.eye);
    memcpy(code + MOTION_EXP, m->exp, DATA_EXP * sizeof *code);
    memcpy(code + MOTION_JAW, m->pose.jaw, sizeof m->pose.jaw);
    memcpy(code + MOTION_LID, m->pose.lid, sizeof m->pose.lid);
}

void motion_error(struct motion_error *e, const float *out,
                  const struct data_frame *f, struct square q,
                  struct motion_loss *l)
{
    const struct motion *m = &f->motion;
    struct motion_state s = {.verts = l->verts};
    float code[MOTION_OUT] = {0};

    motion_decode(&s, out, f, q, l->id);
    motion_loss_true_code(code, f, q);
    motion_error_numbers(e->rotation, s.R, m->R, 9);
    motion_error_numbers(e->code, out, code, MOTION_OUT);
    if (l->id->head->has_landmarks) {
        float x[68 * 3], found[EXPRESSION_FEATURES], truth[EXPRESSION_FEATURES];

        motion_loss_pose_truth(l, m);
        motion_loss_measure(truth, x, l->id->head, l->truth);
        motion_loss_measure(found, x, l->id->head, s.verts);
        motion_error_numbers(e->feature, found, truth, EXPRESSION_FEATURES);
    }
}

/* What E_m says number by number: dout, parts as in motion_loss. */
static void motion_loss_code(float *dout, double *parts, const float *out,
                             const struct data_frame *f, struct square q,
                             const struct motion_weights *w, double scale,
                             const struct motion_error *p)
{
    float code[MOTION_OUT];

    motion_loss_true_code(code, f, q);
    for (int i = 0; i < PARTS; i++) {
        const size_t at = motion_loss_part[i].at;

        motion_loss_numbers(dout + at, parts, motion_loss_part[i].term,
                            out + at, code + at, motion_loss_part[i].n,
                            p ? p->code + at : NULL, w, scale);
    }
}

double motion_loss(float *dout, double *parts, struct motion_state *s,
                   const float *out, const struct data_frame *f,
                   struct square q, const struct motion_weights *w,
                   double scale, struct motion_loss *l)
{
    const struct motion *m = &f->motion;
    const struct motion_error *p = l->partner;
    const struct head *h = l->id->head;
    float dcam[12] = {0}, dR[9] = {0};
    double before = 0, after = 0;

    for (int i = 0; i < TERM_COUNT; i++)
        before += parts[i];
    motion_loss_pose_truth(l, m);
    s->verts = l->verts;
    motion_decode(s, out, f, q, l->id);

    memset(l->dverts, 0, 3 * h->V * sizeof *l->dverts);
    parts[TERM_VERTEX] += motion_loss_mean(
        l->dverts, s->verts, l->truth, 3 * h->V, w->term[TERM_VERTEX], scale,
        w->huber * motion_loss_unit[TERM_VERTEX] * h->scale);
    motion_loss_numbers(dR, parts, TERM_ROTATION, s->R, m->R, 9,
                        p ? p->rotation : NULL, w, scale);
    for (int i = 0; i < 9; i++)
        dcam[i / 3 * 4 + i % 3] += dR[i];
    if (h->has_landmarks && w->term[TERM_LANDMARK] > 0)
        parts[TERM_LANDMARK] +=
            motion_loss_landmarks(l->dverts, dcam, s, f, w, scale, l);
    if (w->term[TERM_MESH] > 0)
        parts[TERM_MESH] +=
            motion_loss_mesh(l->dverts, dcam, s, f, w, scale, l);
    if (h->has_landmarks && w->term[TERM_FEATURE] > 0)
        motion_loss_features(l->dverts, parts, s, w, scale, l);
    motion_decode_backward(dout, l->dverts, dcam, s, out, f, q, l->id);
    motion_loss_code(dout, parts, out, f, q, w, scale, p);
    for (int i = 0; i < TERM_COUNT; i++)
        after += parts[i];
    return after - before;
}
