/* A file of tensors, opened and read to its last byte. */
#ifndef SPID_TESTS_READ_TENSORS_H
#define SPID_TESTS_READ_TENSORS_H

#include <stdint.h>

#include "lib/lab/import/tensorfile.h"
#include "tests/fuzz/memory_file.h"

/* 0; 1 when something was not as tensorfile.h says. */
static inline int read_tensors(const uint8_t *data, size_t size)
{
    char path[40];
    struct error err = {0};
    int bad = 0, fd = memory_file(path, data, size);
    struct tensorfile *f = fd < 0 ? NULL : tensorfile_open(path, &err);
    volatile uint8_t sum = 0;

    if (fd >= 0 && !f && (!err.code || !err.text[0]))
        bad = 1;
    for (size_t i = 0; f && i < tensorfile_count(f); i++) {
        const struct tensorfile_tensor *t = tensorfile_at(f, i);
        size_t bytes = t->count * st_dtype_size(t->dtype);
        const uint8_t *p;

        bad |= tensorfile_find(f, t->name) != i;
        if (bytes > (1u << 20) || !(p = tensorfile_data(f, i, &err)))
            continue;
        for (size_t k = 0; k < bytes; k++)
            sum = (uint8_t)(sum + p[k]);
    }
    tensorfile_close(f);
    if (fd >= 0)
        close(fd);
    return bad;
}

#endif
