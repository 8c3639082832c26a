/* Rotations: gradients against central differences of the double code, round
 * trips, degenerate inputs. */
#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "lib/base/camera.h"
#include "lib/base/relative_pose.h"
#include "lib/base/rotation.h"
#include "tests/check.h"
#include "tests/reference/rotation.h"

typedef void (*forward)(double *R, const double *x);
typedef void (*backward)(double *dx, const double *dR, const double *x);

static void rotation_f6(double *R, const double *x) { rotation_6d_d(R, x); }
static void rotation_b6(double *d, const double *g, const double *x)
{
    rotation_6d_backward_d(d, g, x);
}
static void rotation_fe(double *R, const double *x) { rotation_exp_d(R, x); }
static void rotation_be(double *d, const double *g, const double *x)
{
    rotation_exp_backward_d(d, g, x);
}

/* Largest difference of the gradient from central differences, relative to
 * the gradient's size. */
static double gradient_error(forward f, backward b, const double *x, int n,
                             struct random *r)
{
    double G[9], dx[6] = {0}, worst = 0, size = 1e-3;

    for (int i = 0; i < 9; i++)
        G[i] = random_range(r, -1, 1);
    b(dx, G, x);
    for (int k = 0; k < n; k++)
        size = fmax(size, fabs(dx[k]));
    for (int k = 0; k < n; k++) {
        double y[6], A[9], B[9], d = 0, h = 1e-5;

        memcpy(y, x, (size_t)n * sizeof *y);
        y[k] = x[k] + h;
        f(A, y);
        y[k] = x[k] - h;
        f(B, y);
        for (int i = 0; i < 9; i++)
            d += G[i] * (A[i] - B[i]) / (2 * h);
        worst = fmax(worst, fabs(d - dx[k]) / size);
    }
    return worst;
}

static void rotation_scaled(double *x, int n, double length, struct random *r)
{
    double s = 0;

    for (int i = 0; i < n; i++) {
        x[i] = random_normal(r);
        s += x[i] * x[i];
    }
    for (int i = 0; i < n; i++)
        x[i] *= length / sqrt(s);
}

static double rotation_orthogonality(const double R[9])
{
    double P[9], worst = 0;

    mat3_mul_nt_d(P, R, R);
    for (int i = 0; i < 9; i++)
        worst = fmax(worst, fabs(P[i] - (i % 4 == 0)));
    return worst;
}

static void axis_angles(struct random *r)
{
    static const double length[] = {0, 1e-12, 1e-8, 1e-4, 9.9e-3, 1.01e-2,
                                    0.5, 2, 3.1, M_PI - 1e-6, M_PI};
    double grad = 0, trip = 0, ortho = 0;

    for (size_t i = 0; i < sizeof length / sizeof *length; i++)
        for (int rep = 0; rep < 20; rep++) {
            double x[3], y[3], z[3], R[9], S[9];

            rotation_scaled(x, 3, length[i], r);
            rotation_exp_d(R, x);
            ortho = fmax(ortho, rotation_orthogonality(R));
            grad = fmax(grad,
                        gradient_error(rotation_fe, rotation_be, x, 3, r));
            rotation_log_d(y, R);
            rotation_exp_d(S, y);       /* +-pi are the same rotation */
            for (int k = 0; k < 9; k++)
                trip = fmax(trip, fabs(R[k] - S[k]));
            for (int k = 0; k < 3; k++)
                z[k] = y[k] - x[k];
            if (length[i] < 3.1)
                trip = fmax(trip, fabs(z[0]) + fabs(z[1]) + fabs(z[2]));
        }
    check("exp: R R^T - I", ortho, 1e-14);
    check("exp: gradient by differences", grad, 1e-8);
    check("log(exp(r)) - r", trip, 1e-12);
}

static void rotation_six(struct random *r)
{
    double grad = 0, ortho = 0, x[6], R[9], dx[6], G[9] = {1, 2, 3, 4, 5};

    for (int rep = 0; rep < 100; rep++) {
        rotation_scaled(x, 6, 1.5, r);
        rotation_6d_d(R, x);
        ortho = fmax(ortho, rotation_orthogonality(R));
        grad = fmax(grad, gradient_error(rotation_f6, rotation_b6, x, 6, r));
    }
    check("6D: R R^T - I", ortho, 1e-13);
    /* nearly parallel rows turn fast within a step of 1e-5 */
    check("6D: gradient by differences", grad, 1e-5);
    static const double hard[][6] = {
        {0, 0, 0, 0, 0, 0}, {1, 0, 0, 2, 0, 0}, {0, 0, 0, 1, 0, 0},
        {1e-20, 0, 0, 0, 1, 0}, {1, 0, 0, 1, 1e-13, 0}
    };
    int finite = 1;
    for (size_t i = 0; i < sizeof hard / sizeof *hard; i++) {
        memset(dx, 0, sizeof dx);
        rotation_6d_d(R, hard[i]);
        rotation_6d_backward_d(dx, G, hard[i]);
        for (int k = 0; k < 9; k++)
            finite &= isfinite(R[k]) && (k > 5 || isfinite(dx[k]));
    }
    check("6D: not finite for parallel or zero rows", !finite, 0);
}

static void rotation_quaternions(struct random *r)
{
    double trip = 0;

    for (int rep = 0; rep < 200; rep++) {
        double q[4], R[9];
        float Rf[9], qf[4], dot = 0;

        rotation_scaled(q, 4, rep % 3 + 0.5, r);
        rotation_quat_d(R, q);
        for (int i = 0; i < 9; i++)
            Rf[i] = (float)R[i];
        rotation_to_quat(qf, Rf);
        for (int i = 0; i < 4; i++)
            dot += qf[i] * (float)(q[i] / (rep % 3 + 0.5));
        trip = fmax(trip, fabs(fabs((double)dot) - 1));
    }
    check("quaternion of R of quaternion", trip, 1e-6);
    float A[9], B[9], a[3] = {0.3f, -0.2f, 0.5f}, b[3] = {0.3f, -0.2f, 0.5f};
    rotation_exp(A, a);
    b[1] += 0.01f;
    rotation_exp(B, b);
    check("distance of near rotations - 0.01",
          fabs(rotation_distance(A, B) - 0.01), 5e-4);
    check("distance to itself", rotation_distance(A, A), 1e-6);
}

/* A turn by angle a about an axis of the camera's is 4 sin a times the axis;
 * the light, fixed before the camera, turns the other way round in the head's
 * frame; both are linear in the camera. */
static void rotation_turns(struct random *r)
{
    double worst = 0, dark = 0, grad = 0;

    for (int rep = 0; rep < 100; rep++) {
        static const float nowhere[3] = {0};
        double x[3], angle = 1e-12, change = 0, predicted = 0;
        float Q[9], R[9], QR[9], by_x[3], axis[3], cam[12], moved[12], l[3];
        float t[RELATIVE_POSE_SIZE], t2[RELATIVE_POSE_SIZE];
        float d[RELATIVE_POSE_SIZE], dcam[12] = {0};

        rotation_scaled(x, 3, random_range(r, 0.01, 1.4), r);
        for (int k = 0; k < 3; k++) {
            by_x[k] = (float)x[k];
            axis[k] = (float)random_range(r, -2, 2);
            l[k] = (float)random_range(r, -1, 1);
            angle += x[k] * x[k];
        }
        for (int k = 0; k < RELATIVE_POSE_SIZE; k++)
            d[k] = (float)random_range(r, -1, 1);
        rotation_exp(R, axis);
        rotation_exp(Q, by_x);
        mat3_mul(QR, Q, R);
        camera_make(cam, QR, nowhere);
        angle = sqrt(angle);
        relative_pose(t, R, l, cam);
        for (int k = 0; k < 3; k++) {
            double before = 0, now = 0;
            worst = fmax(worst, fabs((double)t[k] -
                                     4 * sin(angle) * x[k] / angle));
            for (int i = 0; i < 3; i++) {   /* in the camera's frame */
                before += (double)(R[3 * k + i] * l[i]);
                now += (double)(cam[4 * k + i] * (l[i] + t[3 + i] / 4));
            }
            dark = fmax(dark, fabs(before - now));
        }
        relative_pose_backward(dcam, d, R, l);
        for (int i = 0; i < 12; i++) {
            double by = random_range(r, -1, 1);
            moved[i] = cam[i] + (float)by;
            predicted += by * (double)dcam[i];
        }
        relative_pose(t2, R, l, moved);
        for (int k = 0; k < RELATIVE_POSE_SIZE; k++)
            change += (double)d[k] * ((double)t2[k] - (double)t[k]);
        grad = fmax(grad, fabs(change - predicted));
    }
    check("turn: 4 sin a times the axis", worst, 1e-5);
    check("turn: the light stays before the camera", dark, 1e-5);
    check("turn: gradient", grad, 1e-4);
}

int main(void)
{
    struct random r;

    random_init(&r, 8, "geom_rotation");
    axis_angles(&r);
    rotation_six(&r);
    rotation_quaternions(&r);
    rotation_turns(&r);
    return check_status();
}
