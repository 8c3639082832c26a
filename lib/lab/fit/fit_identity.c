/* A person's identity, and the offsets of the labels' points. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/parallel.h"
#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/normal.h"
#include "lib/base/camera.h"

#define N LANDMARK_FACE
#define FIT_SIGMA 2.0           /* pixels; neighbours err alike */
#define FIT_ENOUGH 5            /* frames of a person that add up */
#define FIT_TOLD 12             /* frames that are looked at */
#define FIT_LIVELY 0.4          /* weight of a frame that is not calm */
#define FIT_OWN 0.5             /* ridge of a person's offsets, everyone's: */
#define FIT_COMMON 2.0          /* in points seen from the front */

/* ---- identity ------------------------------------------------------------ */

/* Rows of a frame: shapes, then the pose. */
static void fit_identity_rows(struct normal *e, const struct face_fit *f,
                              const struct fit_person *p,
                              const struct fit_frame *frame)
{
    const struct face_points *q = f->points;
    double x[N][3], row[2][FACE_SHAPES + 6], beta[2];

    fit_points(x, f, p, frame);
    for (size_t i = 0; i < N; i++) {
        double uv[2], j[2][3], pose[2][6];

        /* a person's own offset is what identity did not explain */
        for (size_t c = 0; c < 3; c++)
            x[i][c] -= p->own[i][c];
        fit_project(uv, j, pose, frame, x[i]);
        for (size_t a = 0; a < 2; a++) {
            beta[a] = 0;
            for (size_t k = 0; k < FACE_SHAPES; k++) {
                row[a][k] = 0;
                for (size_t c = 0; c < 3; c++) {
                    double d = q->shape[k * N + i][c];

                    for (size_t s = 0; s < 2; s++)
                        d += frame->w[ARKIT_EYE_BLINK_L + s] *
                             q->lid_shape[(s * FACE_SHAPES + k) * N + i][c];
                    row[a][k] += j[a][c] * d;
                }
                beta[a] += row[a][k] * p->beta[k];
            }
            memcpy(row[a] + FACE_SHAPES, pose[a], sizeof pose[a]);
            normal_add(e, row[a], q->weight[i] / (2 * FIT_SIGMA * FIT_SIGMA),
                       frame->at[i][a] - uv[a] + beta[a]);
        }
    }
    for (size_t k = 0; k < 6; k++)
        normal_prior(e, FACE_SHAPES + k, 1e-6, 0);
}

int fit_identity(struct face_fit *f, struct fit_person *p, struct error *err)
{
    struct normal sum = {0}, one = {0};
    size_t step = (p->count + FIT_TOLD - 1) / FIT_TOLD;
    size_t n = (p->count + step - 1) / step;
    double share = (n < FIT_ENOUGH ? 1 : (double)FIT_ENOUGH / (double)n);

    if (normal_init(&sum, FACE_SHAPES, err) ||
        normal_init(&one, FACE_SHAPES + 6, err)) {
        normal_release(&sum);
        return -1;
    }
    for (size_t k = 0; k < FACE_SHAPES; k++)
        normal_prior(&sum, k, 1, 0);
    for (size_t i = 0; i < p->count; i += step) {
        const struct fit_frame *frame = &f->frame[p->first + i];

        normal_clear(&one);
        fit_identity_rows(&one, f, p, frame);
        normal_reduce(&sum, &one, share * (frame->calm ? 1 : FIT_LIVELY));
    }
    normal_solve(p->beta, &sum);
    face_points_fold(&p->face, f->points, p->beta);
    normal_release(&sum);
    normal_release(&one);
    return 0;
}

/* ---- offsets ------------------------------------------------------------- */

/* What calm frames say about each point: 3x3 normal equations. */
struct fit_pull {
    double a[N][9], b[N][3];
};

/* The mean over a person's calm frames, without any offset. */
PARALLEL(fit_pull_person, person, struct fit_pull *, each,
         const struct face_fit *, f)
{
    const struct fit_person *p = &f->person[person];
    struct fit_pull *s = &each[person];
    double x[N][3], uv[2], j[2][3];
    size_t calm = 0;

    memset(s, 0, sizeof *s);
    for (size_t k = 0; k < p->count; k++)
        calm += f->frame[p->first + k].calm;
    for (size_t k = 0; k < p->count; k++) {
        const struct fit_frame *frame = &f->frame[p->first + k];

        if (!frame->calm)
            continue;
        face_points_pose(x, f->points, &p->face, frame->w);
        for (int i = 0; i < N; i++) {
            struct normal e = {3, s->a[i], s->b[i]};

            fit_project(uv, j, NULL, frame, x[i]);
            for (int c = 0; c < 2; c++)
                normal_add(&e, j[c], 1 / (double)calm,
                           frame->at[i][c] - uv[c]);
        }
    }
}

/* out (468,3) of pulls with a ridge of `ridge` pulls. */
static void fit_pull_solve(double out[N][3], const struct fit_pull *s,
                           double ridge)
{
    for (int i = 0; i < N; i++) {
        double a[9], b[3];
        struct normal e = {3, a, b};

        memcpy(a, s->a[i], sizeof a);
        memcpy(b, s->b[i], sizeof b);
        for (size_t c = 0; c < 3; c++)
            normal_prior(&e, c, ridge, 0);
        normal_solve(out[i], &e);
    }
}

/* Offsets are no motion of the whole: without shift, turn and growth. */
static void fit_offset_centre(double offset[N][3], const struct face_points *p)
{
    double mean[3] = {0}, a[56] = {0}, row[N][3][7], rigid[7];
    struct normal e = {7, a, a + 49};

    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            mean[c] += p->rest[i][c] / N;
    memset(row, 0, sizeof row);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++) {
            int k = (c + 1) % 3, l = (c + 2) % 3;

            row[i][c][c] = 1;
            row[i][c][3 + k] = p->rest[i][l] - mean[l];
            row[i][c][3 + l] = mean[k] - p->rest[i][k];
            row[i][c][6] = p->rest[i][c] - mean[c];
            normal_add(&e, row[i][c], p->weight[i], offset[i][c]);
        }
    normal_solve(rigid, &e);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 7; k++)
                offset[i][c] -= rigid[k] * row[i][c][k];
}

/* What is left for the person, beside everyone's. */
static void fit_pull_own(struct fit_person *p, struct fit_pull *s,
                         const struct face_fit *f, double seen)
{
    for (int i = 0; i < N; i++)
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                s->b[i][r] -= s->a[i][r > c ? 3 * r + c : 3 * c + r] *
                              f->offset[i][c];
    fit_pull_solve(p->own, s, FIT_OWN * seen);
}

int fit_offsets(struct face_fit *f, struct error *err)
{
    /* what a point seen from the front at the usual distance weighs */
    const double seen = pow((double)camera_focal((float)FIT_SIZE) / 12, 2);
    struct fit_pull *s = malloc((f->people + 1) * sizeof *s);

    if (!s)
        return error_set(err, EX_OSERR, "out of memory");
    struct fit_pull *sum = s + f->people;
    memset(sum, 0, sizeof *sum);
    parallel_each(fit_pull_person, f->people, 1, s, f);
    for (size_t k = 0; k < f->people; k++)
        for (size_t i = 0; i < N; i++) {
            for (size_t c = 0; c < 9; c++)
                sum->a[i][c] += s[k].a[i][c];
            for (size_t c = 0; c < 3; c++)
                sum->b[i][c] += s[k].b[i][c];
        }
    fit_pull_solve(f->offset, sum, FIT_COMMON * seen);
    fit_offset_centre(f->offset, f->points);
    for (size_t k = 0; k < f->people; k++)
        fit_pull_own(&f->person[k], &s[k], f, seen);
    free(s);
    return 0;
}
