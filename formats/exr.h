/* OpenEXR files by OpenImageIO: float channels with names. */
#ifndef SPID_FORMATS_EXR_H
#define SPID_FORMATS_EXR_H

#include <stddef.h>

#include "lib/base/error.h"

/* Write pixel [height,width,channels] f32 with the given channel names (ZIP
 * compressed; attribute spid:encoding = sRGB; marked, formats/mark.h) to path
 * as it is: the caller renames. */
int exr_write(const char *path, const float *pixel, size_t width,
              size_t height, int channels, const char *const *names,
              struct error *err);

#endif
