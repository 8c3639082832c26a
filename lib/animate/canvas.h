/* What a picture is drawn into before it is written. */
#ifndef SPID_ANIMATE_CANVAS_H
#define SPID_ANIMATE_CANVAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/splat/types.h"

/* N = size; every buffer is owned. */
struct canvas {
    size_t size, channels;
    float *image;               /* (N,N,channels) */
    uint16_t *half;             /* in place of image: in half precision */
    float *alpha;               /* (N,N) */
    float *depth;               /* (N,N), or NULL */
    float *place;               /* (N,N,3), once there is a texture, ... */
    struct splat_place_view view;       /* ... and what they are relative to */
    float *photo;               /* (N,N,5) looked up, for FEAT */
};

/* EX_OSERR without memory; c is then to be released all the same. */
int canvas_init(struct canvas *c, size_t size, size_t channels, bool half,
                bool depth, struct error *err);
void canvas_release(struct canvas *c);  /* of a zeroed *c: nothing */

/* Memory for places, and for what is looked up there if `photo`, unless it is
 * there already. */
int canvas_reserve(struct canvas *c, bool photo, struct error *err);

#endif
