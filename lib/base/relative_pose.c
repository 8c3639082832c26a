/* The relative pose as six numbers, linear in the camera, and its gradient.
 * Ours: the paper's refiner sees features alone. */
#include "lib/base/relative_pose.h"

#define UNIT 0.25f

/* Entry (i,k) of Q = C R^T, C the camera's rotation. */
static float relative_pose_entry(const float R[9], const float cam[12],
                                 int i, int k)
{
    return cam[4 * i] * R[3 * k] + cam[4 * i + 1] * R[3 * k + 1] +
           cam[4 * i + 2] * R[3 * k + 2];
}

void relative_lamp(float lamp[LAMP_SIZE], const float R[9], const float l[3])
{
    for (int i = 0; i < 3; i++) {
        lamp[i] = R[3 * i] * l[0] + R[3 * i + 1] * l[1] + R[3 * i + 2] * l[2];
        lamp[3 + i] = 1;
    }
}

void relative_light(float now[LAMP_SIZE], const float lamp[LAMP_SIZE],
                    const float cam[12])
{
    for (int a = 0; a < 3; a++) {
        now[3 + a] = lamp[3 + a];
        now[a] = 0;
        for (int i = 0; i < 3; i++)
            now[a] += cam[4 * i + a] * lamp[i];
    }
}

/* The antisymmetric part of Q = C R^T, and C^T R l - l. */
void relative_pose(float pose[RELATIVE_POSE_SIZE], const float R[9],
                   const float l[3], const float cam[12])
{
    float lamp[LAMP_SIZE], now[LAMP_SIZE];

    relative_lamp(lamp, R, l);
    relative_light(now, lamp, cam);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;

        pose[a] = 0.5f / UNIT * (relative_pose_entry(R, cam, c, b) -
                                 relative_pose_entry(R, cam, b, c));
        pose[3 + a] = (now[a] - l[a]) / UNIT;
    }
}

/* Both are linear in C. */
void relative_pose_backward(float dcam[12],
                            const float dpose[RELATIVE_POSE_SIZE],
                            const float R[9], const float l[3])
{
    float lamp[LAMP_SIZE];

    relative_lamp(lamp, R, l);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        float d = 0.5f / UNIT * dpose[a];

        for (int k = 0; k < 3; k++) {
            dcam[4 * c + k] += d * R[3 * b + k];
            dcam[4 * b + k] -= d * R[3 * c + k];
            dcam[4 * k + a] += dpose[3 + a] / UNIT * lamp[k];
        }
    }
}
