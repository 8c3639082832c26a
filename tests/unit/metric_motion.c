/* Landmark, rotation and curve metrics on values worked out by hand. */
#include <math.h>
#include <string.h>

#include "lib/lab/eval/motion.h"
#include "tests/check.h"

/* R = diag(1,-1,-1) Rz(r) Rx(p) Ry(y), angles in degrees. */
static void motion_metric_compose(float R[9], double y, double p, double r)
{
    double k = acos(-1) / 180, Y[9], P[9], Z[9], t[9], q[9];
    double cy = cos(y * k), sy = sin(y * k), cp = cos(p * k), sp = sin(p * k);
    double cr = cos(r * k), sr = sin(r * k);
    double a[3][9] = {{cy, 0, sy, 0, 1, 0, -sy, 0, cy},
                      {1, 0, 0, 0, cp, -sp, 0, sp, cp},
                      {cr, -sr, 0, sr, cr, 0, 0, 0, 1}};

    memcpy(Y, a[0], sizeof Y);
    memcpy(P, a[1], sizeof P);
    memcpy(Z, a[2], sizeof Z);
    for (int i = 0; i < 9; i++)
        t[i] = P[i / 3 * 3] * Y[i % 3] + P[i / 3 * 3 + 1] * Y[3 + i % 3] +
               P[i / 3 * 3 + 2] * Y[6 + i % 3];
    for (int i = 0; i < 9; i++)
        q[i] = Z[i / 3 * 3] * t[i % 3] + Z[i / 3 * 3 + 1] * t[3 + i % 3] +
               Z[i / 3 * 3 + 2] * t[6 + i % 3];
    for (int i = 0; i < 9; i++)
        R[i] = (float)(i < 3 ? q[i] : -q[i]);
}

int main(void)
{
    float a[68][2] = {{0}}, b[68][2] = {{0}}, R[9], S[9];
    double x[5] = {0, 1, 2, 3, 4}, y[5] = {1, 3, 5, 7, 9}, e[3];
    double z[5] = {4, 3, 2, 1, 0}, flat[5] = {2, 2, 2, 2, 2};
    struct metric_points p;

    for (int i = 0; i < 68; i++) {
        b[i][0] = i < 17 ? 3 : 6;
        b[i][1] = i < 17 ? 4 : 8;
    }
    metric_points(&p, (const float(*)[2])a, (const float(*)[2])b);
    expect("apd", p.apd, 5, 1e-12);
    expect("aed", p.aed, 10, 1e-12);
    expect("akd is (51 aed + 17 apd) / 68", p.akd, 8.75, 1e-12);
    a[36][0] = 10;
    a[45][0] = 40;
    a[45][1] = 40;
    expect("eye distance", metric_eye_distance((const float(*)[2])a), 50,
           1e-12);

    motion_metric_compose(R, 20, -7, 3);
    metric_euler_degrees(e, R);
    expect("yaw", e[0], 20, 1e-4);
    expect("pitch", e[1], -7, 1e-4);
    expect("roll", e[2], 3, 1e-4);
    motion_metric_compose(S, 20.001, -7, 3);
    expect("angle of equal rotations", metric_rotation_degrees(R, R), 0,
           1e-5);
    expect("a thousandth of a degree", metric_rotation_degrees(R, S), 0.001,
           2e-5);
    motion_metric_compose(R, 0, 0, 0);
    motion_metric_compose(S, 0, 0, 180);
    expect("half a turn", metric_rotation_degrees(R, S), 180, 1e-4);

    expect("correlation, straight line", metric_correlation(x, y, 5), 1,
           1e-12);
    expect("correlation, falling line", metric_correlation(x, z, 5), -1,
           1e-12);
    expect("correlation with a constant is NaN",
           isnan(metric_correlation(x, flat, 5)), 1, 0);
    return check_status();
}
