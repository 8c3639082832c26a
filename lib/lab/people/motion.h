/* How a synthetic person moves: every parameter is a smooth function of time
 * that depends on the person only, so any frame can be asked for at once. */
#ifndef SPID_LAB_PEOPLE_MOTION_H
#define SPID_LAB_PEOPLE_MOTION_H

#include <stddef.h>

#include "lib/lab/people/persona.h"

#define MOTION_EXP_MAX 512

/* Radians of the widest head pose. */
#define MOTION_YAW 0.785f
#define MOTION_PITCH 0.436f
#define MOTION_ROLL 0.349f

/* Where a head shall turn to instead of where it would, radians. */
struct synth_turn {
    float yaw, pitch, roll;
};

struct synth_motion {
    float rot[9], trans[3];      /* camera: x_cam = rot x + trans */
    float body[9], body_trans[3];/* the same for the shoulders */
    float exp[MOTION_EXP_MAX];
    float jaw[3], lid[2], eye[6];
    float yaw, pitch, roll;
};

/* Motion of person p at `time` seconds; nexp expression directions; turn
 * (NULL: as they move) the head's pose instead of theirs.
 *
 * Ranges: yaw +-45, pitch +-25, roll +-20 degrees; jaw opens 0..0.42 rad,
 * sideways +-0.06; gaze +-0.48 rad across, +-0.3 up and down; lids 0..1;
 * exp[0..27] (the named ones) sparse, within +-2.2; exp[28..39] within
 * +-0.35; the rest 0. */
void synth_motion(struct synth_motion *m, const struct persona *p, double time,
                  size_t nexp, const struct synth_turn *turn);

/* rot (3,3) of a face's camera, radians: diag(1,-1,-1) for a face to the
 * camera; yaw turns it to its left. */
void synth_face_rotation(float rot[9], float yaw, float pitch, float roll);

/* Turn m to the camera: head and shoulders upright, nothing else changed. */
void synth_still(struct synth_motion *m, const struct persona *p);

#endif
