/* Who a synthetic person is and what their picture is taken with: numbers
 * only, all drawn from (seed, index). */
#ifndef SPID_LAB_PEOPLE_PERSONA_H
#define SPID_LAB_PEOPLE_PERSONA_H

#include <stddef.h>
#include <stdint.h>

#include "lib/lab/people/shade.h"

#define PERSONA_SHAPE_MAX 512

enum hair_style {
    HAIR_SHAVED, HAIR_BUZZ, HAIR_SHORT, HAIR_SIDE, HAIR_QUIFF, HAIR_MEDIUM,
    HAIR_LONG, HAIR_WAVY, HAIR_CURLY, HAIR_AFRO, HAIR_BUN, HAIR_RECEDING,
    HAIR_STYLES
};
enum collar { COLLAR_CREW, COLLAR_VEE, COLLAR_SHIRT, COLLAR_HOOD,
              COLLAR_TURTLE, COLLAR_WIDE, COLLARS };

struct hair_look {
    enum hair_style style;
    float color[3], spread, gloss, gray;
    float length, volume, curl, part;    /* part: x of the parting */
    int fringe;
};

enum glasses { GLASSES_NONE, GLASSES_ROUND, GLASSES_SQUARE, GLASSES_THIN,
               GLASSES_SUN };

enum occluder {
    OCCLUDER_NONE, OCCLUDER_HAND, OCCLUDER_MICROPHONE, OCCLUDER_STRANDS
};

/* What is seen behind a person; two in six stand before a wall. */
enum scenery {
    SCENERY_WALL, SCENERY_BOKEH, SCENERY_GARDEN, SCENERY_ROOM, SCENERY_SHELF,
    SCENERY_WALL_TOO, SCENERIES
};

/* Camera, print and damage: fixed for a clip but for what noise adds. */
struct lens_look {
    float exposure, gamma, contrast, saturation;
    float balance[3];
    float noise, blur, vignette;
    float shutter;                       /* seconds of motion blur */
    int jpeg;                            /* quality 1..100, 0: none */
    float low;                           /* resolution factor, 1: full */
    enum occluder occluder;              /* what passes before the face */
};

struct persona {
    uint64_t key;                        /* of all its random sequences */
    float beta[PERSONA_SHAPE_MAX];
    size_t nbeta;
    float age, male;                     /* 0..1, what the looks go by */
    float tone;                          /* 0 fair to 1 dark */
    struct shade_skin skin;
    struct shade_eye eye;                /* centre, radius: the actor's */
    struct hair_look hair;
    float brow_weight, brow_arch, brow_color[3];
    float lash, makeup;
    float beard, moustache, beard_length, beard_color[3];
    float tooth[3], gum[3], tongue[3];
    enum glasses glasses;                /* never the sun's */
    float frame_color[3], frame_width;
    enum collar collar;
    struct shade_cloth cloth;
    float shoulder, build;
    struct shade_env env;                /* shadow: the stage's */
    enum scenery backdrop;
    float wall[3], accent[3];
    struct lens_look lens;
    /* framing: where the head rests */
    float rest[3];                       /* t of the camera, head units */
    float yaw, pitch, roll;              /* rest pose, radians */
    float lively;                        /* size of motions and expressions */
};

/* Draw person `index` of `seed` for a head with nshape directions.  effects
 * (0..1) scales what the camera does to the picture. */
void persona_sample(struct persona *p, uint64_t seed, uint64_t index,
                   size_t nshape, float effects);

/* Light number k (0..11) of the sheet, for the same person. */
void persona_relight(struct persona *p, int k);

#endif
