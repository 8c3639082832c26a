/* A video device of Linux as output, such as v4l2loopback makes: other programs
 * see a camera. */
#ifndef SPID_FORMATS_V4L2_H
#define SPID_FORMATS_V4L2_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"

struct v4l2_sink;

/* Open path for pictures of width x height, YUYV.  NULL and EX_CANTCREAT when
 * it is no output device or takes no such pictures. */
struct v4l2_sink *v4l2_open(const char *path, size_t width, size_t height,
                              struct error *err);
/* One picture rgb [height,width,3]. */
int v4l2_write(struct v4l2_sink *v, const uint8_t *rgb, struct error *err);
void v4l2_close(struct v4l2_sink *v);         /* NULL is allowed */

#endif
