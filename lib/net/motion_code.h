/* What E_m's row of numbers means (Eqs. rot to eye): 6D to a rotation, the
 * crop's translation to the portrait window's, the rest as the head takes it;
 * with the gradient.  The tracker, the losses and evaluation all decode by
 * this. */
#ifndef SPID_NET_MOTION_CODE_H
#define SPID_NET_MOTION_CODE_H

#include "lib/base/crop.h"
#include "lib/head/lbs.h"
#include "lib/net/motion_encoder.h"

/* R (3,3), always a rotation: Gram-Schmidt of x (6).  Where that gives none,
 * the first column a1 (nearly) zero or the second a2 (nearly) parallel to it:
 * a1 falls back to (1,0,0), a2 to the axis among (0,-1,0), (0,0,1) that is
 * further from a1's line; numbers that are not finite count as 0. */
void motion_code_rotation(float R[9], const float x[6]);

/* R, t: T_d = [R|t] of the portrait window of `size` pixels, from a code seen
 * through crop (window pixels); pose: what drives the head, whose exp points
 * into code. */
void motion_code_decode(float R[9], float t[3], struct head_motion *pose,
                        const float code[MOTION_OUT], struct square crop,
                        double size);

/* A gradient of a pose (zeroed) whose expression part adds to dcode. */
struct head_motion_grad motion_code_gradient(float dcode[MOTION_OUT]);
/* dcode += gradients of pose (of motion_code_gradient(dcode), or NULL) and of
 * cam = [R|t] (3,4, or NULL).  The crop is a constant. */
void motion_code_decode_backward(float dcode[MOTION_OUT],
                                 const struct head_motion_grad *dpose,
                                 const float *dcam,
                                 const float code[MOTION_OUT],
                                 struct square crop, double size);

#endif
