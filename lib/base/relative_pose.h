/* The relative pose of a head: how it has turned since the source picture,
 * and what that does to the light on it, which stays where it is, before the
 * camera.  The refiner receives it; records call it "turn". */
#ifndef SPID_BASE_RELATIVE_POSE_H
#define SPID_BASE_RELATIVE_POSE_H

#define RELATIVE_POSE_SIZE 6

/* A lamp: l in the camera's frame, and how many times the source's light it is in
 * red, green and blue. */
#define LAMP_SIZE 6
/* That of light l (3, head frame) on a head that R (3,3) saw. */
void relative_lamp(float lamp[LAMP_SIZE], const float R[9], const float l[3]);
/* It stays where it is before the camera; now: as it falls on a head that cam (3,4)
 * sees, head frame. */
void relative_light(float now[LAMP_SIZE], const float lamp[LAMP_SIZE],
                    const float cam[12]);

/* Of a head that was seen by R (3,3) under light l (3, head frame;
 * GAUS of spid-stream(5)), when cam (3,4) sees it; R and cam lead from the head to
 * the camera.
 *   pose[0..2]  sine of the angle times the axis, in the camera's frame
 *   pose[3..5]  what this adds to l, in the head's frame
 * in units of a quarter. */
void relative_pose(float pose[RELATIVE_POSE_SIZE], const float R[9],
                   const float l[3], const float cam[12]);
/* dcam (3,4) += gradient. */
void relative_pose_backward(float dcam[12],
                            const float dpose[RELATIVE_POSE_SIZE],
                            const float R[9], const float l[3]);

#endif
