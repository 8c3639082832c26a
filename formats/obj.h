/* Wavefront OBJ: one frame's mesh as text. */
#ifndef SPID_FORMATS_OBJ_H
#define SPID_FORMATS_OBJ_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

/* Write verts (V,3) in any unit, normals (V,3), faces (F,3) from 0.  "-" is
 * standard output; a named file takes its name when complete. */
int obj_write(const char *path, const float *verts, const float *normals,
              size_t V, const int32_t *faces, size_t F, struct error *err);

#endif
