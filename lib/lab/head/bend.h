/* One mesh bent to where another lies, by points known in both. */
#ifndef SPID_LAB_HEAD_BEND_H
#define SPID_LAB_HEAD_BEND_H

#include <stddef.h>

#include "lib/base/error.h"

/* A place of the mesh and where it belongs. */
struct control { double from[3], to[3]; };

/* at (n,3) moved by the radial basis through the controls. */
int bend_mesh(double *at, size_t n, const struct control *c, size_t count,
              struct error *err);

#endif
