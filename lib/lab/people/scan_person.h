/* Who a person of the scans is and what their picture is taken with: numbers
 * only, all drawn from (seed, index). */
#ifndef SPID_LAB_PEOPLE_SCAN_PERSON_H
#define SPID_LAB_PEOPLE_SCAN_PERSON_H

#include <stdbool.h>

#include "lib/lab/people/scan.h"

enum glasses { GLASSES_NONE, GLASSES_ROUND, GLASSES_SQUARE, GLASSES_THIN,
               GLASSES_SUN };
enum scan_backdrop { BACKDROP_ROOM, BACKDROP_WALL, BACKDROPS };
enum scan_front { FRONT_NONE, FRONT_HAND, FRONT_MICROPHONE, FRONT_CUP };

struct scan_camera {
    float distance;             /* of the head, head units */
    float exposure, contrast, saturation, balance[3];
    float blur, shutter, noise, vignette, sharpen, low;
    int jpeg;                   /* quality, 0: none */
    int codec;                  /* video quantiser, 0: none */
    float drift;                /* rolling exposure and balance, 0..1 */
    float depth;                /* blur of the background */
    enum scan_backdrop backdrop;
    float view, tilt;           /* field and height of the backdrop, radians */
    float wall[3];
};

struct scan_person {
    uint64_t key;
    float beta[SCAN_IDENTITIES];
    float male, age;            /* 0..1, what the looks go by */
    struct skin_look skin;
    int hair, hat, cloth, iris; /* -1: none */
    float hair_color[3], hair_gray, hair_gloss;
    float brow[2][BROW_PARTS];  /* deviations of either brow */
    float brow_color[3], brow_weight;
    float cap_color[3];
    int cap;                    /* 0 none, 1 knitted cap, 2 head scarf */
    float beard, moustache, beard_length, buzz;
    float cloth_color[3];
    bool cloth_own;             /* the picture's own colours */
    float iris_tint[3], iris_size;
    float lash;                 /* thickness, about 1 */
    float tooth[3], gum[3];
    enum glasses glasses;
    float glass_color[3];
    int earring;
    float gloss, wet;           /* of the skin, of the lips */
    int light;
    float turn, gain[3];
    struct act_look act;
    float rest[3];              /* place of the shoulders' pivot, camera */
    struct scan_camera camera;
    enum scan_front front;
};

/* Draw person `index` of `seed`; effects 0..1 scales what the camera does. */
void scan_person_draw(struct scan_person *p, const struct scan_assets *a,
                      uint64_t seed, uint64_t index, float effects);

#endif
