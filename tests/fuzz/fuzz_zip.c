/* libFuzzer target: zip archives, their directory and every entry, and what
 * is in them as PyTorch checkpoints. */
#include <stdlib.h>
#include <string.h>

#include "lib/lab/import/ziparchive.h"
#include "tests/fuzz/read_tensors.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char path[40];
    struct error err;
    int bad = 0, fd = memory_file(path, data, size);
    struct ziparchive *z = fd < 0 ? NULL : ziparchive_open(path, &err);

    for (size_t i = 0; z && i < ziparchive_count(z); i++) {
        size_t bytes = ziparchive_size(z, i);
        char *out = bytes > (16u << 20) ? NULL : malloc(bytes + 1);

        bad += ziparchive_find(z, ziparchive_name(z, i)) != i;
        if (out && !ziparchive_read(out, z, i, &err))
            bad += memchr(out, 0, bytes) == out + bytes;
        free(out);
    }
    ziparchive_close(z);
    if (fd >= 0)
        close(fd);
    return read_tensors(data, size) || bad;
}
