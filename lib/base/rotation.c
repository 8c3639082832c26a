/* Rotations as 6D (Zhou et al. 2019), axis-angle, quaternion and matrix, in
 * double precision, with gradients that stay finite everywhere. */
#include "lib/base/rotation.h"

#include <math.h>

/* Below this length a vector has no direction (the public code's clamp). */
#define TINY 1e-12

/* float to double. */
static void rotation_numbers_widen(double *out, const float *in, int n)
{
    for (int i = 0; i < n; i++)
        out[i] = in[i];
}

/* double to float. */
static void rotation_numbers_narrow(float *out, const double *in, int n)
{
    for (int i = 0; i < n; i++)
        out[i] = (float)in[i];
}

/* ---- small matrices ---------------------------------------------------- */

void mat3_mul(float C[9], const float A[9], const float B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] +
                           A[3 * i + 2] * B[6 + j];
}

void mat3_mul_d(double C[9], const double A[9], const double B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = A[3 * i] * B[j] + A[3 * i + 1] * B[3 + j] +
                           A[3 * i + 2] * B[6 + j];
}

void mat3_mul_nt_d(double C[9], const double A[9], const double B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = dot3_d(A + 3 * i, B + 3 * j);
}

void mat3_mul_tn_d(double C[9], const double A[9], const double B[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            C[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] +
                           A[6 + i] * B[6 + j];
}

/* ---- 6D ---------------------------------------------------------------- */

/* b = v / max(|v|, TINY); returns the divisor. */
static double rotation_vector_normalise(double b[3], const double v[3])
{
    double n = sqrt(dot3_d(v, v));

    if (n < TINY)
        n = TINY;
    for (int i = 0; i < 3; i++)
        b[i] = v[i] / n;
    return n;
}

/* dv += gradient of b = v / n; n is what normalise returned. */
static void rotation_normalise_backward(double dv[3], const double db[3],
                                        const double b[3], double n)
{
    double along = n > TINY ? dot3_d(b, db)
                            : 0; /* below the clamp: g / n */

    for (int i = 0; i < 3; i++)
        dv[i] += (db[i] - along * b[i]) / n;
}

void rotation_6d_d(double R[9], const double x[6])
{
    double *b1 = R, *b2 = R + 3, *b3 = R + 6, u[3];

    rotation_vector_normalise(b1, x);
    double c = dot3_d(b1, x + 3);
    for (int i = 0; i < 3; i++)
        u[i] = x[3 + i] - c * b1[i];
    rotation_vector_normalise(b2, u);
    cross3_d(b3, b1, b2);
}

void rotation_6d_backward_d(double dx[6], const double dR[9],
                            const double x[6])
{
    const double *a2 = x + 3, *g3 = dR + 6;
    double b1[3], b2[3], u[3], db1[3], db2[3], du[3] = {0};
    double n1 = rotation_vector_normalise(b1, x);
    double c = dot3_d(b1, a2);

    for (int i = 0; i < 3; i++)
        u[i] = a2[i] - c * b1[i];
    double n2 = rotation_vector_normalise(b2, u);

    /* b3 = b1 x b2 */
    cross3_d(db1, b2, g3);
    cross3_d(db2, g3, b1);
    for (int i = 0; i < 3; i++) {
        db1[i] += dR[i];
        db2[i] += dR[3 + i];
    }
    /* b2 = n(u), u = a2 - (b1.a2) b1 */
    rotation_normalise_backward(du, db2, b2, n2);
    double along = dot3_d(du, b1);
    for (int i = 0; i < 3; i++) {
        dx[3 + i] += du[i] - along * b1[i];
        db1[i] -= along * a2[i] + c * du[i];
    }
    /* b1 = n(a1) */
    rotation_normalise_backward(dx, db1, b1, n1);
}

void rotation_6d(float R[9], const float x[6])
{
    double xd[6], Rd[9];

    rotation_numbers_widen(xd, x, 6);
    rotation_6d_d(Rd, xd);
    rotation_numbers_narrow(R, Rd, 9);
}

void rotation_6d_backward(float dx[6], const float dR[9], const float x[6])
{
    double xd[6], dRd[9], dxd[6] = {0};

    rotation_numbers_widen(xd, x, 6);
    rotation_numbers_widen(dRd, dR, 9);
    rotation_6d_backward_d(dxd, dRd, xd);
    for (int i = 0; i < 6; i++)
        dx[i] += (float)dxd[i];
}

void rotation_to_6d(float x[6], const float R[9])
{
    for (int i = 0; i < 6; i++)
        x[i] = R[i];
}

/* ---- axis-angle -------------------------------------------------------- */

/* The coefficients of R = cos I + A [r]x + B r r^T and their derivatives by
 * the angle, divided by it: A = sin a / a, B = (1 - cos a) / a^2. */
struct exp_terms {
    double cosine, A, B, dA, dB;
};

/* sin(a)/a, (1 - cos(a))/a^2 and their derivatives, by series near 0. */
static void rotation_exp_terms(struct exp_terms *t, const double r[3])
{
    double s = dot3_d(r, r), a = sqrt(s), h = sin(0.5 * a);

    t->cosine = cos(a);
    if (s < 1e-4) { /* next terms are below 1e-14 relative */
        t->A = 1 - s / 6 * (1 - s / 20 * (1 - s / 42));
        t->B = 0.5 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56)));
        t->dA = -1.0 / 3 + s / 30 - s * s / 840;
        t->dB = -1.0 / 12 + s / 180 - s * s / 6720;
    } else {
        t->A = sin(a) / a;
        t->B = 2 * h * h / s;
        t->dA = (t->cosine - t->A) / s;
        t->dB = (t->A - 2 * t->B) / s;
    }
}

/* R = base I + A [r]x + B r r^T */
static void rotation_assemble(double R[9], double base, double A, double B,
                              const double r[3])
{
    double K[9] = {0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0};

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = (i == j ? base : 0) + A * K[3 * i + j] +
                           B * r[i] * r[j];
}

/* v_k = sum_ij dR_ij d[r]x_ij/dr_k */
static void rotation_skew_backward(double v[3], const double dR[9])
{
    v[0] = dR[7] - dR[5];
    v[1] = dR[2] - dR[6];
    v[2] = dR[3] - dR[1];
}

/* v = (dR + dR^T) r; returns r^T dR r. */
static double rotation_outer_backward(double v[3], const double dR[9],
                                      const double r[3])
{
    for (int i = 0; i < 3; i++) {
        v[i] = 0;
        for (int j = 0; j < 3; j++)
            v[i] += (dR[3 * i + j] + dR[3 * j + i]) * r[j];
    }
    return 0.5 * dot3_d(v, r);
}

void rotation_exp_d(double R[9], const double r[3])
{
    struct exp_terms t;

    rotation_exp_terms(&t, r);
    rotation_assemble(R, t.cosine, t.A, t.B, r);
}

void rotation_exp_backward_d(double dr[3], const double dR[9],
                             const double r[3])
{
    struct exp_terms t;
    double skew[3], outer[3];

    rotation_exp_terms(&t, r);
    rotation_skew_backward(skew, dR);
    double quad = rotation_outer_backward(outer, dR, r);
    /* R = cos I + A [r]x + B r r^T; d cos = -A r, dA = t.dA r, dB = t.dB r */
    double radial = -t.A * (dR[0] + dR[4] + dR[8]) +
                    t.dA * dot3_d(skew, r) + t.dB * quad;
    for (int i = 0; i < 3; i++)
        dr[i] += radial * r[i] + t.A * skew[i] + t.B * outer[i];
}

void rotation_exp(float R[9], const float r[3])
{
    double rd[3], Rd[9];

    rotation_numbers_widen(rd, r, 3);
    rotation_exp_d(Rd, rd);
    rotation_numbers_narrow(R, Rd, 9);
}

/* Angle with the public code's offset, and k = r / angle. */
static double rotation_rodrigues_axis(double k[3], double shifted[3],
                                      const double r[3])
{
    for (int i = 0; i < 3; i++)
        shifted[i] = r[i] + 1e-8;
    double a = sqrt(dot3_d(shifted, shifted));
    if (a < 1e-30)
        a = 1e-30;
    for (int i = 0; i < 3; i++)
        k[i] = r[i] / a;
    return a;
}

void rotation_rodrigues_eps_d(double R[9], const double r[3])
{
    double k[3], shifted[3], a = rotation_rodrigues_axis(k, shifted, r);
    double h = sin(0.5 * a), c1 = 2 * h * h;

    /* I + sin K + (1-cos) K^2, K^2 = k k^T - |k|^2 I */
    rotation_assemble(R, 1 - c1 * dot3_d(k, k), sin(a), c1, k);
}

void rotation_rodrigues_eps_backward_d(double dr[3], const double dR[9],
                                       const double r[3])
{
    double k[3], shifted[3], a = rotation_rodrigues_axis(k, shifted, r);
    double h = sin(0.5 * a), c1 = 2 * h * h;
    double trace = dR[0] + dR[4] + dR[8], skew[3], outer[3], dk[3];

    rotation_skew_backward(skew, dR);
    double quad = rotation_outer_backward(outer, dR, k);
    for (int i = 0; i < 3; i++)
        dk[i] = sin(a) * skew[i] + c1 * (outer[i] - 2 * trace * k[i]);
    double da = cos(a) * dot3_d(skew, k) +
                sin(a) * (quad - trace * dot3_d(k, k));
    /* k = r / a */
    da -= dot3_d(dk, k) / a;
    for (int i = 0; i < 3; i++)
        dr[i] += dk[i] / a + da * shifted[i] / a;
}

/* ---- quaternions and logarithm ----------------------------------------- */

/* Shepperd's method: the largest of the four squared components first. */
static void rotation_quat_f64(double q[4], const double R[9])
{
    double t = R[0] + R[4] + R[8];

    if (t > R[0] && t > R[4] && t > R[8]) {
        q[0] = 1 + t;
        q[1] = R[7] - R[5];
        q[2] = R[2] - R[6];
        q[3] = R[3] - R[1];
    } else {
        int i = R[4] > R[0] ? 1 : 0;

        if (R[8] > R[4 * i])
            i = 2;
        int j = (i + 1) % 3, k = (i + 2) % 3;
        q[0] = R[3 * k + j] - R[3 * j + k];
        q[1 + i] = 1 + R[4 * i] - R[4 * j] - R[4 * k];
        q[1 + j] = R[3 * i + j] + R[3 * j + i];
        q[1 + k] = R[3 * i + k] + R[3 * k + i];
    }
    double n = sqrt(q[0] * q[0] + dot3_d(q + 1, q + 1));
    n = (q[0] < 0 ? -1 : 1) / (n > TINY ? n : TINY);
    for (int i = 0; i < 4; i++)
        q[i] *= n;
}

void rotation_to_quat(float q[4], const float R[9])
{
    double Rd[9], qd[4];

    rotation_numbers_widen(Rd, R, 9);
    rotation_quat_f64(qd, Rd);
    rotation_numbers_narrow(q, qd, 4);
}

void rotation_log_d(double r[3], const double R[9])
{
    double q[4];

    rotation_quat_f64(q, R);
    double v = sqrt(dot3_d(q + 1, q + 1));
    double s = v > 1e-150 ? 2 * atan2(v, q[0]) / v : 2;
    for (int i = 0; i < 3; i++)
        r[i] = s * q[1 + i];
}

void rotation_log(float r[3], const float R[9])
{
    double Rd[9], rd[3];

    rotation_numbers_widen(Rd, R, 9);
    rotation_log_d(rd, Rd);
    rotation_numbers_narrow(r, rd, 3);
}

double rotation_distance(const float A[9], const float B[9])
{
    double Ad[9], Bd[9], C[9], q[4];

    rotation_numbers_widen(Ad, A, 9);
    rotation_numbers_widen(Bd, B, 9);
    mat3_mul_nt_d(C, Ad, Bd);
    rotation_quat_f64(q, C);
    return 2 * atan2(sqrt(dot3_d(q + 1, q + 1)), q[0]);
}
