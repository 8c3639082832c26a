/* libFuzzer target: photographs in JPEG. */
#include "formats/jpeg.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* As image_read has it: an open file of some size. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    FILE *fp = size ? fmemopen((void *)(uintptr_t)data, size, "rb") : NULL;
    struct image im;
    struct error err;

    if (!fp)
        return 0;
    if (jpeg_read(&im, fp, "fuzz", &err) == 0)
        image_release(&im);
    fclose(fp);
    return 0;
}
