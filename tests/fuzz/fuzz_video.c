/* libFuzzer target: frames of video files, through the module. */
#include "formats/module.h"
#include "formats/video.h"
#include "tests/fuzz/memory_file.h"

FUZZ_MODULE(module_video)

/* The first few frames; a damaged file may announce any number. */
static int video_read_some(const char *path)
{
    struct video_reader *v;
    struct error err;

    v = video_open(path, false, &err);
    for (int i = 0; v && i < 4; i++) {
        const uint8_t *rgb;
        size_t width, height, sum = 0;
        double time;

        if (video_read(v, &rgb, &width, &height, &time, &err) != 1)
            break;
        for (size_t k = 0; k < 3 * width * height; k += 1021)
            sum += rgb[k];
        if (sum + rgb[3 * width * height - 1] == SIZE_MAX)
            break;
    }
    video_close(v);
    return 0;
}

FUZZ_FILE(video_read_some)
