/* ARKit's expression weights and the head's motion, either way.
 *
 * A motion's parameters (MOTN: exp, jaw, lid, eye) say the same as ARKit's
 * weights, but what a joint can do the joint does: weight 1 of jawOpen is a
 * jaw turned by ARKIT_JAW_OPEN about x, jawLeft and jawRight turn it about y,
 * eyeLook* turn the eyes, eyeBlink* are the lids.  Their places among the
 * expression components hold zero shapes, so that names and numbers line up;
 * all other components, jawForward among them, are weights as they are.  The
 * skin that follows a joint (cheeks, lips, lids under a gaze) is in the head's
 * pose correctives: at weight 1 the posed mean head is the scans' shape.
 *
 * Names, their order and their split by side are ICT-FaceKit's, also in the
 * head file's metadata `expression_names`.  Left is the subject's. */
#ifndef SPID_HEAD_ARKIT_H
#define SPID_HEAD_ARKIT_H

#include <math.h>
#include <stdbool.h>

#include "lib/base/random.h"

#define ARKIT_COUNT 53
#define ARKIT_EXP 100           /* expression components of a motion */

/* Angles of a weight of 1, radians. */
#define ARKIT_JAW_OPEN 0.442    /* 25.3 degrees, of the scans' lower teeth */
#define ARKIT_JAW_SIDE 0.085    /* 4.9 degrees: the teeth's shift, 6.5 mm */
#define ARKIT_EYE_UP   (M_PI / 180 * 25)
#define ARKIT_EYE_DOWN (M_PI / 6)
#define ARKIT_EYE_IN   (M_PI / 6)               /* towards the nose */
#define ARKIT_EYE_OUT  (M_PI / 6)

enum arkit {
    ARKIT_BROW_DOWN_L, ARKIT_BROW_DOWN_R,
    ARKIT_BROW_INNER_UP_L, ARKIT_BROW_INNER_UP_R,
    ARKIT_BROW_OUTER_UP_L, ARKIT_BROW_OUTER_UP_R,
    ARKIT_CHEEK_PUFF_L, ARKIT_CHEEK_PUFF_R,
    ARKIT_CHEEK_SQUINT_L, ARKIT_CHEEK_SQUINT_R,
    ARKIT_EYE_BLINK_L, ARKIT_EYE_BLINK_R,
    ARKIT_EYE_LOOK_DOWN_L, ARKIT_EYE_LOOK_DOWN_R,
    ARKIT_EYE_LOOK_IN_L, ARKIT_EYE_LOOK_IN_R,
    ARKIT_EYE_LOOK_OUT_L, ARKIT_EYE_LOOK_OUT_R,
    ARKIT_EYE_LOOK_UP_L, ARKIT_EYE_LOOK_UP_R,
    ARKIT_EYE_SQUINT_L, ARKIT_EYE_SQUINT_R,
    ARKIT_EYE_WIDE_L, ARKIT_EYE_WIDE_R,
    ARKIT_JAW_FORWARD, ARKIT_JAW_LEFT, ARKIT_JAW_OPENED, ARKIT_JAW_RIGHT,
    ARKIT_MOUTH_CLOSE,
    ARKIT_MOUTH_DIMPLE_L, ARKIT_MOUTH_DIMPLE_R,
    ARKIT_MOUTH_FROWN_L, ARKIT_MOUTH_FROWN_R,
    ARKIT_MOUTH_FUNNEL, ARKIT_MOUTH_LEFT,
    ARKIT_MOUTH_LOWER_DOWN_L, ARKIT_MOUTH_LOWER_DOWN_R,
    ARKIT_MOUTH_PRESS_L, ARKIT_MOUTH_PRESS_R,
    ARKIT_MOUTH_PUCKER, ARKIT_MOUTH_RIGHT,
    ARKIT_MOUTH_ROLL_LOWER, ARKIT_MOUTH_ROLL_UPPER,
    ARKIT_MOUTH_SHRUG_LOWER, ARKIT_MOUTH_SHRUG_UPPER,
    ARKIT_MOUTH_SMILE_L, ARKIT_MOUTH_SMILE_R,
    ARKIT_MOUTH_STRETCH_L, ARKIT_MOUTH_STRETCH_R,
    ARKIT_MOUTH_UPPER_UP_L, ARKIT_MOUTH_UPPER_UP_R,
    ARKIT_NOSE_SNEER_L, ARKIT_NOSE_SNEER_R
};

/* ICT-FaceKit's name of component k, "browDown_L"; NULL from ARKIT_COUNT on. */
const char *arkit_name(int k);

/* Room for all of them as a JSON list. */
#define ARKIT_NAMES 2048
/* out = that list; they need no escape. */
void arkit_names(char out[ARKIT_NAMES]);

/* The components that a name means: ours ("browDown_L") or Apple's, in either
 * of its spellings ("browDownLeft", "BrowDownLeft"), where browInnerUp and
 * cheekPuff mean both sides.  Returns how many (0 unknown, 1 or 2). */
int arkit_find(int component[2], const char *name);

/* Whether component k is a joint's or a lid's, and so a zero shape among the
 * expression directions. */
bool arkit_is_rig(int k);

/* Whether component k is the left one of two sides; k + 1 is the right one. */
bool arkit_is_left(int k);

/* Of two weights that contradict each other (jaw left and right, an eye up
 * and down, in and out) one, drawn at random, becomes 0: then w (ARKIT_COUNT)
 * is what a face can do. */
void arkit_draw_side(float *w, struct random *r);

/* The motion of weights w (ARKIT_COUNT).  exp (nexp): components, 0 beyond
 * ARKIT_COUNT.  jaw and eye (left, right) axis-angle; lid left, right. */
void arkit_to_motion(float *exp, int nexp, float jaw[3], float lid[2],
                     float eye[6], const float *w);

/* The weights of a motion: the way back, exact for weights that do not
 * contradict each other (eyes up and down at once, jaw to both sides).  A jaw
 * turned about z, which no weight means, is left out. */
void arkit_from_motion(float *w, const float *exp, int nexp,
                       const float jaw[3], const float lid[2],
                       const float eye[6]);

#endif
