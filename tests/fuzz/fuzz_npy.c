/* libFuzzer target: npy files. */
#include "formats/npy.h"
#include "tests/fuzz/memory_file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct error err;
    struct npy a;
    size_t sum = 0, bytes;
    char path[40];
    int fd = memory_file(path, data, size);

    if (fd < 0)
        return 0;
    if (npy_load(&a, path, &err) == 0) {
        bytes = dtype_size(a.dtype);
        for (int k = 0; k < a.ndim; k++)
            bytes *= a.dim[k];
        for (size_t i = 0; i < bytes; i++)
            sum += ((const uint8_t *)a.data)[i];
        npy_release(&a);
    }
    close(fd);
    return sum == SIZE_MAX;
}
