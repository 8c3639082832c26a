/* HEIF and AVIF by libheif: turned as the container says, with the profile or
 * the code points of their colours. */
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <libheif/heif.h>

#include "formats/media/still.h"

/* What is open while a file is read. */
struct heif_state {
    struct heif_context *file;
    struct heif_image_handle *handle;
    struct heif_image *picture;
    uint8_t *icc;
    uint16_t *row;
    struct door door;
};

/* A profile, or else code points.  The container has turned the picture. */
static struct door_tag heif_tag(struct heif_state *h)
{
    const size_t n = heif_image_handle_get_raw_color_profile_size(h->handle);
    struct heif_color_profile_nclx *code = NULL;
    struct door_tag t = {
        .alpha = heif_image_handle_has_alpha_channel(h->handle),
        .pixels = {.channels = 3, .bits = 8}
    };

    t.pixels.extra = t.alpha;
    if (heif_image_handle_get_luma_bits_per_pixel(h->handle) > 8)
        t.pixels.bits = 16;
    h->icc = n ? malloc(n) : NULL;
    if (h->icc && heif_image_handle_get_raw_color_profile(h->handle, h->icc)
                      .code == heif_error_Ok) {
        t.colour.icc = h->icc;
        t.colour.icc_bytes = n;
    } else if (heif_image_handle_get_nclx_color_profile(h->handle, &code)
                   .code == heif_error_Ok && code) {
        t.colour.primaries = (int)code->color_primaries;
        t.colour.transfer = (int)code->transfer_characteristics;
    }
    heif_nclx_color_profile_free(code);
    return t;
}

/* libheif's interleaved pixels, in 8 bits or as many as there are. */
static enum heif_chroma heif_layout(const struct door_tag *t)
{
    if (t->pixels.bits == 8)
        return t->alpha ? heif_chroma_interleaved_RGBA
                        : heif_chroma_interleaved_RGB;
    return t->alpha ? heif_chroma_interleaved_RRGGBBAA_LE
                    : heif_chroma_interleaved_RRGGBB_LE;
}

/* The decoded rows through the door; deep ones are brought to 16 bits. */
static int heif_rows(struct heif_state *h, struct error *err)
{
    const size_t C = (size_t)(h->door.tag.pixels.channels +
                              h->door.tag.pixels.extra);
    const size_t n = C * h->door.width;
    const int bits = heif_image_get_bits_per_pixel_range(
        h->picture, heif_channel_interleaved);
    const unsigned max = (1u << (bits > 8 && bits <= 16 ? bits : 16)) - 1;
    int stride;
    const uint8_t *p = heif_image_get_plane_readonly(
        h->picture, heif_channel_interleaved, &stride);

    h->row = malloc(n * sizeof *h->row);
    if (!p || !h->row)
        return error_set(err, EX_OSERR, "out of memory");
    for (size_t y = 0; y < h->door.height; y++, p += stride) {
        const uint16_t *deep = (const uint16_t *)(const void *)p;

        if (h->door.tag.pixels.bits == 8) {
            door_row(&h->door, p, y);
            continue;
        }
        for (size_t i = 0; i < n; i++)
            h->row[i] = (uint16_t)((deep[i] * 65535u + max / 2) / max);
        door_row(&h->door, h->row, y);
    }
    return door_close(&h->door, err);
}

/* The primary picture of the file in memory. */
static int heif_decode(struct heif_state *h, struct image *im,
                       const uint8_t *data, size_t n, const char *name,
                       struct error *err)
{
    struct heif_error e = heif_context_read_from_memory_without_copy(
        h->file, data, n, NULL);

    if (e.code == heif_error_Ok)
        e = heif_context_get_primary_image_handle(h->file, &h->handle);
    if (e.code != heif_error_Ok)
        return error_set(err, EX_DATAERR, "%s: damaged picture: %s", name,
                         e.message);
    const struct door_tag tag = heif_tag(h);
    const int W = heif_image_handle_get_width(h->handle);
    const int H = heif_image_handle_get_height(h->handle);

    if (door_check_size(W > 0 ? (size_t)W : 0, H > 0 ? (size_t)H : 0, name,
                        err))
        return -1;
    e = heif_decode_image(h->handle, &h->picture, heif_colorspace_RGB,
                          heif_layout(&tag), NULL);
    if (e.code != heif_error_Ok)
        return error_set(err, EX_DATAERR, "%s: damaged picture: %s", name,
                         e.message);
    const int w = heif_image_get_width(h->picture, heif_channel_interleaved);
    const int g = heif_image_get_height(h->picture, heif_channel_interleaved);

    if (door_open(&h->door, im, w > 0 ? (size_t)w : 0, g > 0 ? (size_t)g : 0,
                  &tag, name, err))
        return -1;
    return heif_rows(h, err);
}

int heif_read(struct image *im, const uint8_t *data, size_t n,
              const char *name, struct error *err)
{
    struct heif_state h = {.file = heif_context_alloc()};
    const int rc = h.file ? heif_decode(&h, im, data, n, name, err)
                          : error_set(err, EX_OSERR, "out of memory");

    heif_image_release(h.picture);
    heif_image_handle_release(h.handle);
    heif_context_free(h.file);
    door_release(&h.door);
    free(h.icc);
    free(h.row);
    return rc;
}
