/* What stands behind the person: a colour, a picture, or the source picture
 * with the person filled in. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/framesink.h"
#include "formats/image.h"
#include "lib/base/crop.h"

/* "white", "#rrggbb" or "r,g,b". */
static int background_parse_color(const char *value, uint8_t color[3])
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

    if (background_parse_color(value, color) == 0) {
        background_release(bg);
        memcpy(bg->color, color, 3);
        return 0;
    }
    if (image_read(&im, value, err) != 0)
        return error_prefix(err, "not a colour (expected R,G,B with 0 to 255,"
                            " #RRGGBB, black, white, grey, green or blue) and "
                            "not a picture");
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

int background_fit(struct background *out, const struct background *bg,
                   size_t size, struct error *err)
{
    const double w = (double)bg->width, h = (double)bg->height;
    const struct square middle = {w / 2, h / 2, w < h ? w : h};
    uint8_t *rgb;

    memset(out, 0, sizeof *out);
    memcpy(out->color, bg->color, sizeof out->color);
    if (!bg->rgb)
        return 0;
    rgb = malloc(3 * size * size);
    if (!rgb || crop_resize_u8(rgb, size, bg->rgb, bg->width, bg->height,
                               3 * bg->width, 3, middle)) {
        free(rgb);
        return error_set(err, EX_OSERR, "no memory for the background");
    }
    out->rgb = rgb;
    out->width = out->height = size;
    return 0;
}
