/* libFuzzer target: pictures of all kinds, most of them by OpenImageIO through
 * the module, which is instrumented where it is ours. */
#include "formats/image.h"
#include "formats/module.h"
#include "formats/panorama.h"
#include "tests/fuzz/memory_file.h"

FUZZ_MODULE(module_media)

static int pictures_read(const char *path)
{
    struct image im;
    struct panorama p;
    struct error err;
    volatile float sum = 0;

    if (image_read(&im, path, &err) == 0)
        for (size_t i = 0; i < im.width * im.height; i++)
            sum += im.rgb[3 * i + 2] + (im.alpha ? im.alpha[i] : 0);
    image_release(&im);
    if (panorama_read(&p, path, &err) == 0)
        sum += p.rgb[3 * p.width * p.height - 1];
    panorama_release(&p);
    (void)sum;              /* every number has been read */
    return 0;
}

FUZZ_FILE(pictures_read)
