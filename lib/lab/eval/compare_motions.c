/* Motion metrics of two streams: angles and landmarks frame by frame, jaw and
 * lids as curves over the clip. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/list.h"
#include "lib/lab/eval/compare.h"
#include "lib/base/camera.h"
#include "lib/lab/eval/motion.h"
#include "lib/head/motion.h"
#include "lib/stream/records.h"

enum { AKD, AED, APD, POSE, YAW, PITCH, ROLL, LANDMARK, JAW, BLINK, COUNT };
static const char *const name[COUNT] = {
    "akd", "aed", "apd", "pose_deg", "yaw_deg", "pitch_deg", "roll_deg",
    "landmark_pct", "jaw_corr", "blink_corr"};
static const int better[COUNT] = {-1, -1, -1, -1, -1, -1, -1, -1, 1, 1};

/* One motion: what is compared of it. */
struct pose {
    float R[9], jaw[3], lid[2], lmk[68][2];
    int has_lmk;
};

struct clip {
    struct pose *pose;
    size_t count, room;
};

/* Reading state of one stream. */
struct side {
    struct clip clip;
    const struct head *head;
    struct identity id;
    float *verts;
    double size;            /* of the pictures lmk is given in */
};

/* The stream's shape into the head. */
static int motions_side_fold(struct side *s, const struct record *rec,
                             struct error *err)
{
    struct shape shape;

    if (!s->head)
        return 0;
    if (shape_read(&shape, rec, err))
        return -1;
    identity_release(&s->id);
    return head_fold(&s->id, s->head, shape.beta,
                     shape.n > s->head->nshape ? s->head->nshape : shape.n,
                     err);
}

/* Landmarks of the head with this motion, pixels of a 512 picture. */
static int motions_side_project(struct side *s, struct pose *p,
                                const struct motion *m, struct error *err)
{
    float cam[12], x[68 * 3];

    if (!s->head || !s->head->has_landmarks)
        return 0;
    if (!s->verts)
        s->verts = malloc(3 * s->head->V * sizeof *s->verts);
    if (!s->verts)
        return error_set(err, EX_OSERR, "out of memory");
    if (!s->id.head && head_fold(&s->id, s->head, NULL, 0, err))
        return -1;
    motion_camera(cam, m);
    head_pose(s->verts, &s->id, &m->pose);
    head_landmarks(x, s->head, s->verts);
    camera_project(&p->lmk[0][0], NULL, cam, 512, x, 68);
    p->has_lmk = 1;
    return 0;
}

/* The pose of a MOTN record. */
static int motions_side_take(struct side *s, const struct record *rec,
                             struct error *err)
{
    size_t nexp = s->head ? s->head->nexp : 100;
    struct motion m;
    struct pose *p = list_add(&s->clip.pose, &s->clip.count, &s->clip.room,
                              sizeof *p, err);

    if (!p || motion_read(&m, rec, nexp, err) ||
        (p->has_lmk = motion_read_landmarks(p->lmk, rec, err)) < 0)
        return -1;
    memcpy(p->R, m.R, sizeof p->R);
    memcpy(p->jaw, m.pose.jaw, sizeof p->jaw);
    memcpy(p->lid, m.pose.lid, sizeof p->lid);
    for (int i = 0; p->has_lmk && i < 68; i++)
        for (int k = 0; k < 2; k++)
            p->lmk[i][k] *= (float)(512 / s->size);
    return p->has_lmk ? 0 : motions_side_project(s, p, &m, err);
}

/* A record of a stream, whose pictures tell the size of landmarks. */
static int motions_side_record(const struct record *rec, void *side,
                               struct error *err)
{
    struct side *s = side;
    const double size = record_is(rec, RECORD_IMAG) ? (double)imag_size(rec)
                                                    : 0;

    if (size > 0 && size != s->size) {
        /* The size is known only now: bring what came before to 512. */
        const float k = (float)(s->size / size);

        for (size_t i = 0; i < s->clip.count; i++)
            for (int j = 0; j < 136; j++)
                (&s->clip.pose[i].lmk[0][0])[j] *= k;
        s->size = size;
    }
    return record_is(rec, RECORD_SHAP)   ? motions_side_fold(s, rec, err)
           : record_is(rec, RECORD_MOTN) ? motions_side_take(s, rec, err) : 0;
}

/* All poses of a stream. */
static int motions_side_read(struct side *s, const char *path,
                             struct error *err)
{
    s->size = 512;
    if (stream_load(path, motions_side_record, s, err))
        return -1;
    return s->clip.count ? 0 : error_set(err, EX_DATAERR, "%s: no MOTN records",
                                         path);
}

/* What motions_side_read left. */
static void motions_side_release(struct side *s)
{
    identity_release(&s->id);
    free(s->verts);
    free(s->clip.pose);
}

/* Figures of two poses; NaN where there is none. */
static void motions_measure(double v[COUNT], const struct pose *a,
                            const struct pose *b)
{
    struct metric_points m;
    double ea[3], eb[3];

    for (int k = 0; k < COUNT; k++)
        v[k] = NAN;
    if (a->has_lmk && b->has_lmk) {
        const float(*pa)[2] = (const float(*)[2])a->lmk;
        metric_points(&m, pa, (const float(*)[2])b->lmk);
        v[AKD] = m.akd;
        v[AED] = m.aed;
        v[APD] = m.apd;
        v[LANDMARK] = 100 * m.akd / metric_eye_distance(pa);
    }
    v[POSE] = metric_rotation_degrees(a->R, b->R);
    metric_euler_degrees(ea, a->R);
    metric_euler_degrees(eb, b->R);
    for (int k = 0; k < 3; k++)
        v[YAW + k] = fabs(remainder(ea[k] - eb[k], 360));
}

/* Correlations over the whole clip: one value each. */
static int motions_curves(double v[COUNT], const struct clip *a,
                          const struct clip *b, struct error *err)
{
    size_t n = a->count;
    double *x = malloc(4 * n * sizeof *x);

    if (!x)
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t i = 0; i < n; i++) {
        const struct pose *p[2] = {&a->pose[i], &b->pose[i]};
        for (int k = 0; k < 2; k++) {
            x[(size_t)k * n + i] = metric_jaw_open(p[k]->jaw);
            x[(size_t)(2 + k) * n + i] = 0.5 * (p[k]->lid[0] + p[k]->lid[1]);
        }
    }
    v[JAW] = metric_correlation(x, x + n, n);
    v[BLINK] = metric_correlation(x + 2 * n, x + 3 * n, n);
    free(x);
    return 0;
}

/* Figures of two clips of one length into the table and the log. */
static int motions_compare(struct table *t, size_t row, const struct clip *a,
                           const struct clip *b, const struct compare_log *log,
                           struct error *err)
{
    double v[COUNT];

    compare_log_names(log, name, JAW);
    for (size_t i = 0; i < a->count; i++) {
        motions_measure(v, &a->pose[i], &b->pose[i]);
        for (int k = 0; k < JAW; k++)
            table_add(t, row, table_column(t, name[k], better[k]), v[k]);
        compare_log_frame(log, i, v, JAW);
    }
    if (motions_curves(v, a, b, err))
        return -1;
    for (int k = JAW; k < COUNT; k++)
        table_add(t, row, table_column(t, name[k], better[k]), v[k]);
    return 0;
}

int compare_motions(struct table *t, size_t row, const char *truth,
                    const char *result, const struct head *h,
                    const struct compare_log *log, struct error *err)
{
    struct side a = {.head = h}, b = {.head = h};
    int rc = -1;

    if (motions_side_read(&a, truth, err) || motions_side_read(&b, result, err))
        goto out;
    if (a.clip.count != b.clip.count)
        error_set(err, EX_DATAERR, "%s: %zu motions, %s: %zu (expected as "
                  "many)", truth, a.clip.count, result, b.clip.count);
    else
        rc = motions_compare(t, row, &a.clip, &b.clip, log, err);
out:
    motions_side_release(&a);
    motions_side_release(&b);
    return rc;
}
