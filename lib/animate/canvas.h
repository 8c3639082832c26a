/* What Gaussians are drawn into: colours for a picture, or features for the
 * refiner, with the photograph over or beside them. */
#ifndef SPID_ANIMATE_CANVAS_H
#define SPID_ANIMATE_CANVAS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/base/relative_pose.h"
#include "lib/photo/texture.h"
#include "lib/splat/types.h"

/* N = size; every buffer is owned. */
struct canvas {
    size_t size, channels;
    float *image;               /* (N,N,channels) */
    uint16_t *half;             /* in place of image: in half precision */
    float *alpha;               /* (N,N) */
    float *depth;               /* (N,N), or NULL */
    struct splat_place_view view;       /* what places are relative to */
    float *photo;               /* (N,N,5) looked up there, for FEAT */
    bool places;                /* these are asked for, too: */
    float *place;               /* (N,N,4) */
    struct texture_shader shader;
    bool lit;                   /* the head's light is known: set before a
                                 * frame is drawn, with */
    float light[LAMP_SIZE];     /* the lamp in it, head frame */
    float *gain;                /* how it changed (lib/splat/relight.h), once
                                 * lit, */
    float tint[3];              /* and by the lamp's colour */
};

/* EX_OSERR without memory; c is then to be released all the same. */
int canvas_init(struct canvas *c, size_t size, size_t channels, bool half,
                bool depth, struct error *err);
void canvas_release(struct canvas *c);  /* of a zeroed *c: nothing */

/* Eq. C: what s has loaded, seen by cam.  t (NULL: none) is the photograph
 * that places are places of by c->view: over the colours, or beside features
 * (beside), as c->photo, for the refiner; c->gain changes colours, or is
 * beside features, likewise.  EX_OSERR. */
int canvas_draw(struct canvas *c, struct splat *s,
                const struct splat_camera *cam, const struct texture *t,
                bool beside, struct error *err);

#endif
