/* glTF 2.0 binary files (tinygltf): Gaussians by KHR_gaussian_splatting, and
 * the head as a skinned, morphed, animated mesh.  Lengths in metres, axes x to
 * the subject's left, y up, z to the front: the head model's own, which are
 * also glTF's.  Same input, same bytes. */
#ifndef SPID_FORMATS_GLB_H
#define SPID_FORMATS_GLB_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

#define GLB_JOINTS 5          /* root, neck, jaw, left eye, right eye */
#define GLB_MAX_TARGETS 200

struct gaussians;             /* lib/base/gaussians.h */

/* Write one set of Gaussians, lengths multiplied by `unit` to be metres, and
 * the first three channels as display sRGB.  The file takes its name when
 * complete.  -1: EX_DATAERR when N is 0 or a number is not finite, EX_IOERR. */
int glb_write_splats(const char *path, const struct gaussians *g, float unit,
                     struct error *err);

/* The animated head, borrowed for the call. */
struct glb_head {
    size_t V, F;
    const float *position;    /* (V,3) with the identity folded in */
    const float *normal;      /* (V,3) unit */
    const int32_t *faces;     /* (F,3) counter-clockwise from outside */
    const float *joints;      /* (5,3) */
    const int32_t *parents;   /* (5) -1 for the root */
    const float *weights;     /* (V,5) rows sum to 1 */
    const float *uv;          /* (V,2) or NULL: no texture */
    const uint8_t *png;       /* the texture as a PNG file, or NULL */
    size_t png_bytes;
    size_t targets;           /* up to GLB_MAX_TARGETS */
    const char *const *target_name;   /* (targets) */
    const float *const *target_delta; /* (targets) of (V,3) */
    const char *clip;         /* the animation's name */
    size_t frames;            /* 0: no animation */
    const float *time;        /* (frames) seconds, strictly increasing */
    const float *target_weight;       /* (frames,targets) */
    const float *rotation;    /* (frames,5,4) x,y,z,w of each joint */
    const float *translation; /* (frames,3) of the root joint */
    float yfov;               /* of the camera at the origin, radians; the
                               * driven root moves before it */
};

/* Write h as one binary file, beside its name first.  EX_CANTCREAT,
 * EX_IOERR. */
int glb_write_head(const char *path, const struct glb_head *h,
                   struct error *err);

/* Say what a viewer would trip over in a GLB or glTF file, a line per finding
 * through say(context, text).  Returns the number of findings, or -1 when the
 * file can't be read as glTF at all. */
int glb_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err);

/* Read the Gaussians of the first primitive with KHR_gaussian_splatting, metres
 * multiplied by `unit`. */
struct splats;                /* formats/splats.h */
int glb_read_splats(struct splats *s, float unit, const char *path,
                    struct error *err);

/* Read the first skinned mesh as a viewer shows it in the first frame of the
 * first animation (at rest without one): verts (V,3) metres in the scene's
 * frame, faces (F,3).  EX_DATAERR when it has other sizes or is not whole. */
int glb_read_posed(float *verts, int32_t *faces, size_t V, size_t F,
                   const char *path, struct error *err);

#endif
