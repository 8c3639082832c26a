/* The module's table: what formats/module.c finds in it. */
extern "C" {
#include "formats/media/camera.h"
#include "formats/media/still.h"

__attribute__((visibility("default"))) extern const struct media_module
    spid_media;

const struct media_module spid_media = {
    media_image_read, media_exr_write, media_panorama_read, webp_open,
    camera_open
};
}
