/* Exif by libexif (exif.h). */
#include "formats/exif.h"

#include <stdlib.h>
#include <string.h>

#include <libexif/exif-data.h>

#define EXIF_MAX 0xffff        /* bytes of a marker of JPEG */

/* Adobe RGB (1998): the curve and x, y of white, red, green and blue. */
static const struct colour_tag exif_adobe = {
    .gamma = 563 / 256.0,
    .chroma = {.3127, .3290, .64, .33, .21, .71, .15, .06}
};

/* The parsed bytes; NULL without memory. */
static ExifData *exif_parse(const uint8_t *data, size_t n)
{
    static const char head[6] = "Exif\0";
    uint8_t *whole = malloc(n + sizeof head);
    ExifData *exif = exif_data_new();

    if (exif && whole) {
        memcpy(whole, head, sizeof head);
        memcpy(whole + sizeof head, data, n);
        exif_data_unset_option(exif, EXIF_DATA_OPTION_FOLLOW_SPECIFICATION);
        exif_data_load_data(exif, whole, (unsigned)(n + sizeof head));
    }
    free(whole);
    return exif;
}

void exif_read(struct door_tag *t, const uint8_t *data, size_t n)
{
    if (n >= 6 && !memcmp(data, "Exif\0", 6)) {
        data += 6;
        n -= 6;
    }
    if (n < 8 || n > EXIF_MAX ||
        (memcmp(data, "II", 2) && memcmp(data, "MM", 2)))
        return;
    ExifData *exif = exif_parse(data, n);

    if (!exif)
        return;
    ExifEntry *e = exif_content_get_entry(exif->ifd[EXIF_IFD_0],
                                          EXIF_TAG_ORIENTATION);

    if (e && e->format == EXIF_FORMAT_SHORT && e->size >= 2)
        t->orientation = orient_read(
            exif_get_short(e->data, exif_data_get_byte_order(exif)));
    e = exif_content_get_entry(exif->ifd[EXIF_IFD_INTEROPERABILITY],
                               EXIF_TAG_INTEROPERABILITY_INDEX);
    if (e && e->size >= 3 && !memcmp(e->data, "R03", 3) &&
        !t->colour.icc)
        t->colour = exif_adobe;
    exif_data_unref(exif);
}
