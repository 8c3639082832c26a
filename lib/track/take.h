/* Takes of Live Link Face (formats/livelink.h) and motions, either way.
 *
 * Weights are those of lib/head/arkit.h; BrowInnerUp and CheekPuff mean both
 * sides, TongueOut nothing that a head can do.  An angle's yaw turns to the
 * subject's right, its pitch down, its roll tilts to the subject's right
 * shoulder: R = Rx(pitch) Ry(-yaw) Rz(roll), x to the subject's left, y up,
 * z to the front.  For eyes this holds to 1e-4 in published takes of the app;
 * that the head's angles are meant alike is an assumption.  Where a camera
 * sees the head is not in a take. */
#ifndef SPID_TRACK_TAKE_H
#define SPID_TRACK_TAKE_H

#include <stddef.h>

#include "lib/base/camera.h"
#include "lib/head/motion.h"

#define TAKE_DISTANCE CAMERA_FOCAL      /* camera to head: half a picture's side is
                                         * one head unit there */

/* The motion of a head of nexp components, ARKit's first, that value
 * (LIVELINK_CHANNELS) describes; seen from TAKE_DISTANCE in the middle.  Eyes
 * turn by their angles or, when all of these are 0, by EyeLook... */
void take_to_motion(struct motion *m, size_t nexp, const float *value);
/* The other way.  Lost are: what is different in the two halves of BrowInnerUp
 * and CheekPuff (their mean stays), a jaw that closes beyond rest or turns
 * about z, components beyond ARKit's, and the place. */
void take_from_motion(float *value, const struct motion *m, size_t nexp);

#endif
