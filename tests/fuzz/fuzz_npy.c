/* libFuzzer target: npy files. */
#include "formats/npy.h"
#include "tests/fuzz/memory_file.h"

static int npy_read(const char *path)
{
    struct error err;
    struct npy a;
    size_t sum = 0, bytes;

    if (npy_load(&a, path, &err) == 0) {
        bytes = dtype_size(a.dtype);
        for (int k = 0; k < a.ndim; k++)
            bytes *= a.dim[k];
        for (size_t i = 0; i < bytes; i++)
            sum += ((const uint8_t *)a.data)[i];
        npy_release(&a);
    }
    return sum == SIZE_MAX;
}

FUZZ_FILE(npy_read)
