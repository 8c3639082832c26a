/* Distances between two motions as in the paper's tables: landmarks (AKD, its
 * parts AED and APD), pose angles, expressions and gaze. */
#include "lib/lab/eval/motion.h"

#include <math.h>

#define DEGREES (180 / M_PI)

/* The first 17 landmarks are the jaw line, the others the inner face. */
void metric_points(struct metric_points *out, const float a[68][2],
                   const float b[68][2])
{
    double jaw = 0, inner = 0;

    for (int i = 0; i < METRIC_LANDMARKS; i++) {
        double d = hypot((double)a[i][0] - b[i][0], (double)a[i][1] - b[i][1]);

        if (i < METRIC_JAW)
            jaw += d;
        else
            inner += d;
    }
    out->akd = (jaw + inner) / METRIC_LANDMARKS;
    out->aed = inner / (METRIC_LANDMARKS - METRIC_JAW);
    out->apd = jaw / METRIC_JAW;
}

double metric_eye_distance(const float a[68][2])
{
    return hypot((double)a[36][0] - a[45][0], (double)a[36][1] - a[45][1]);
}

double metric_rotation_degrees(const float a[9], const float b[9])
{
    double trace = 0, s[3];

    /* D = A^T B; its trace gives the cosine, its odd part the sine, which is
     * the better conditioned of the two for small angles. */
    for (int i = 0; i < 9; i++)
        trace += (double)a[i] * b[i];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double djk = 0, dkj = 0;

        for (int r = 0; r < 3; r++) {
            djk += (double)a[3 * r + j] * b[3 * r + k];
            dkj += (double)a[3 * r + k] * b[3 * r + j];
        }
        s[i] = dkj - djk;
    }
    return atan2(sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]), trace - 1) *
           DEGREES;
}

void metric_euler_degrees(double out[3], const float R[9])
{
    /* Q = diag(1,-1,-1) R = Rz(roll) Rx(pitch) Ry(yaw):
     * third row  (-cos p sin y, sin p, cos p cos y),
     * second column  (-sin r cos p, cos r cos p, sin p). */
    double q20 = -(double)R[6], q21 = -(double)R[7], q22 = -(double)R[8];
    double q01 = R[1], q11 = -(double)R[4];

    out[0] = atan2(-q20, q22) * DEGREES;
    out[1] = asin(fmax(-1, fmin(1, q21))) * DEGREES;
    out[2] = atan2(-q01, q11) * DEGREES;
}

double metric_correlation(const double *a, const double *b, size_t n)
{
    double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;

    if (n < 2)
        return NAN;
    for (size_t i = 0; i < n; i++) {
        ma += a[i] / (double)n;
        mb += b[i] / (double)n;
    }
    for (size_t i = 0; i < n; i++) {
        aa += (a[i] - ma) * (a[i] - ma);
        bb += (b[i] - mb) * (b[i] - mb);
        ab += (a[i] - ma) * (b[i] - mb);
    }
    return aa > 0 && bb > 0 ? ab / sqrt(aa * bb) : NAN;
}

double metric_jaw_open(const float jaw[3])
{
    return jaw[0];
}
