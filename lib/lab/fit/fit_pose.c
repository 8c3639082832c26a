/* The camera of a frame, and what it makes of points. */
#include <math.h>
#include <string.h>

#include "lib/lab/fit/face_fit.h"
#include "lib/lab/fit/normal.h"
#include "lib/base/camera.h"
#include "lib/base/rotation.h"

#define N LANDMARK_FACE
#define FIT_ROBUST 3.0          /* pixels from which a point counts less */
#define FIT_MOVING 0.3          /* lips' and lids' share in the pose */

void fit_points(double x[N][3], const struct face_fit *f,
                const struct fit_person *p, const struct fit_frame *frame)
{
    double share[N];

    for (int i = 0; i < N; i++)
        share[i] = 1;
    for (int side = 0; side < 2; side++)
        for (int i = 0; i < LANDMARK_LID; i++)
            share[landmark_lid[side][i]] =
                1 - frame->w[ARKIT_EYE_BLINK_L + side];
    face_points_pose(x, f->points, &p->face, frame->w);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            x[i][c] += share[i] * (f->offset[i][c] + p->own[i][c]);
}

void fit_project(double uv[2], double j[2][3], double pose[2][6],
                 const struct fit_frame *frame, const double x[3])
{
    const double focal = (double)camera_focal((float)FIT_SIZE);
    double y[3], c[3];

    for (int i = 0; i < 3; i++) {
        y[i] = frame->R[3 * i] * x[0] + frame->R[3 * i + 1] * x[1] +
               frame->R[3 * i + 2] * x[2];
        c[i] = y[i] + frame->t[i];
    }
    const double z = fmax(c[2], (double)CAMERA_NEAR), g = focal / z;
    for (int a = 0; a < 2; a++) {
        double dc[3] = {a ? 0 : g, a ? g : 0, -g * c[a] / z};

        uv[a] = FIT_SIZE / 2 + g * c[a];
        for (int i = 0; j && i < 3; i++)
            j[a][i] = dc[0] * frame->R[i] + dc[1] * frame->R[3 + i] +
                      dc[2] * frame->R[6 + i];
        if (!pose)
            continue;
        for (int i = 0; i < 3; i++) {   /* of y by a turn w: w x y */
            int k = (i + 1) % 3, l = (i + 2) % 3;

            pose[a][i] = y[k] * dc[l] - y[l] * dc[k];
            pose[a][3 + i] = dc[i];
        }
    }
}

/* The lips and lids move; the rest holds the head. */
static void fit_pose_weights(double *weight, const struct face_points *p)
{
    memcpy(weight, p->weight, sizeof p->weight);
    for (int i = 0; i < LANDMARK_LIP; i++)
        weight[landmark_lip[i]] *= FIT_MOVING;
    for (int i = 0; i < 2 * LANDMARK_LID; i++)
        weight[landmark_lid[i / LANDMARK_LID][i % LANDMARK_LID]] *=
            FIT_MOVING;
}

/* Turn and shift the camera by d (6). */
static void fit_move(struct fit_frame *frame, const double d[6])
{
    double turn[9], R[9];

    rotation_exp_d(turn, d);
    mat3_mul_d(R, turn, frame->R);
    memcpy(frame->R, R, sizeof R);
    for (int i = 0; i < 3; i++)
        frame->t[i] += d[3 + i];
}

void fit_pose(const struct face_fit *f, const struct fit_person *p,
              struct fit_frame *frame, int steps)
{
    double x[N][3], weight[N], d[6], a[42];
    struct normal e = {6, a, a + 36};

    fit_points(x, f, p, frame);
    fit_pose_weights(weight, f->points);
    for (int s = 0; s < steps; s++) {
        normal_clear(&e);
        for (int i = 0; i < N; i++) {
            double uv[2], row[2][6];

            fit_project(uv, NULL, row, frame, x[i]);
            for (int c = 0; c < 2; c++) {
                double r = frame->at[i][c] - uv[c];
                double far = r / FIT_ROBUST;

                /* coarse first steps see all points alike */
                normal_add(&e, row[c], weight[i] /
                           (steps > 4 && s < 4 ? 1 : 1 + far * far), r);
            }
        }
        for (size_t k = 0; k < 6; k++)
            e.a[7 * k] *= 1 + 1e-9;
        normal_solve(d, &e);
        fit_move(frame, d);
    }
}
