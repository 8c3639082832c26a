/* Rotations of any length to unit ones that draw the same: the principal axes
 * of a Gaussian's covariance, by Jacobi's rotations. */
#include <math.h>

#include "lib/net/gagavatar.h"
#include "lib/base/rotation.h"

#define SWEEPS 12

/* R (3,3) of q w,x,y,z taken as it is, as the public rasteriser does. */
static void unit_rotation_raw(double R[9], const float q[4])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double r[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};

    for (int i = 0; i < 9; i++)
        R[i] = r[i];
}

/* Turn A's rows and columns p, q, and E's columns, so that A[p][q] is 0. */
static void unit_rotation_turn(double A[9], double E[9], int p, int q)
{
    const double a = A[3 * p + q];

    if (a == 0)
        return;
    const double t2 = (A[4 * q] - A[4 * p]) / (2 * a);
    const double t = (t2 < 0 ? -1 : 1) / (fabs(t2) + sqrt(t2 * t2 + 1));
    const double c = 1 / sqrt(t * t + 1), s = t * c;

    for (int k = 0; k < 3; k++) {
        const double x = A[3 * k + p], y = A[3 * k + q];

        A[3 * k + p] = c * x - s * y;
        A[3 * k + q] = s * x + c * y;
    }
    for (int k = 0; k < 3; k++) {
        const double x = A[3 * p + k], y = A[3 * q + k];

        A[3 * p + k] = c * x - s * y;
        A[3 * q + k] = s * x + c * y;
    }
    for (int k = 0; k < 3; k++) {
        const double x = E[3 * k + p], y = E[3 * k + q];

        E[3 * k + p] = c * x - s * y;
        E[3 * k + q] = s * x + c * y;
    }
}

/* One Gaussian. */
static void unit_rotation_one(float scale[3], float quat[4])
{
    double R[9], A[9], E[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    float turn[9];

    unit_rotation_raw(R, quat);
    for (int i = 0; i < 9; i++)
        A[i] = R[i - i % 3] * scale[0] * scale[0] * R[i % 3 * 3] +
               R[i - i % 3 + 1] * scale[1] * scale[1] * R[i % 3 * 3 + 1] +
               R[i - i % 3 + 2] * scale[2] * scale[2] * R[i % 3 * 3 + 2];
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        unit_rotation_turn(A, E, 0, 1);
        unit_rotation_turn(A, E, 0, 2);
        unit_rotation_turn(A, E, 1, 2);
    }
    const double det = E[0] * (E[4] * E[8] - E[5] * E[7]) -
                       E[1] * (E[3] * E[8] - E[5] * E[6]) +
                       E[2] * (E[3] * E[7] - E[4] * E[6]);
    for (int i = 0; i < 9; i++)         /* a rotation, not a reflection */
        turn[i] = (float)(det < 0 && i % 3 == 2 ? -E[i] : E[i]);
    for (int i = 0; i < 3; i++)
        scale[i] = (float)sqrt(fmax(A[4 * i], 0));
    rotation_to_quat(quat, turn);
}

void gagavatar_unit_rotations(float *scale, float *quat, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        const float *q = quat + 4 * i;
        const float length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                              q[3] * q[3];

        if (fabsf(length2 - 1) > 1e-5f)
            unit_rotation_one(scale + 3 * i, quat + 4 * i);
    }
}
