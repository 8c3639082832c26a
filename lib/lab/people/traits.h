/* How synthetic people look and move, as distributions: data, which
 * examples/config/traits.json holds and spid-synth(1) explains.  Names here and
 * there are the same. */
#ifndef SPID_LAB_PEOPLE_TRAITS_H
#define SPID_LAB_PEOPLE_TRAITS_H

#include "lib/base/error.h"
#include "lib/base/random.h"

/* X(type, name, dimensions).  double [2]: a range that is drawn from evenly;
 * double [3]: a chance and a range, 0 without; double: a chance; a float that
 * is drawn about: a spread, cut at twice itself; _color [3]: any hue, of this
 * saturation at most, within these brightnesses; _event: seconds, chance in
 * each such time, and share of it that it takes. */
#define TRAITS(X) \
    X(double, age,[2]) X(float, identity_limit,) X(float, identity_mean,[100]) \
    X(double, lip_gap,[2]) \
    X(float, skin_part_limit,) X(float, skin_tone,) X(double, skin_darker,[3]) \
    X(float, skin_red,) X(double, skin_grain,[2]) X(float, skin_grain_age,) \
    X(double, freckle,[3]) X(float, freckle_tone,) X(double, mole,[3]) \
    X(double, stubble,[3]) X(double, gloss,[2]) X(double, wet,[2]) \
    X(double, made_up,) X(float, made_up_spread,) X(float, made_up_wet,) \
    X(float, made_up_lash,) X(double, lipstick_rgb,[3][2]) \
    X(double, lid_rgb,[3][2]) X(double, lipstick,[2]) X(double, lid,[3]) \
    X(double, blush,[2]) \
    X(float, hair_rgb,[9][3]) X(float, hair_spread,) \
    X(float, hair_dark_tone,) X(double, hair_dark,) X(double, hair_gray_age,) \
    X(double, hair_gray,[2]) X(float, hair_gray_linear,[3]) \
    X(double, hair_dyed,) X(float, hair_dyed_color,[3]) \
    X(double, hair_gloss,[2]) X(double, hair_none,[2]) \
    X(double, hair_unusual,) X(double, hair_over_brow,) X(double, hat_none,) \
    X(double, cap,) X(double, cap_hides_hair,) X(float, cap_color,[3]) \
    X(double, brow_weight,[2]) X(float, brow_uneven,) \
    X(float, brow_linear,[2]) X(double, brow_shade,[2]) X(double, beard,[3]) \
    X(double, beard_length,[2]) X(double, moustache,[2]) \
    X(double, moustache_size,[2]) \
    X(double, iris_size,[2]) X(double, brown_rgb,[3][2]) \
    X(float, brown_spread,) X(float, brown_tone,) X(double, brown,[2]) \
    X(double, lash,[2]) X(float, tooth_linear,[2][3]) X(double, gum,[3][2]) \
    X(double, glasses,) X(double, sunglasses,) X(float, glasses_color,[3]) \
    X(double, glasses_black,) X(double, earring,) X(double, cloth_own,) \
    X(float, cloth_color,[3]) \
    X(double, exposure,[2]) X(float, contrast,) X(float, saturation,) \
    X(float, white,) X(float, balance,) X(double, blur,[3]) \
    X(double, blur_poor,) X(float, blur_poor_size,[2]) X(double, sharpen,[3]) \
    X(double, shutter,[3]) X(double, shutter_long,[2]) X(double, noise,[3]) \
    X(double, vignette,[3]) X(double, coarse,) X(float, coarse_scale,[2]) \
    X(double, jpeg,) X(float, jpeg_quality,[2]) X(double, codec,) \
    X(float, codec_quantiser,[2]) X(double, coded,[2]) X(double, drift,[3]) \
    X(float, distance,) X(float, near_share,[2]) X(double, desk,[2]) \
    X(double, telephone,[2]) X(float, aside,) X(float, above,[2]) \
    X(double, defocus,[3]) X(double, room,) X(double, view,[2]) \
    X(float, tilt,) X(double, wall_plain,) X(float, wall_color,[2][3]) \
    X(double, front,) X(double, front_hand,) X(double, front_microphone,) \
    X(double, lively,[2]) X(double, turn_far,[3]) X(double, turn,[2]) \
    X(float, rest,[3]) X(float, lean,) X(double, talk,[3]) \
    X(float, pose_size,[2]) X(float, pose_limit,[3]) X(double, pose_time,[2]) \
    X(double, drift_time,) X(double, pupil_time,) X(double, mood,[2]) \
    X(float, tremble,) X(double, tremble_time,) \
    X(float, expression_share,[3]) X(double, expression_size,[2]) \
    X(double, expression_one_sided,) X(float, expression_small,) \
    X(float, expression_with_made,) X(double, expression_made,[2]) \
    X(double, expression_single,[2]) X(double, expression_paired,) \
    X(double, speech,[2]) X(double, syllable,[2]) X(float, loudness,[2]) \
    X(float, viseme,[10][9]) X(float, viseme_lean,) X(float, speech_brow,) \
    X(double, gaze,[2]) X(float, gaze_share,[2]) X(float, gaze_near,) \
    X(float, gaze_limit,[3]) X(float, gaze_camera,) X(float, gaze_verge,[2]) \
    X(double, blink_event,[3]) X(double, doze_event,[3]) \
    X(float, doze_size,) X(float, droop,) X(double, shut_event,[3]) \
    X(double, wink_event,[3]) X(float, wink_squint,[2]) \
    X(double, accent_event,[3]) X(float, accent_one_sided,[2]) \
    X(float, accent_size,[2]) X(double, brow_event,[3]) \
    X(float, brow_way,[4][5]) X(float, brow_lean,) X(float, brow_size,[2]) \
    X(float, brow_squint,) X(double, closed_lips_event,[3]) \
    X(float, closed_lips_jaw,) \
    X(float, skin_red_green,[2]) X(float, skin_green_blue,[2]) \
    X(float, skin_melanin,[3]) X(float, skin_blood,[3]) \
    X(float, skin_fairest,) X(float, lip_red,[2]) X(float, lip_dark,[2]) \
    X(float, freckle_spots,[3]) X(float, mole_spots,[3]) \
    X(float, stubble_tint,[3]) X(float, earring_linear,[2][3]) \
    X(float, plain_skin,[3]) X(float, plain_iris,[3][3]) \
    X(double, hand,[6][2]) X(double, held,[6][2]) \
    X(float, gloss_skin,[2][3]) X(float, gloss_eye,[3]) \
    X(float, gloss_tear,[3]) X(float, gloss_gum,[3]) \
    X(float, gloss_tooth,[3]) X(float, gloss_metal,[3]) \
    X(float, wrap_skin,[3]) X(float, wrap_eye,[3])

#define TRAIT_MOVES 24

/* ARKit's components, the left one of a pair for both, with numbers each. */
struct trait_moves {
    int n;
    struct { int component; float value[2]; } move[TRAIT_MOVES];
};

struct traits {
#define TRAIT_FIELD(type, name, dimensions) type name dimensions;
    TRAITS(TRAIT_FIELD)
#undef TRAIT_FIELD
    struct trait_moves accent;          /* chance, size */
    int expressions;
    struct trait_moves expression[TRAIT_MOVES];     /* weight */
};

/* Read the file; NULL: the one that is built in, with its first TRAIT_MOVES
 * expressions.  -1 and *err naming the file and the trait that is missing or
 * has other numbers. */
int traits_load(struct traits *t, const char *path, struct error *err);

/* Of a range; of a chance and a range, 0 without. */
static inline float trait_range(struct random *r, const double t[2])
{
    return random_float(r, t[0], t[1]);
}
static inline float trait_maybe(struct random *r, const double t[3])
{
    return random_chance(r, t[0]) ? random_float(r, t[1], t[2]) : 0;
}

#endif
