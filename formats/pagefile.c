/* A page with an archive inside: template, zlib, base64. */
#include "formats/pagefile.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <zlib.h>

#include "formats/base64.h"
#include "formats/outfile.h"
#include "lib/base/file.h"

#define PAGEFILE_LEVEL 6        /* zlib's: 9 takes three times as long for one
                                 * part in two hundred */

/* The template's text (the caller frees it), and its place in it. */
static char *pagefile_template(char **place, const char *path,
                               struct error *err)
{
    char *text = file_read_text(path, PAGEFILE_MAX, err);

    if (!text)
        return NULL;
    *place = strstr(text, PAGEFILE_PLACE);
    if (*place && !strstr(*place + 1, PAGEFILE_PLACE))
        return text;
    error_set(err, EX_DATAERR, "%s: not a template of a page (expected %s "
              "in it once)", path, PAGEFILE_PLACE);
    free(text);
    return NULL;
}

/* The archive deflated (the caller frees it); NULL and *err. */
static uint8_t *pagefile_deflate(size_t *bytes, const struct st_tensor *t,
                                 size_t count, const char *const *meta,
                                 struct error *err)
{
    char *plain = NULL;
    size_t n = 0;
    uint8_t *packed = NULL;
    FILE *memory = open_memstream(&plain, &n);
    int rc = memory ? st_write(memory, t, count, meta, err)
                    : error_set(err, EX_OSERR, "out of memory");

    if (memory && fclose(memory) && rc == 0)
        rc = error_set(err, EX_OSERR, "out of memory");
    if (rc == 0) {
        uLongf room = compressBound(n);

        packed = malloc(room);
        if (!packed || compress2(packed, &room, (Bytef *)plain, n,
                                 PAGEFILE_LEVEL) != Z_OK) {
            error_set(err, EX_OSERR, "out of memory");
            free(packed);
            packed = NULL;
        }
        *bytes = room;
    }
    free(plain);
    return packed;
}

int pagefile_write(const char *path, const char *template_path,
                   const struct st_tensor *tensors, size_t count,
                   const char *const *meta, size_t *bytes,
                   struct error *err)
{
    struct outfile out = {0};
    char *place, *text = pagefile_template(&place, template_path, err);
    size_t n = 0;
    uint8_t *packed = text ? pagefile_deflate(&n, tensors, count, meta, err)
                           : NULL;
    int rc = -1;

    if (!packed || outfile_open(&out, path, err))
        goto out;
    fwrite(text, 1, (size_t)(place - text), out.file);
    fputs("<script type=\"application/x-spid\" id=\"avatar\">", out.file);
    base64_write(out.file, packed, n);
    fputs("</script>", out.file);
    fputs(place + strlen(PAGEFILE_PLACE), out.file);
    if (bytes)
        *bytes = strlen(text) + (n + 2) / 3 * 4;
    rc = outfile_close(&out, err);
out:
    free(packed);
    free(text);
    return rc;
}
