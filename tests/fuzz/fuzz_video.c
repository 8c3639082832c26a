/* libFuzzer target: frames of video files, through the module. */
#include "formats/module.h"
#include "formats/video.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    struct error err;

    (void)argc;
    (void)argv;
    need_module(module_video(&err), &err);
    return 0;
}

/* The first few frames; a damaged file may announce any number. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct video_reader *v;
    struct error err;
    char path[40];
    const int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
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
    if (v)
        (void)video_end(v);
    video_close(v);
    close(fd);
    return 0;
}
