#include "lib/geom/turn.h"

#define UNIT 0.25f

/* Entry (i,k) of Q = C R^T, C the camera's rotation. */
static float since(const float R[9], const float cam[12], int i, int k)
{
    return cam[4 * i] * R[3 * k] + cam[4 * i + 1] * R[3 * k + 1] +
           cam[4 * i + 2] * R[3 * k + 2];
}

/* Component i of the light in the camera's frame, where it stays. */
static float fixed(const float R[9], const float l[3], int i)
{
    return R[3 * i] * l[0] + R[3 * i + 1] * l[1] + R[3 * i + 2] * l[2];
}

void turn_since(float turn[TURN_COUNT], const float R[9], const float l[3],
                const float cam[12])
{
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        float now = 0;

        turn[a] = 0.5f / UNIT * (since(R, cam, c, b) - since(R, cam, b, c));
        for (int i = 0; i < 3; i++)
            now += cam[4 * i + a] * fixed(R, l, i);
        turn[3 + a] = (now - l[a]) / UNIT;
    }
}

void turn_since_backward(float dcam[12], const float dturn[TURN_COUNT],
                         const float R[9], const float l[3])
{
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, c = (a + 2) % 3;
        float d = 0.5f / UNIT * dturn[a];

        for (int k = 0; k < 3; k++) {
            dcam[4 * c + k] += d * R[3 * b + k];
            dcam[4 * b + k] -= d * R[3 * c + k];
            dcam[4 * k + a] += dturn[3 + a] / UNIT * fixed(R, l, k);
        }
    }
}
