/* Files that take their final name when complete. */
#include "lib/base/file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

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

char *file_read_text(const char *path, size_t most, struct error *err)
{
    FILE *f = fopen(path, "rb");
    char *text = f ? malloc(most + 2) : NULL;

    if (!f) {
        error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
        return NULL;
    }
    size_t n = text ? fread(text, 1, most + 1, f) : 0;
    if (!text || ferror(f) || n > most) {
        error_set(err, EX_NOINPUT, "%s: cannot be read (expected a file of at "
                  "most %zu bytes)", path, most);
        free(text);
        text = NULL;
    } else {
        text[n] = 0;
    }
    fclose(f);
    return text;
}

void file_temporary(char *path, const char *name)
{
    const char *dir = getenv("TMPDIR");
    const bool fits = dir && *dir &&
                      strlen(dir) + strlen(name) + 2 <= FILE_TEMPORARY;

    snprintf(path, FILE_TEMPORARY, "%s/%s", fits ? dir : "/tmp", name);
}
