/* Bytes as a file with a name, for readers that take a path. */
#ifndef SPID_TESTS_MEMORY_FILE_H
#define SPID_TESTS_MEMORY_FILE_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

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

#endif
