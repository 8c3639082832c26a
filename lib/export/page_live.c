/* The engine's files, packed as they are. */
#include "lib/export/page_live.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

/* A file's bytes as an array. */
static int page_pack_file(struct pack *k, const char *name, const char *path,
                          struct error *err)
{
    struct stat st;
    FILE *f = fopen(path, "rb");
    void *to;
    int rc = 0;

    if (!f || fstat(fileno(f), &st))
        rc = error_set(err, EX_NOINPUT, "%s: %s", path, strerror(errno));
    else if ((to = page_pack_add(k, name, ST_U8, (size_t)st.st_size, 0, NULL)) &&
             fread(to, 1, (size_t)st.st_size, f) != (size_t)st.st_size)
        rc = error_set(err, EX_IOERR, "%s: could not be read whole", path);
    if (f)
        fclose(f);
    return rc;
}

int page_pack_live(struct pack *k, const char *model, const char *head,
                   struct error *err)
{
    return page_pack_file(k, "engine.model", model, err) ||
           page_pack_file(k, "engine.head", head, err) ? -1 : 0;
}
