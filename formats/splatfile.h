/* The .splat format of web viewers: 32 bytes a Gaussian (centre and linear
 * scale as f32, RGBA as u8, quaternion w,x,y,z as u8 around 128). */
#ifndef SPID_FORMATS_SPLATFILE_H
#define SPID_FORMATS_SPLATFILE_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/base/gaussians.h"

/* Write N Gaussians, y downwards as the viewers expect (a turn by 180 degrees
 * about z); color has `channels` floats a row, the first three sRGB.  Largest
 * and most opaque first, as the viewers' level of detail wants it. */
int splatfile_write(const char *path, size_t n, const float *mean,
                    const float *scale, const float *quat, const float *opacity,
                    const float *color, struct error *err);

/* Read a file, turned back to y upwards: three channels of display sRGB.  The
 * arrays are one block that the caller frees through *block.  EX_DATAERR when
 * the size is no multiple of 32 or a number is not finite. */
int splatfile_read(struct gaussians *g, void **block, const char *path,
                   struct error *err);

#endif
