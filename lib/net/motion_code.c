/* Decoding of E_m's numbers into a motion, Eqs. rot to eye: Zhou et al.'s 6D
 * rotation made safe, and the change of the translation from crop to window
 * (lib/base/crop.c). */
#include "lib/net/motion_code.h"

#include <math.h>
#include <string.h>

#include "lib/base/camera.h"
#include "lib/base/rotation.h"

/* Six numbers that Gram-Schmidt makes a rotation of: x, wherever it can. */
static void motion_code_repair(float v[6], const float x[6])
{
    double n1, n2, dot;

    for (int i = 0; i < 6; i++)
        v[i] = isfinite(x[i]) ? x[i] : 0;
    n1 = hypot(hypot(v[0], v[1]), v[2]);
    if (n1 < 1e-6) {
        v[0] = 1;
        v[1] = v[2] = 0;
        n1 = 1;
    }
    n2 = hypot(hypot(v[3], v[4]), v[5]);
    dot = ((double)v[0] * v[3] + (double)v[1] * v[4] + (double)v[2] * v[5])
          / n1;
    if (n2 < 1e-6 || n2 * n2 - dot * dot < 1e-8 * n2 * n2) {
        v[3] = 0;
        v[4] = fabs(v[1]) < 0.8 * n1 ? -1 : 0;
        v[5] = v[4] == 0 ? 1 : 0;
    }
}

void motion_code_rotation(float R[9], const float x[6])
{
    float v[6];

    motion_code_repair(v, x);
    rotation_6d(R, v);
}

void motion_code_decode(float R[9], float t[3], struct head_motion *pose,
                        const float code[MOTION_OUT], struct square crop,
                        double size)
{
    const double tnet[3] = {code[MOTION_TRANS], code[MOTION_TRANS + 1],
                            code[MOTION_TRANS + 2]};
    double tw[3];

    motion_code_rotation(R, code + MOTION_ROT);
    crop_translation(tw, tnet, crop, size, camera_focal((float)size));
    for (int i = 0; i < 3; i++)
        t[i] = (float)tw[i];
    memset(pose, 0, sizeof *pose);
    pose->exp = code + MOTION_EXP;
    memcpy(pose->jaw, code + MOTION_JAW, sizeof pose->jaw);
    memcpy(pose->eye, code + MOTION_EYE, sizeof pose->eye);
    memcpy(pose->lid, code + MOTION_LID, sizeof pose->lid);
}

struct head_motion_grad motion_code_gradient(float dcode[MOTION_OUT])
{
    return (struct head_motion_grad){.exp = dcode + MOTION_EXP};
}

/* dcode += gradient of [R|t]. */
static void motion_code_camera_backward(float *dcode, const float dcam[12],
                                        const float *code,
                                        struct square crop, double size)
{
    double dt[3], tnet[3], dtnet[3] = {0}, dcrop[3] = {0};
    float dR[9], v[6];

    for (int i = 0; i < 3; i++) {
        memcpy(dR + 3 * i, dcam + 4 * i, 3 * sizeof *dR);
        dt[i] = dcam[4 * i + 3];
        tnet[i] = code[MOTION_TRANS + i];
    }
    motion_code_repair(v, code + MOTION_ROT);
    rotation_6d_backward(dcode + MOTION_ROT, dR, v);
    crop_translation_backward(dtnet, dcrop, dt, tnet, crop, size,
                              camera_focal((float)size));
    for (int i = 0; i < 3; i++)
        dcode[MOTION_TRANS + i] += (float)dtnet[i];
}

void motion_code_decode_backward(float dcode[MOTION_OUT],
                                 const struct head_motion_grad *dpose,
                                 const float *dcam,
                                 const float code[MOTION_OUT],
                                 struct square crop, double size)
{
    for (int i = 0; dpose && i < 3; i++)
        dcode[MOTION_JAW + i] += dpose->jaw[i];
    for (int i = 0; dpose && i < 6; i++)
        dcode[MOTION_EYE + i] += dpose->eye[i];
    for (int i = 0; dpose && i < 2; i++)
        dcode[MOTION_LID + i] += dpose->lid[i];
    if (dcam)
        motion_code_camera_backward(dcode, dcam, code, crop, size);
}
