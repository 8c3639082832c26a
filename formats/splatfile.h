/* The .splat format of web viewers: 32 bytes a Gaussian (centre and linear
 * scale as f32, RGBA as u8, quaternion w,x,y,z as u8 around 128). */
#ifndef SPID_FORMATS_SPLATFILE_H
#define SPID_FORMATS_SPLATFILE_H


#include "formats/splats.h"

/* Write Gaussians, y downwards as the viewers expect (a turn by 180 degrees
 * about z); the first three channels are sRGB.  Largest and most opaque first,
 * as the viewers' level of detail wants it. */
int splatfile_write(const char *path, const struct gaussians *g,
                    struct error *err);

/* Read a file, turned back to y upwards.  EX_DATAERR when the size is no
 * multiple of 32 or a number is not finite. */
int splatfile_read(struct splats *s, const char *path, struct error *err);

#endif
