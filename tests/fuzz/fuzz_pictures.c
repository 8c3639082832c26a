/* libFuzzer target: pictures of all kinds, most of them by OpenImageIO through
 * the module, which is instrumented where it is ours. */
#include "formats/image.h"
#include "formats/module.h"
#include "formats/panorama.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerInitialize(int *argc, char ***argv);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The module's 250 libraries are none of the first input's time. */
int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    struct error err;

    (void)argc;
    (void)argv;
    need_module(module_media(&err), &err);
    return 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct image im;
    struct panorama p;
    struct error err;
    volatile float sum = 0;
    char path[40];
    const int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    if (image_read(&im, path, &err) == 0)
        for (size_t i = 0; i < im.width * im.height; i++)
            sum += im.rgb[3 * i + 2] + (im.alpha ? im.alpha[i] : 0);
    image_release(&im);
    if (panorama_read(&p, path, &err) == 0)
        sum += p.rgb[3 * p.width * p.height - 1];
    panorama_release(&p);
    (void)sum;              /* every number has been read */
    close(fd);
    return 0;
}
