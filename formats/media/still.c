/* Pictures of the kinds that have readers of their own in the module: told by
 * how they begin, and read whole. */
#include "formats/media/still.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <libheif/heif.h>

#include "lib/base/file.h"

#define FILE_MAX ((size_t)1 << 30)     /* bytes that are read whole */

uint8_t *still_load(const char *path, size_t *bytes, struct error *err)
{
    char *data = file_read(bytes, path, FILE_MAX, err);

    if (!data || *bytes)
        return (uint8_t *)data;
    free(data);
    return error_null(err, EX_DATAERR, "%s: empty file (expected a picture)",
                      path);
}

/* Whether the file begins as WebP or as HEIF, and which. */
static int (*still_reader(const char *path))(struct image *im,
                                             const uint8_t *data, size_t n,
                                             const char *name,
                                             struct error *err)
{
    uint8_t b[64] = {0};
    FILE *f = fopen(path, "rb");
    const size_t n = f ? fread(b, 1, sizeof b, f) : 0;

    if (f)
        fclose(f);
    if (n >= 12 && !memcmp(b, "RIFF", 4) && !memcmp(b + 8, "WEBP", 4))
        return webp_read;
    if (n >= 12 && !memcmp(b + 4, "ftyp", 4) &&
        heif_check_filetype(b, (int)n) == heif_filetype_yes_supported)
        return heif_read;
    return NULL;
}

int still_read(struct image *im, const char *path, struct error *err)
{
    int (*const read)(struct image *, const uint8_t *, size_t, const char *,
                      struct error *) = still_reader(path);
    size_t n;
    uint8_t *data;

    if (!read)
        return 1;
    data = still_load(path, &n, err);
    if (!data)
        return -1;
    const int rc = read(im, data, n, path, err);
    free(data);
    return rc;
}

