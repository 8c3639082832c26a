/* The z-buffer of the synthetic camera: which triangle or strand each sample
 * sees, and where on it.  Shading comes afterwards and looks up the rest. */
#ifndef SPID_LAB_PEOPLE_RASTER_H
#define SPID_LAB_PEOPLE_RASTER_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* A vertex on the sample grid: x, y in samples (the centre of sample i is
 * i + 0.5), q = 1/z with z the camera depth; q <= 0 is behind the camera. */
struct raster_vertex {
    float x, y, q;
};

#define RASTER_NONE 0xffffffffu
#define RASTER_STRAND 0x80000000u  /* set in ids of strand segments */

/* Planes of w x h samples.  b1, b2: weights of the second and third corner of
 * a triangle; for a strand, the place along (0..1) and across (-1..1). */
struct raster {
    int w, h;
    float *q;
    uint32_t *id;
    float *b1, *b2;
};

/* Memory for w x h samples; raster_clear comes before what is drawn. */
int raster_init(struct raster *r, int w, int h, struct error *err);
/* Free what it holds. */
void raster_release(struct raster *r);
/* No sample is drawn. */
void raster_clear(struct raster *r);

/* Draw faces [count,3]; face i gets id base + i.  Corners run counter-clockwise
 * on the screen when seen from outside; cull drops the others.  A triangle
 * with a corner behind the camera is not drawn. */
void raster_triangles(struct raster *r, const struct raster_vertex *v,
                      const int32_t *faces, size_t count, uint32_t base,
                      int cull);

/* Draw one strand of n points; segment i gets id base + i.  half is half its
 * width in samples at the root, half * tip at the end; where that is thinner
 * than a sample, samples are left out at random in proportion. */
void raster_strand(struct raster *r, const struct raster_vertex *v, int n,
                   uint32_t base, float half, float tip);

#endif
