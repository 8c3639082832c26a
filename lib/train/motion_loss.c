/* The terms of L_aux and L_lmk, forward and backward: the motion is decoded,
 * the head posed and projected, and every term's gradient goes back to E_m's
 * numbers. */
#include "lib/train/motion_loss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/geom/camera.h"
#include "lib/net/motion_code.h"
#include "lib/train/expression_features.h"

const char *const motion_term_name[TERM_COUNT] = {
    "vertex", "rotation", "translation", "eye",
    "landmark", "exp", "jaw", "lid", "mesh", "feature"};

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

/* weight * mean |b - a|; db += scale * gradient. */
static double motion_loss_l1(float *db, const float *b, const float *a,
                             size_t n, double weight, double scale)
{
    double sum = 0;
    float g = (float)(weight * scale / (double)n);

    for (size_t i = 0; i < n; i++) {
        float d = b[i] - a[i];
        sum += fabsf(d);
        db[i] += d > 0 ? g : d < 0 ? -g : 0;
    }
    return weight * sum / (double)n;
}

/* Mean distance of uv (n,2) from truth, or its square, with pixels as if the
 * picture had 512, over 64; uv becomes scale times its gradient. */
static double motion_loss_distance(float *uv, const float *truth, size_t n,
                                   size_t size, int square, double scale)
{
    double unit = 512.0 / (64.0 * (double)size), sum = 0;

    for (size_t i = 0; i < n; i++) {
        double a = (uv[2 * i] - truth[2 * i]) * unit;
        double b = (uv[2 * i + 1] - truth[2 * i + 1]) * unit;
        double r2 = a * a + b * b, r = sqrt(r2 + 1e-8);
        double k = scale * unit / (double)n * (square ? 2 : 1 / r);
        sum += square ? r2 : r;
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
                                w->square_landmarks, weight * scale);
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

    camera_make(cam, f->motion.rot, f->motion.trans);
    camera_project(l->uv_truth, NULL, cam, (float)f->size, l->truth, V);
    camera_project(l->uv, NULL, s->cam, (float)f->size, s->verts, V);
    mean = motion_loss_distance(l->uv, l->uv_truth, V, f->size, 0,
                                weight * scale);
    camera_project_backward(dverts, dcam, l->uv, NULL, s->cam,
                            (float)f->size, s->verts, V);
    return weight * mean;
}

/* What lips, lids and brows do, against the truly posed head (l->truth). */
static double motion_loss_features(float *dverts, const struct motion_state *s,
                                   const struct motion_weights *w,
                                   double scale, const struct motion_loss *l)
{
    enum { N = EXPRESSION_FEATURES };
    const struct head *h = l->id->head;
    const float unit = 1000 / h->scale;         /* millimetres */
    float x[68 * 3], dx[68 * 3] = {0}, f[N], truth[N], df[N] = {0};
    double sum;

    head_landmarks(x, h, l->truth);
    expression_features(truth, x);
    head_landmarks(x, h, s->verts);
    expression_features(f, x);
    for (int k = 0; k < N; k++) {
        f[k] *= unit;
        truth[k] *= unit;
    }
    sum = motion_loss_l1(df, f, truth, N, w->term[TERM_FEATURE], scale);
    for (int k = 0; k < N; k++)
        df[k] *= unit;
    expression_features_backward(dx, df, x);
    head_landmarks_backward(dverts, dx, h);
    return sum;
}

double motion_loss(float *dout, double *parts, struct motion_state *s,
                   const float *out, const struct data_frame *f,
                   struct square q, const struct motion_weights *w,
                   double scale, struct motion_loss *l)
{
    const struct data_motion *m = &f->motion;
    const struct head *h = l->id->head;
    struct head_motion truth = {.exp = m->exp};
    float dcam[12] = {0}, dR[9] = {0}, tnet[3];
    double t[3], before = 0, after = 0;

    for (int i = 0; i < TERM_COUNT; i++)
        before += parts[i];
    memcpy(truth.jaw, m->jaw, sizeof truth.jaw);
    memcpy(truth.eye, m->eye, sizeof truth.eye);
    memcpy(truth.lid, m->lid, sizeof truth.lid);
    head_pose(l->truth, l->id, &truth);
    s->verts = l->verts;
    motion_decode(s, out, f, q, l->id);

    memset(l->dverts, 0, 3 * h->V * sizeof *l->dverts);
    parts[TERM_VERTEX] += motion_loss_l1(
        l->dverts, s->verts, l->truth, 3 * h->V, w->term[TERM_VERTEX], scale);
    parts[TERM_ROTATION] +=
        motion_loss_l1(dR, s->R, m->rot, 9, w->term[TERM_ROTATION], scale);
    for (int i = 0; i < 9; i++)
        dcam[i / 3 * 4 + i % 3] += dR[i];
    if (h->has_landmarks && w->term[TERM_LANDMARK] > 0)
        parts[TERM_LANDMARK] +=
            motion_loss_landmarks(l->dverts, dcam, s, f, w, scale, l);
    if (w->term[TERM_MESH] > 0)
        parts[TERM_MESH] +=
            motion_loss_mesh(l->dverts, dcam, s, f, w, scale, l);
    if (h->has_landmarks && w->term[TERM_FEATURE] > 0)
        parts[TERM_FEATURE] +=
            motion_loss_features(l->dverts, s, w, scale, l);
    motion_decode_backward(dout, l->dverts, dcam, s, out, f, q, l->id);

    data_net_translation(t, f, q);
    for (int i = 0; i < 3; i++)
        tnet[i] = (float)t[i];
    parts[TERM_TRANSLATION] +=
        motion_loss_l1(dout + MOTION_TRANS, out + MOTION_TRANS, tnet, 3,
                       w->term[TERM_TRANSLATION], scale);
    parts[TERM_EYE] += motion_loss_l1(dout + MOTION_EYE, out + MOTION_EYE,
                                      m->eye, 6, w->term[TERM_EYE], scale);
    parts[TERM_EXP] +=
        motion_loss_l1(dout + MOTION_EXP, out + MOTION_EXP, m->exp, DATA_EXP,
                       w->term[TERM_EXP], scale);
    parts[TERM_JAW] += motion_loss_l1(dout + MOTION_JAW, out + MOTION_JAW,
                                      m->jaw, 3, w->term[TERM_JAW], scale);
    parts[TERM_LID] += motion_loss_l1(dout + MOTION_LID, out + MOTION_LID,
                                      m->lid, 2, w->term[TERM_LID], scale);
    for (int i = 0; i < TERM_COUNT; i++)
        after += parts[i];
    return after - before;
}
