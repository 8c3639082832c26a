/* Channels of Live Link Face to a motion's parameters and back (take.h). */
#include "lib/track/take.h"

#include <math.h>
#include <string.h>

#include "formats/livelink.h"
#include "lib/base/rotation.h"
#include "lib/head/arkit.h"

/* R (3,3) = Rx(pitch) Ry(-yaw) Rz(roll) of angle = yaw, pitch, roll. */
static void take_rotation(double R[9], const float angle[3])
{
    const double x[3] = {(double)angle[1], 0, 0};
    const double y[3] = {0, -(double)angle[0], 0};
    const double z[3] = {0, 0, (double)angle[2]};
    double X[9], Y[9], Z[9], XY[9];

    rotation_exp_d(X, x);
    rotation_exp_d(Y, y);
    rotation_exp_d(Z, z);
    mat3_mul_d(XY, X, Y);
    mat3_mul_d(R, XY, Z);
}

/* The way back. */
static void take_angles(float angle[3], const double R[9])
{
    angle[0] = (float)-asin(fmin(fmax(R[2], -1), 1));
    angle[1] = (float)atan2(-R[5], R[8]);
    angle[2] = (float)atan2(-R[1], R[0]);
}

/* Head to camera axes and back: y and z change their sign. */
static void take_flip(double R[9])
{
    for (int i = 3; i < 9; i++)
        R[i] = -R[i];
}

/* Whether the take's eyes have angles. */
static bool take_has_eyes(const float *value)
{
    for (int k = LIVELINK_LEFT_EYE; k < LIVELINK_CHANNELS; k++)
        if (value[k] != 0)
            return true;
    return false;
}

void take_to_motion(struct motion *m, size_t nexp, const float *value)
{
    float w[ARKIT_COUNT] = {0};
    double R[9], r[3];

    memset(m, 0, sizeof *m);
    for (int k = 0; k < LIVELINK_WEIGHTS; k++) {
        int component[2], n = arkit_find(component, livelink_channel(k));

        while (n > 0)
            w[component[--n]] = value[k];
    }
    arkit_to_motion(m->exp, (int)nexp, m->pose.jaw, m->pose.lid, m->pose.eye,
                    w);
    for (int side = 0; side < 2 && take_has_eyes(value); side++) {
        take_rotation(R, value + LIVELINK_LEFT_EYE + 3 * side);
        rotation_log_d(r, R);
        for (int i = 0; i < 3; i++)
            m->pose.eye[3 * side + i] = (float)r[i];
    }
    take_rotation(R, value + LIVELINK_HEAD);
    take_flip(R);
    for (int i = 0; i < 9; i++)
        m->R[i] = (float)R[i];
    m->t[2] = TAKE_DISTANCE;
    m->pose.exp = m->exp;
}

void take_from_motion(float *value, const struct motion *m, size_t nexp)
{
    float w[ARKIT_COUNT];
    double R[9];

    arkit_from_motion(w, m->exp, (int)nexp, m->pose.jaw, m->pose.lid,
                      m->pose.eye);
    for (int k = 0; k < LIVELINK_WEIGHTS; k++) {
        int component[2], n = arkit_find(component, livelink_channel(k));

        value[k] = n == 2 ? (w[component[0]] + w[component[1]]) / 2
                          : n ? w[component[0]] : 0;
    }
    for (int i = 0; i < 9; i++)
        R[i] = (double)m->R[i];
    take_flip(R);
    take_angles(value + LIVELINK_HEAD, R);
    for (int side = 0; side < 2; side++) {
        const float *e = m->pose.eye + 3 * side;
        const double r[3] = {(double)e[0], (double)e[1], (double)e[2]};

        rotation_exp_d(R, r);
        take_angles(value + LIVELINK_LEFT_EYE + 3 * side, R);
    }
}
