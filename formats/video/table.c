/* The module's table: what formats/module.c finds in it. */
#include "formats/video/table.h"

extern const struct video_module spid_video;

__attribute__((visibility("default"))) const struct video_module spid_video = {
    reader_open, writer_create, writer_write, writer_finish
};
