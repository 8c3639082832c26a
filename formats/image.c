/* Pictures by what reads each kind. */
#include "formats/image.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/jpeg.h"
#include "formats/mark.h"
#include "formats/module.h"
#include "formats/png.h"
#include "lib/base/kept.h"

/* From what can be read again. */
static int image_read_file(struct image *im, const char *path,
                           struct error *err)
{
    FILE *fp = fopen(path, "rb");
    const struct media_module *m;
    int first, second, rc;

    if (!fp)
        return error_set(err, EX_NOINPUT, "%s: cannot open: %s", path,
                         strerror(errno));
    first = getc(fp);
    second = getc(fp);
    rewind(fp);
    if (first == 0x89 || (first == 0xff && second == 0xd8)) {
        rc = first == 0xff ? jpeg_read(im, fp, path, err)
             : png_read_next(im, fp, IMAGE_MAX_PIXELS, err)
                 ? error_prefix(err, "%s", path) : 0;
        fclose(fp);
        return rc;
    }
    fclose(fp);
    m = module_media(err);
    return m ? m->image_read(im, path, err) : error_prefix(err, "%s", path);
}

int image_read(struct image *im, const char *path, struct error *err)
{
    struct kept k;
    const char *file = kept_open(&k, path, IMAGE_MAX_BYTES, err);

    memset(im, 0, sizeof *im);
    return file ? kept_close(&k, image_read_file(im, file, err), err) : -1;
}

void image_release(struct image *im)
{
    free(im->rgb);
    free(im->alpha);
    memset(im, 0, sizeof *im);
}

int exr_write(const char *path, const float *pixel, size_t width,
              size_t height, int channels, const char *const *names,
              struct error *err)
{
    const struct media_module *m = module_media(err);

    return m ? m->exr_write(path, pixel, width, height, channels, names,
                            mark_text(), err)
             : error_prefix(err, "%s", path);
}
