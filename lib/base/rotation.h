/* Rotations: 6D columns of the motion head, axis-angle, quaternions; each
 * with its gradient.  Matrices are 3x3, row-major.  All arithmetic is double
 * (there are a handful per frame): the float functions round once at the end,
 * the _d functions are what the tests compare with finite differences.
 * Gradients are added to their output.  Nothing here can fail. */
#ifndef SPID_BASE_ROTATION_H
#define SPID_BASE_ROTATION_H

#include <math.h>

/* Eq. rot.  R (3,3) from x (6) = two vectors a1, a2, by Gram-Schmidt
 * (Zhou et al. 2019): rows b1 = n(a1), b2 = n(a2 - (b1.a2) b1), b3 = b1 x b2,
 * n(v) = v / max(|v|, 1e-12).  Parallel or zero vectors give finite numbers,
 * not a rotation. */
void rotation_6d(float R[9], const float x[6]);
/* rotation_6d in double precision, ... */
void rotation_6d_d(double R[9], const double x[6]);
/* dx (6) += gradient, given dR (3,3); below the clamp of n it is g / 1e-12. */
void rotation_6d_backward(float dx[6], const float dR[9], const float x[6]);
/* ... and its backward. */
void rotation_6d_backward_d(double dx[6], const double dR[9],
                            const double x[6]);
/* The 6D form of a rotation: its first two rows. */
void rotation_to_6d(float x[6], const float R[9]);

/* R = exp([r]x), exact for every angle including 0 and pi; r (3) is axis times
 * angle in radians. */
void rotation_exp(float R[9], const float r[3]);
/* rotation_exp in double precision. */
void rotation_exp_d(double R[9], const double r[3]);
/* dr (3) += gradient, given dR (3,3); a series takes over near 0. */
void rotation_exp_backward_d(double dr[3], const double dR[9],
                             const double r[3]);

/* Rodrigues' formula as the public FLAME code writes it: angle a = |r + 1e-8|
 * (added to each component), axis r / a.  Within 2e-8 of rotation_exp; kept to
 * reproduce reference numbers. */
void rotation_rodrigues_eps_d(double R[9], const double r[3]);
/* dr (3) += its gradient. */
void rotation_rodrigues_eps_backward_d(double dr[3], const double dR[9],
                                       const double r[3]);

/* Axis-angle of a rotation, angle in [0, pi]; accurate near 0 and pi. */
void rotation_log(float r[3], const float R[9]);
/* The same in double precision. */
void rotation_log_d(double r[3], const double R[9]);

/* Unit quaternion w,x,y,z with w >= 0 of a rotation. */
void rotation_to_quat(float q[4], const float R[9]);

/* Angle in radians between two rotations, 0 to pi. */
double rotation_distance(const float A[9], const float B[9]);

/* C = A B, C = A B^T, C = A^T B; C must not be A or B. */
void mat3_mul(float C[9], const float A[9], const float B[9]);
/* C = A B. */
void mat3_mul_d(double C[9], const double A[9], const double B[9]);
/* C = A B^T. */
void mat3_mul_nt_d(double C[9], const double A[9], const double B[9]);
/* C = A^T B. */
void mat3_mul_tn_d(double C[9], const double A[9], const double B[9]);

/* ---- vectors ------------------------------------------------------------- */

static inline double dot3_d(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* o = a x b, neither of which it may be. */
static inline void cross3_d(double o[3], const double a[3], const double b[3])
{
    o[0] = a[1] * b[2] - a[2] * b[1];
    o[1] = a[2] * b[0] - a[0] * b[2];
    o[2] = a[0] * b[1] - a[1] * b[0];
}

/* Between two points. */
static inline double distance3_d(const double a[3], const double b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];

    return sqrt(x * x + y * y + z * z);
}
static inline double distance3(const float a[3], const float b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];

    return sqrt(x * x + y * y + z * z);
}

#endif
