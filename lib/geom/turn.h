/* What a turn of the head does to the light on it: the light stays where it
 * is, before the camera. */
#ifndef SPID_GEOM_TURN_H
#define SPID_GEOM_TURN_H

#define TURN_COUNT 6

/* How a head that was seen by R (3,3) under light l (3, head frame;
 * lib/avatar/light.h) has turned when cam (3,4) sees it; R and cam lead from
 * the head to the camera.
 *   turn[0..2]  sine of the angle times the axis, in the camera's frame
 *   turn[3..5]  what this adds to l, in the head's frame
 * in units of a quarter. */
void turn_since(float turn[TURN_COUNT], const float R[9], const float l[3],
                const float cam[12]);
/* dcam (3,4) += gradient. */
void turn_since_backward(float dcam[12], const float dturn[TURN_COUNT],
                         const float R[9], const float l[3]);

#endif
