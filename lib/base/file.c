/* Files that take their final name when complete. */
#include "lib/base/file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

bool file_is_special(const char *path)
{
    struct stat st;

    return stat(path, &st) == 0 && !S_ISREG(st.st_mode);
}

bool file_ends(const char *name, const char *ending)
{
    size_t n = strlen(name), m = strlen(ending);

    return n > m && strcmp(name + n - m, ending) == 0;
}

int file_rename(const char *part, const char *path)
{
    if (file_is_special(path)) {
        errno = EEXIST;
        return -1;
    }
    return rename(part, path);
}
