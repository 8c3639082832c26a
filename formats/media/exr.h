/* What the module has of formats/exr.h: the mark is handed over. */
#ifndef SPID_FORMATS_MEDIA_EXR_H
#define SPID_FORMATS_MEDIA_EXR_H

#include <stddef.h>

#include "lib/base/error.h"

/* exr_write with the sentence of formats/mark.h, or NULL. */
int media_exr_write(const char *path, const float *pixel, size_t width,
                    size_t height, int channels, const char *const *names,
                    const char *mark, struct error *err);

#endif
