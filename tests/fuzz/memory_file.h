/* What the fuzz targets share: bytes as a file with a name, for readers that
 * take a path, and a receiver of records that reads every byte. */
#ifndef SPID_TESTS_MEMORY_FILE_H
#define SPID_TESTS_MEMORY_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "lib/base/error.h"
#include "lib/stream/stream.h"

/* Returns a descriptor to close, or -1; path gets its name. */
static inline int memory_file(char path[40], const uint8_t *data, size_t size)
{
    int fd = memfd_create("fuzz", 0);

    if (fd < 0 || (size && write(fd, data, size) != (ssize_t)size))
        return -1;
    lseek(fd, 0, SEEK_SET);
    snprintf(path, 40, "/proc/self/fd/%d", fd);
    return fd;
}

/* The target read(path): 1 where something is not as it should be. */
#define FUZZ_FILE(read)                                             \
    int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);   \
    int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)    \
    {                                                               \
        char path[40];                                              \
        const int fd = memory_file(path, data, size);               \
        const int bad = fd >= 0 && read(path);                      \
                                                                    \
        if (fd >= 0)                                                \
            close(fd);                                              \
        return bad;                                                 \
    }

/* Before the first input, whose time a module's libraries are not: ends the
 * program where the module is not there. */
#define FUZZ_MODULE(load)                                           \
    int LLVMFuzzerInitialize(int *argc, char ***argv);              \
    int LLVMFuzzerInitialize(int *argc, char ***argv)               \
    {                                                               \
        struct error err;                                           \
                                                                    \
        (void)argc;                                                 \
        (void)argv;                                                 \
        if (load(&err))                                             \
            return 0;                                               \
        fprintf(stderr, "%s\n", err.text);                          \
        exit(1);                                                    \
    }

/* A record_sink (formats/recordjson.h): adds all bytes of rec's arrays to the
 * size_t that context is. */
static inline int record_sum(const struct record *rec, void *context,
                             struct error *err)
{
    size_t *sum = context;

    for (int i = 0; i < rec->count; i++)
        for (size_t k = 0; k < array_bytes(&rec->array[i]); k++)
            *sum += ((const uint8_t *)rec->array[i].data)[k];
    (void)err;
    return 0;
}

#endif
