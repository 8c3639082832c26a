/* Gaussian scenes as PLY files in the layout of the original 3DGS code: logit
 * opacity, log scale, spherical harmonics.  That layout has y downwards; the
 * head model has y up, so files are turned by 180 degrees about z on the way
 * out and back on the way in:  x' = -x, y' = -y, z' = z and
 * (w,x,y,z)' = (-z,-y,x,w). */
#ifndef SPID_FORMATS_PLY_H
#define SPID_FORMATS_PLY_H

#include <stdbool.h>
#include <stddef.h>

#include "formats/splats.h"

/* Write the first three channels of g as bands of degree 0 (the rest cannot be
 * carried).  turn: to y down; otherwise model space as it is.  "-" is standard
 * output.  Never NaN: EX_DATAERR names array and index. */
int ply_write(const char *path, const struct gaussians *g, bool turn,
              struct error *err);

/* The same in SuperSplat's compressed form, 16 bytes a Gaussian and 72 for
 * 256, in an order of its own. */
int ply_write_packed(const char *path, const struct gaussians *g, bool turn,
                     struct error *err);

/* Read any property order and number type, with extra properties, without
 * normals, with 0, 9, 24 or 45 f_rest, as text or binary in either byte order,
 * and SuperSplat's compressed form.  turn: the file has y down, make it y up.
 * Header, counts and sizes are checked before anything is allocated;
 * EX_DATAERR names file, property and index. */
int ply_read(struct splats *s, const char *path, bool turn, struct error *err);

/* Evaluate the higher bands for an eye at that place (scene axes) into color
 * and clamp below at 0, as viewers do.  Nothing to do for degree 0. */
void ply_shade(struct splats *s, const float eye[3]);

/* Say what a viewer would trip over, a line each.  Returns the number of
 * findings, -1 when the file is no Gaussian PLY. */
int ply_lint(const char *path, void (*say)(void *context, const char *text),
             void *context, struct error *err);

#endif
