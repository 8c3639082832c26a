/* ARKit's weights to a motion and back; names in every spelling. */
#include "lib/head/arkit.h"

#include <math.h>
#include <string.h>

#include "lib/base/random.h"
#include "tests/check.h"

/* Weights a face can have: of two that contradict each other one is 0. */
static void arkit_sample(float *w, struct random *r)
{
    for (int k = 0; k < ARKIT_COUNT; k++)
        w[k] = (float)random_range(r, 0, 1);
    arkit_draw_side(w, r);
}

static void test_round_trip(void)
{
    float w[ARKIT_COUNT], back[ARKIT_COUNT], exp[ARKIT_EXP];
    float jaw[3], lid[2], eye[6];
    double worst = 0, rig = 0;
    struct random r;

    random_init(&r, 1, "head_arkit");
    for (int n = 0; n < 100; n++) {
        arkit_sample(w, &r);
        arkit_to_motion(exp, ARKIT_EXP, jaw, lid, eye, w);
        arkit_from_motion(back, exp, ARKIT_EXP, jaw, lid, eye);
        for (int k = 0; k < ARKIT_COUNT; k++)
            worst = fmax(worst, fabs(w[k] - back[k]));
        for (int k = 0; k < ARKIT_EXP; k++)
            if (k >= ARKIT_COUNT || arkit_is_rig(k))
                rig = fmax(rig, fabs(exp[k]));
    }
    check_range("weights there and back, off by", worst, 0, 1e-6);
    check_range("components of joints and beyond", rig, 0, 0);
}

/* Signs as in MOTN: a jaw opens and an eye looks down about +x, to the
 * subject's left about +y. */
static void test_signs(void)
{
    float w[ARKIT_COUNT] = {0}, exp[ARKIT_EXP], jaw[3], lid[2], eye[6];

    w[ARKIT_JAW_OPENED] = w[ARKIT_JAW_RIGHT] = 1;
    w[ARKIT_EYE_LOOK_OUT_L] = w[ARKIT_EYE_LOOK_IN_R] = 1;
    w[ARKIT_EYE_LOOK_DOWN_L] = w[ARKIT_EYE_LOOK_UP_R] = 1;
    w[ARKIT_EYE_BLINK_R] = 1;
    arkit_to_motion(exp, ARKIT_EXP, jaw, lid, eye, w);
    check_range("jaw open", jaw[0], 0.44, 0.45);
    check_range("jaw to the right", jaw[1], -0.09, -0.08);
    check_range("left eye looks down", eye[0], 0.5, 0.53);
    check_range("left eye looks out, to the left", eye[1], 0.5, 0.53);
    check_range("right eye looks up", eye[3], -0.44, -0.43);
    check_range("right eye looks in, to the left", eye[4], 0.5, 0.53);
    check_range("right lid", lid[1] - lid[0], 1, 1);
}

static void test_names(void)
{
    static const struct { const char *name; int n, first; } cases[] = {
        { "browDown_L", 1, ARKIT_BROW_DOWN_L },
        { "browDownRight", 1, ARKIT_BROW_DOWN_R },
        { "BrowInnerUp", 2, ARKIT_BROW_INNER_UP_L },
        { "cheekPuff", 2, ARKIT_CHEEK_PUFF_L },
        { "JawOpen", 1, ARKIT_JAW_OPENED }, { "browDown", 0, 0 },
        { "mouthLeft", 1, ARKIT_MOUTH_LEFT },
        { "mouthSmileLeft", 1, ARKIT_MOUTH_SMILE_L },
        { "tongueOut", 0, 0 }, { "", 0, 0 }, { "jaw", 0, 0 },
    };
    int at[2], wrong = 0;

    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int n = arkit_find(at, cases[i].name);

        wrong += n != cases[i].n || (n && at[0] != cases[i].first);
    }
    for (int k = 0; k < ARKIT_COUNT; k++)
        wrong += arkit_find(at, arkit_name(k)) != 1 || at[0] != k;
    check_range("names misread", wrong, 0, 0);
}

int main(void)
{
    test_round_trip();
    test_signs();
    test_names();
    return check_status();
}
