/* What the tracker saw, drawn on the picture it saw it in. */
#ifndef SPID_PHOTO_OVERLAY_H
#define SPID_PHOTO_OVERLAY_H

#include <stdint.h>

#include "lib/base/arena.h"
#include "lib/base/crop.h"
#include "lib/head/lbs.h"
#include "lib/head/motion.h"

struct overlay {
    struct arena memory;
    const struct identity *id;  /* borrowed */
    float *verts;               /* (V,3) */
    float *uv, *z;              /* (V,2), (V) */
    float *segments;            /* (3F,2,2) */
    uint8_t *rgb;               /* the picture drawn on */
    size_t room;
};

/* Memory for id's mesh and landmarks; id is borrowed. */
int overlay_init(struct overlay *o, const struct identity *id,
                 struct error *err);
/* Free what it holds; zeroed then. */
void overlay_release(struct overlay *o);

/* A copy of the picture [H,W,3] with, from a motion in the window of `size`
 * pixels: the front of the mesh as wire, landmarks, face crop (green; red
 * when lost) and window (blue), and a line of text (may be NULL).
 * m NULL draws the text only.  The copy belongs to the overlay; NULL when out
 * of memory. */
const uint8_t *overlay_draw(struct overlay *o, const uint8_t *rgb, size_t W,
                            size_t H, const struct motion *m, bool lost,
                            struct square window, double size,
                            const char *text);

/* A mesh's silhouette: mask [n,n], 255 inside; uv (V,2) in its pixels, z (V). */
void overlay_fill_mesh(uint8_t *mask, size_t n, const struct head *h,
                       const float *uv, const float *z);
/* The same of the mesh in the window. */
void overlay_silhouette(uint8_t *mask, struct overlay *o,
                        const struct motion *m, size_t n);

#endif
