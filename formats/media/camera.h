/* Inside the module: cameras. */
#ifndef SPID_FORMATS_MEDIA_CAMERA_H
#define SPID_FORMATS_MEDIA_CAMERA_H

#include "formats/module.h"

/* As video_open promises for what video_is_camera says. */
struct video_reader *camera_open(const char *path, struct error *err);

#endif
