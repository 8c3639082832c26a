/* Brows as statistics of photographs: how densely hair grows on a part of the
 * scans' texture square, one side; the other is its mirror. */
#ifndef SPID_LAB_PEOPLE_SCAN_BROW_H
#define SPID_LAB_PEOPLE_SCAN_BROW_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"

/* The part of the square, texels of SKIN_SIZE: its right edge is the middle. */
#define BROW_X 112
#define BROW_Y 76
#define BROW_W 144
#define BROW_H 60
#define BROW_PLANE ((size_t)BROW_W * BROW_H)
#define BROW_PARTS 12           /* principal components */

struct brow_model {
    float *mean;                /* (BROW_H,BROW_W) density, 0..1 */
    float *part;                /* (parts, same), per deviation */
    int parts;
};

struct brow_fit {               /* the brows that were looked at */
    size_t n;
    float *dense;               /* (n,BROW_H,BROW_W) */
    uint8_t *seen;              /* (n) dark enough to be told from skin */
};

/* Memory for the brows of n photographs, two of each. */
int brow_fit_init(struct brow_fit *t, size_t n, struct arena *memory,
                  struct error *err);
/* Photograph i, log linear colours (SKIN_SIZE,SKIN_SIZE,3); where: shares of
 * the square about the brows, 0..255.  May be called from several threads. */
void brow_fit_add(struct brow_fit *t, size_t i, const float *log,
                  const uint8_t *where);
/* Mean and parts of all that were added. */
int brow_fit_finish(struct brow_model *m, struct brow_fit *t,
                    struct arena *memory, struct error *err);

/* Density (2,BROW_H,BROW_W) of a person's brows, 0..255: the one at u below a
 * half, then the other, mirrored.  z: deviations of both. */
void brow_paint(uint8_t *out, const struct brow_model *m,
                const float z[2][BROW_PARTS]);
/* Density (0..1) at a place of the texture square, v from below. */
float brow_density(const uint8_t *brow, float u, float v);

#endif
