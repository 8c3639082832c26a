/* How a synthetic person's head and face stand in one frame. */
#ifndef SPID_LAB_PEOPLE_MOTION_H
#define SPID_LAB_PEOPLE_MOTION_H

#define MOTION_EXP_MAX 512

/* Where a head shall turn to instead of where it would, radians. */
struct synth_turn {
    float yaw, pitch, roll;
};

struct synth_motion {
    float rot[9], trans[3];      /* camera: x_cam = rot x + trans */
    float exp[MOTION_EXP_MAX];
    float jaw[3], lid[2], eye[6];
};

#endif
