/* What stands behind the person: a colour, a picture, or the source picture
 * with the person filled in. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesink.h"
#include "formats/image.h"
#include "formats/matte.h"

/* "white", "#rrggbb" or "r,g,b". */
static int parse_color(const char *value, uint8_t color[3])
{
    static const struct {
        const char *name;
        uint8_t color[3];
    } names[] = {
        {"black", {0, 0, 0}}, {"white", {255, 255, 255}},
        {"grey", {128, 128, 128}}, {"gray", {128, 128, 128}},
        {"green", {0, 255, 0}}, {"blue", {0, 0, 255}},
    };
    unsigned r, g, b;
    char rest;

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (strcmp(value, names[i].name) == 0) {
            memcpy(color, names[i].color, 3);
            return 0;
        }
    if ((strlen(value) == 7
         && sscanf(value, "#%2x%2x%2x%c", &r, &g, &b, &rest) == 3)
        || sscanf(value, "%u,%u,%u%c", &r, &g, &b, &rest) == 3) {
        if (r > 255 || g > 255 || b > 255)
            return -1;
        color[0] = (uint8_t)r;
        color[1] = (uint8_t)g;
        color[2] = (uint8_t)b;
        return 0;
    }
    return -1;
}

int background_parse(const char *value, void *dest, struct error *err)
{
    struct background *bg = dest;
    struct image im;
    uint8_t color[3];

    if (parse_color(value, color) == 0) {
        background_release(bg);
        memcpy(bg->color, color, 3);
        return 0;
    }
    if (image_read(&im, value, err) != 0)
        return error_prefix(err, "not a colour (expected R,G,B with 0 to 255,"
                            " #RRGGBB or a name) and not a picture");
    background_release(bg);
    free(im.alpha);
    bg->rgb = im.rgb;
    bg->width = im.width;
    bg->height = im.height;
    return 0;
}

void background_release(struct background *bg)
{
    free(bg->rgb);
    memset(bg, 0, sizeof *bg);
}

int background_from_source(struct background *bg, const uint8_t *rgb,
                           const uint8_t *matte, size_t n, struct error *err)
{
    uint8_t *out = malloc(3 * n * n);

    if (!out)
        return error_set(err, EX_OSERR, "no memory for the background");
    if (matte_fill(out, rgb, matte, n, err) != 0) {
        free(out);
        return -1;
    }
    background_release(bg);
    bg->rgb = out;
    bg->width = bg->height = n;
    return 0;
}

int background_from_identity(struct background *bg, const char *path,
                             struct error *err)
{
    const size_t dims[3] = {0, 0, 3};
    struct stream_reader *in = stream_open(path, NULL, err);
    struct record rec;
    int rc = -1, found = 0;

    while (in && !found && (rc = stream_read(in, &rec, err)) > 0) {
        const struct array *a = record_find(&rec, "rgb");
        const uint8_t *rgb, *matte;
        size_t n;

        if (!record_is(&rec, "SRCI"))
            continue;
        found = 1;
        n = a ? a->dim[0] : 0;
        rgb = record_get(&rec, "rgb", DTYPE_U8, 3, dims, err);
        matte = rgb ? record_get(&rec, "matte", DTYPE_U8, 2,
                                 (size_t[]){n, n}, err) : NULL;
        if (!matte || n == 0 || a->dim[1] != n)
            rc = rgb && matte ? error_set(err, EX_DATAERR, "SRCI rgb is not "
                                          "square") : -1;
        else
            rc = background_from_source(bg, rgb, matte, n, err);
    }
    if (in && rc == 0 && !found)
        rc = error_set(err, EX_DATAERR, "no SRCI record (expected an identity"
                       " from spid-shape)");
    stream_close(in);
    return rc < 0 ? error_prefix(err, "%s", path) : 0;
}
