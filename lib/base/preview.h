/* A plain z-buffer renderer for tests and previews: shaded triangles to RGB,
 * four samples per pixel.  Not for the pipeline. */
#ifndef SPID_BASE_PREVIEW_H
#define SPID_BASE_PREVIEW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct preview_mesh {
    const float *verts;       /* (V,3) head frame, any unit */
    const int32_t *faces;     /* (F,3) */
    const float *color;       /* (V,3) linear albedo, or NULL for clay */
    size_t nv, nf;
};

struct preview_view {
    float yaw, pitch;         /* degrees the head turns: yaw > 0 to its left */
    float centre[3];          /* what lies in the middle, the mesh's unit */
    float height;             /* what spans the picture's height, same unit */
    bool wire;                /* draw the triangles' edges */
};

/* Draw into the rectangle at (x0, y0), w x h, of rgb (H, stride pixels, 3):
 * orthographic with a little perspective, key and fill light, grey ground.
 * Returns 0, or -1 when memory runs out. */
int preview_draw(uint8_t *rgb, size_t stride, size_t x0, size_t y0, size_t w,
                 size_t h, const struct preview_mesh *mesh,
                 const struct preview_view *view, struct error *err);

#endif
