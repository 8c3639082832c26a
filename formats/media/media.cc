/* The module's table: what formats/media.c finds in it. */
extern "C" {
#include "formats/media.h"
#include "formats/media/exr.h"

__attribute__((visibility("default"))) extern const struct media spid_media;

const struct media spid_media = {
    image_read, media_exr_write, panorama_read, video_open, video_rate,
    video_frames, video_cut, video_read, video_close, video_create,
    video_write, video_finish, video_abandon
};
}
