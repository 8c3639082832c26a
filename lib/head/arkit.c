/* Tables of ARKit's names and the arithmetic between weights and joints. */
#include "lib/head/arkit.h"

#include <ctype.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

static const char *const names[ARKIT_COUNT] = {
    "browDown_L", "browDown_R", "browInnerUp_L", "browInnerUp_R",
    "browOuterUp_L", "browOuterUp_R", "cheekPuff_L", "cheekPuff_R",
    "cheekSquint_L", "cheekSquint_R", "eyeBlink_L", "eyeBlink_R",
    "eyeLookDown_L", "eyeLookDown_R", "eyeLookIn_L", "eyeLookIn_R",
    "eyeLookOut_L", "eyeLookOut_R", "eyeLookUp_L", "eyeLookUp_R",
    "eyeSquint_L", "eyeSquint_R", "eyeWide_L", "eyeWide_R", "jawForward",
    "jawLeft", "jawOpen", "jawRight", "mouthClose", "mouthDimple_L",
    "mouthDimple_R", "mouthFrown_L", "mouthFrown_R", "mouthFunnel",
    "mouthLeft", "mouthLowerDown_L", "mouthLowerDown_R", "mouthPress_L",
    "mouthPress_R", "mouthPucker", "mouthRight", "mouthRollLower",
    "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper", "mouthSmile_L",
    "mouthSmile_R", "mouthStretch_L", "mouthStretch_R", "mouthUpperUp_L",
    "mouthUpperUp_R", "noseSneer_L", "noseSneer_R"
};

const char *arkit_name(int k)
{
    return k >= 0 && k < ARKIT_COUNT ? names[k] : NULL;
}

/* Whether `name` is component k: 2 when it names both sides. */
static int arkit_name_matches(int k, const char *name)
{
    const char *ours = names[k], *side = strchr(ours, '_');
    size_t stem = side ? (size_t)(side - ours) : strlen(ours);

    if (tolower((unsigned char)name[0]) != ours[0] ||
        strlen(name) < stem || strncmp(name + 1, ours + 1, stem - 1))
        return 0;
    name += stem;
    if (!side)
        return !*name;
    if (!*name)         /* sides that Apple does not split */
        return k == ARKIT_BROW_INNER_UP_L || k == ARKIT_BROW_INNER_UP_R ||
               k == ARKIT_CHEEK_PUFF_L || k == ARKIT_CHEEK_PUFF_R ? 2 : 0;
    return !strcmp(name, side) ||
           !strcmp(name, side[1] == 'L' ? "Left" : "Right");
}

void arkit_names(char out[ARKIT_NAMES])
{
    size_t n = 0;

    for (int k = 0; k < ARKIT_COUNT; k++)
        n += (size_t)snprintf(out + n, ARKIT_NAMES - n, "%s\"%s\"",
                              k ? "," : "[", arkit_name(k));
    snprintf(out + n, ARKIT_NAMES - n, "]");
}

int arkit_find(int component[2], const char *name)
{
    int n = 0;

    for (int k = 0; k < ARKIT_COUNT && n < 2; k++)
        if (arkit_name_matches(k, name))
            component[n++] = k;
    return n;
}

bool arkit_is_left(int k)
{
    const char *name = arkit_name(k), *end = name ? strrchr(name, '_') : NULL;

    return end && !strcmp(end, "_L");
}

bool arkit_is_rig(int k)
{
    return (k >= ARKIT_EYE_BLINK_L && k <= ARKIT_EYE_LOOK_UP_R) ||
           k == ARKIT_JAW_LEFT || k == ARKIT_JAW_OPENED ||
           k == ARKIT_JAW_RIGHT;
}

void arkit_draw_side(float *w, struct random *r)
{
    static const int against[][2] = {
        { ARKIT_JAW_LEFT, ARKIT_JAW_RIGHT },
        { ARKIT_EYE_LOOK_UP_L, ARKIT_EYE_LOOK_DOWN_L },
        { ARKIT_EYE_LOOK_UP_R, ARKIT_EYE_LOOK_DOWN_R },
        { ARKIT_EYE_LOOK_IN_L, ARKIT_EYE_LOOK_OUT_L },
        { ARKIT_EYE_LOOK_IN_R, ARKIT_EYE_LOOK_OUT_R },
    };

    for (size_t i = 0; i < sizeof against / sizeof *against; i++)
        w[against[i][random_range(r, 0, 1) < 0.5]] = 0;
}

void arkit_to_motion(float *exp, int nexp, float jaw[3], float lid[2],
                     float eye[6], const float *w)
{
    for (int k = 0; k < nexp; k++)
        exp[k] = k < ARKIT_COUNT && !arkit_is_rig(k) ? w[k] : 0;
    jaw[0] = (float)ARKIT_JAW_OPEN * w[ARKIT_JAW_OPENED];
    jaw[1] = (float)ARKIT_JAW_SIDE * (w[ARKIT_JAW_LEFT] - w[ARKIT_JAW_RIGHT]);
    jaw[2] = 0;
    for (int side = 0; side < 2; side++) {
        const float *s = w + side;          /* right follows left */
        float out = (float)ARKIT_EYE_OUT * s[ARKIT_EYE_LOOK_OUT_L] -
                    (float)ARKIT_EYE_IN * s[ARKIT_EYE_LOOK_IN_L];

        lid[side] = s[ARKIT_EYE_BLINK_L];
        eye[3 * side] = (float)ARKIT_EYE_DOWN * s[ARKIT_EYE_LOOK_DOWN_L] -
                        (float)ARKIT_EYE_UP * s[ARKIT_EYE_LOOK_UP_L];
        eye[3 * side + 1] = side ? -out : out;
        eye[3 * side + 2] = 0;
    }
}

/* The part of x above 0, as a share of whole. */
static float arkit_share(float x, double whole)
{
    return x > 0 ? (float)(x / whole) : 0;
}

void arkit_from_motion(float *w, const float *exp, int nexp,
                       const float jaw[3], const float lid[2],
                       const float eye[6])
{
    for (int k = 0; k < ARKIT_COUNT; k++)
        w[k] = k < nexp && !arkit_is_rig(k) ? exp[k] : 0;
    w[ARKIT_JAW_OPENED] = arkit_share(jaw[0], ARKIT_JAW_OPEN);
    w[ARKIT_JAW_LEFT] = arkit_share(jaw[1], ARKIT_JAW_SIDE);
    w[ARKIT_JAW_RIGHT] = arkit_share(-jaw[1], ARKIT_JAW_SIDE);
    for (int side = 0; side < 2; side++) {
        float *s = w + side;
        float down = eye[3 * side];
        float out = side ? -eye[4] : eye[1];

        s[ARKIT_EYE_BLINK_L] = lid[side];
        s[ARKIT_EYE_LOOK_DOWN_L] = arkit_share(down, ARKIT_EYE_DOWN);
        s[ARKIT_EYE_LOOK_UP_L] = arkit_share(-down, ARKIT_EYE_UP);
        s[ARKIT_EYE_LOOK_OUT_L] = arkit_share(out, ARKIT_EYE_OUT);
        s[ARKIT_EYE_LOOK_IN_L] = arkit_share(-out, ARKIT_EYE_IN);
    }
}
