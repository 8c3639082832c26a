/* One worker's scratch space and the renderer: an actor in a pose in front of
 * the camera, as linear light with coverage and labels. */
#ifndef SPID_LAB_PEOPLE_STAGE_H
#define SPID_LAB_PEOPLE_STAGE_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/lab/people/actor.h"
#include "lib/lab/people/motion.h"
#include "lib/lab/people/raster.h"

#define STAGE_GRID 2            /* samples per pixel and axis */
#define STAGE_SHADOW 256        /* side of the shadow map */

struct stage {
    int size;                   /* pixels of the picture's side */
    struct raster eye;          /* (size * STAGE_GRID)^2 */
    struct raster sun;          /* STAGE_SHADOW^2, seen from light 0 */
    float *shadow, *blur;       /* exponential shadow map and scratch */
    float *ao, *ao_blur;        /* (size,size) */
    float *sample;              /* (samples,3) shaded */
    float *light;               /* (size,size,3) linear, times coverage */
    float *cover;               /* (size,size) */
    uint8_t *label;             /* (size,size) */
    float *scratch;             /* (size,size,3) for the lens */
    uint8_t *rgb, *mask;        /* the finished picture */
    /* per actor */
    size_t room_v, room_p;
    float *verts;               /* (nv,3) driven, head frame */
    float *place, *normal;      /* (nv,3) camera frame */
    struct raster_vertex *spot; /* (nv) */
    float *tuft, *tuft_normal;  /* (npoint,3) strands, camera frame */
    struct raster_vertex *tuft_spot;
    uint32_t *owner;            /* (npoint) strand of a point */
    float lmk[68][2];           /* projected, pixels */
};

/* Memory for pictures of size x size. */
int stage_init(struct stage *s, int size, struct error *err);
/* Free what it holds. */
void stage_release(struct stage *s);

/* Pose and draw: fills verts, lmk, light, cover, label. */
int stage_render(struct stage *s, const struct actor *a,
                 const struct synth_motion *m, struct error *err);

/* ---- its parts --------------------------------------------------------- */

/* Vertices and normals of a for motion m, seen by the motion's camera. */
void stage_pose(struct stage *s, const struct actor *a,
                const struct synth_motion *m);
/* The depth that the light of env sees, for shadows. */
void stage_shadow(struct stage *s, const struct actor *a,
                  struct shade_env *env);
/* How much of the sky each pixel sees, smoothed. */
void stage_occlusion(struct stage *s, const struct actor *a);
/* Every visible sample in the light of env. */
void stage_shade(struct stage *s, const struct actor *a,
                 const struct shade_env *env);
/* Samples to pixels: means of colours, the commonest label. */
void stage_resolve(struct stage *s, const struct actor *a);

#endif
