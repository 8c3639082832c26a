/* The driven head as a glTF asset: mesh, skin, morph targets, animation,
 * texture (formats/glb.h), gathered frame by frame. */
#ifndef SPID_EXPORT_EXPORT_HEAD_H
#define SPID_EXPORT_EXPORT_HEAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/glb.h"
#include "lib/base/arena.h"
#include "lib/head/head.h"
#include "lib/head/lbs.h"

struct export_head_options {
    size_t expressions;    /* expression directions kept as morph targets */
    bool correctives;      /* pose correctives as targets, exact at keyframes */
    const char *clip;      /* the animation's name */
};

/* One frame of motion: head_motion plus the camera of the frame. */
struct export_motion {
    double time;           /* seconds */
    struct head_motion pose;
    float cam[12];         /* [R|t], head units */
};

struct export_head {
    struct arena memory;                /* but of what grows */
    const struct head *head;
    struct export_head_options opt;
    size_t targets;
    float *position, *normal;           /* (V,3) metres; unit */
    float joints[3 * GLB_JOINTS];       /* metres */
    float *delta;                       /* (targets, V, 3) metres */
    char (*name)[32];                   /* (targets) */
    float *uv;                          /* (V,2) or NULL */
    uint8_t *png;
    size_t png_bytes;
    size_t frames, room;                /* what has been gathered: */
    float *time, *weight, *rotation, *translation;
};

/* Bake the identity into the rest pose.  Borrows id->head.  -1 when memory is
 * short or more than GLB_MAX_TARGETS targets are asked for (EX_USAGE). */
int export_head_init(struct export_head *e, const struct identity *id,
                     const struct export_head_options *opt,
                     struct error *err);
/* Free what it holds; zeroed then. */
void export_head_release(struct export_head *e);

/* Texture from the source picture: texture coordinates are the projections of
 * verts (V,3), the source's driven vertices, by its camera.  png is a PNG
 * file of the picture; taken over (freed by export_head_release). */
int export_head_texture(struct export_head *e, const float *verts,
                        const float cam[12], uint8_t *png, size_t bytes,
                        struct error *err);

/* Append a keyframe.  Times must increase; one that does not is an error. */
int export_head_frame(struct export_head *e, const struct export_motion *m,
                      struct error *err);

/* Write everything gathered. */
int export_head_write(const struct export_head *e, const char *path,
                      struct error *err);

#endif
