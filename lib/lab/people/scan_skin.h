/* Skin as statistics of photographs: a mean, principal components of slow
 * colour, and fine grain, on the scans' texture square. */
#ifndef SPID_LAB_PEOPLE_SCAN_SKIN_H
#define SPID_LAB_PEOPLE_SCAN_SKIN_H

#include <stddef.h>
#include <stdint.h>

#include "lib/lab/people/scan_brow.h"

#define SKIN_SIZE 512           /* side of a person's texture */
#define SKIN_SLOW 128           /* side of the slow colours */
#define SKIN_PARTS 24           /* principal components */

struct scan_face;

struct skin_model {
    size_t people;              /* photographs that were fitted */
    float *mean;                /* (SKIN_SLOW,SKIN_SLOW,3) log albedo */
    float *part;                /* (SKIN_PARTS, same), per deviation */
    int parts;
    int8_t *grain;              /* (people,SKIN_SIZE,SKIN_SIZE) fine log
                                 * luminance, 1/256; mixed at random only */
    float *crease;              /* (SKIN_SIZE,SKIN_SIZE) the grain's mean */
    uint8_t *brow, *lip, *beard;    /* (SKIN_SIZE,SKIN_SIZE) where they are */
    uint8_t *mouth;             /* what lies between the lips, likewise */
    uint8_t *eye;               /* lids and what lies between them */
    struct brow_model brows;
};

/* What one person's skin is made of. */
struct skin_look {
    float z[SKIN_PARTS];
    float tone, red;            /* darker or lighter; ruddy or sallow */
    float grain, freckle, mole, stubble, lipstick, shadow, blush, age;
    float lip[3], lid[3];       /* colours of make-up */
    uint64_t key;
};

/* Fit to the photographs under DIR/photos/london with the landmarks of
 * DIR/labels; its arrays come from memory. */
int skin_model_fit(struct skin_model *m, const struct scan_face *f,
                   const char *dir, struct arena *memory, struct error *err);

struct traits;

/* A texture (SKIN_SIZE,SKIN_SIZE,4), top row first: the square root of linear
 * albedo, and height; 128 is even.  tone: its mean over the face, linear. */
void skin_paint(uint8_t *out, float tone[3], const struct skin_model *m,
                const struct skin_look *look, const struct traits *t);

#endif
