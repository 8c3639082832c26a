/* Gaussian scenes as PLY files in the layout of the original 3DGS code: logit
 * opacity, log scale, spherical harmonics.  That layout has y downwards; the
 * head model has y up, so files are turned by 180 degrees about z on the way
 * out and back on the way in:  x' = -x, y' = -y, z' = z and
 * (w,x,y,z)' = (-z,-y,x,w). */
#ifndef SPID_FORMATS_PLY_H
#define SPID_FORMATS_PLY_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/gaussians.h"

/* Write the first three channels of g as bands of degree 0 (the rest cannot be
 * carried).  turn: to y down; otherwise model space as it is.  "-" is standard
 * output.  Never NaN: EX_DATAERR names array and index. */
int ply_write(const char *path, const struct gaussians *g, bool turn,
              struct error *err);

/* The same in SuperSplat's compressed form, 16 bytes a Gaussian and 72 for
 * 256, in an order of its own. */
int ply_write_packed(const char *path, const struct gaussians *g, bool turn,
                     struct error *err);

/* A scene read from a file; one allocation, freed by ply_release.  Linear
 * values as the rasteriser wants them. */
struct ply_scene {
    size_t n;
    int degree;             /* of the spherical harmonics, 0 to 3 */
    float *mean;            /* (N,3) */
    float *scale;           /* (N,3) standard deviations */
    float *quat;            /* (N,4) w,x,y,z unit */
    float *opacity;         /* (N) */
    float *color;           /* (N,3) of degree 0: 0.5 + SH0 f_dc */
    float *rest;            /* (N,3,(degree+1)^2 - 1) f_rest, channel-major;
                             * NULL when degree is 0.  In the file's axes. */
    bool rotated;           /* the file was taken as y down */
};

/* Read any property order and number type, with extra properties, without
 * normals, with 0, 9, 24 or 45 f_rest, as text or binary in either byte order,
 * and SuperSplat's compressed form.  turn: the file has y down, make it y up.
 * Header, counts and sizes are checked before anything is allocated;
 * EX_DATAERR names file, property and index. */
int ply_read(struct ply_scene *s, const char *path, bool turn,
             struct error *err);
/* Free what it holds; zeroed then. */
void ply_release(struct ply_scene *s);

/* Evaluate the higher bands for an eye at that place (scene axes) into color
 * and clamp below at 0, as viewers do.  Nothing to do for degree 0. */
void ply_shade(struct ply_scene *s, const float eye[3]);

/* Say what a viewer would trip over, a line each.  Returns the number of
 * findings, -1 when the file is no Gaussian PLY. */
int ply_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err);

#endif
