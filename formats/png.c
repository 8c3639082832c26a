/* PNG through libpng, whose way of failing (longjmp) ends here. */
#include "formats/png.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/image.h"
#include "formats/mark.h"
#include "formats/outfile.h"

/* libpng's text, kept for the return value. */
static void png_on_error(png_structp png, png_const_charp text)
{
    struct error *err = png_get_error_ptr(png);

    error_set(err, EX_DATAERR, "png: %s", text);
    longjmp(png_jmpbuf(png), 1);
}

/* Warnings are not errors. */
static void png_on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text;
}

/* libpng's constant for 1 to 4 channels. */
static int png_color_type(int channels)
{
    static const int type[5] = {
        0, PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA,
        PNG_COLOR_TYPE_RGB, PNG_COLOR_TYPE_RGB_ALPHA
    };

    return type[channels];
}

/* The mark, as text and as XMP, unless marks are off. */
static void png_set_mark(png_structp png, png_infop info)
{
    static char comment[] = "Comment", xmp[] = "XML:com.adobe.xmp";
    png_text text[2] = {
        {.compression = PNG_TEXT_COMPRESSION_NONE, .key = comment,
         .text = (png_charp)mark_text()},
        {.compression = PNG_ITXT_COMPRESSION_NONE, .key = xmp,
         .text = (png_charp)mark_xmp()}
    };

    if (mark_text())
        png_set_text(png, info, text, 2);
}

/* With or without the mark. */
static int png_write_picture(FILE *fp, const uint8_t *pixel, size_t width,
                             size_t height, int channels, bool marked,
                             struct error *err)
{
    struct error e = {0};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &e,
                                              png_on_error, png_on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;

    if (!info) {
        png_destroy_write_struct(&png, NULL);
        return error_set(err, EX_OSERR, "png: out of memory");
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return error_set(err, EX_IOERR, "%s", e.text);
    }
    png_init_io(png, fp);
    png_set_IHDR(png, info, (png_uint_32)width, (png_uint_32)height, 8,
                 png_color_type(channels), PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
    if (marked)
        png_set_mark(png, info);
    png_set_compression_level(png, 2);
    png_set_filter(png, 0, PNG_FILTER_SUB | PNG_FILTER_UP);
    png_write_info(png, info);
    for (size_t y = 0; y < height; y++)
        png_write_row(png, pixel + y * width * (size_t)channels);
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    return 0;
}

int png_write(FILE *fp, const uint8_t *pixel, size_t width, size_t height,
              int channels, struct error *err)
{
    return png_write_picture(fp, pixel, width, height, channels, false, err);
}

int png_write_marked(FILE *fp, const uint8_t *pixel, size_t width,
                     size_t height, int channels, struct error *err)
{
    return png_write_picture(fp, pixel, width, height, channels, true, err);
}

/* What is being read; lives outside the frame that longjmp returns to. */
struct reading {
    png_structp png;
    png_infop info;
    uint8_t *rgba;
    png_bytepp rows;
    struct error e;
};

/* As RGBA of 8 bits, whatever the file holds; fails by longjmp. */
static void png_read_pixels(struct reading *r, FILE *fp, size_t *width,
                            size_t *height, size_t most)
{
    png_structp png = r->png;
    size_t W, H;

    png_init_io(png, fp);
    png_set_user_limits(png, IMAGE_MAX_SIDE, IMAGE_MAX_SIDE);
    png_read_info(png, r->info);
    W = png_get_image_width(png, r->info);
    H = png_get_image_height(png, r->info);
    if (W * H > most) {
        char text[96];

        snprintf(text, sizeof text, "picture of %zu x %zu pixels (expected at "
                 "most %zu in all)", W, H, most);
        png_error(png, text);
    }
    png_set_expand(png);
    png_set_scale_16(png);
    png_set_gray_to_rgb(png);
    png_set_add_alpha(png, 255, PNG_FILLER_AFTER);
    png_set_interlace_handling(png);
    png_read_update_info(png, r->info);
    if (png_get_rowbytes(png, r->info) != 4 * W)
        png_error(png, "unexpected row size");
    r->rgba = malloc(4 * W * H);
    r->rows = malloc(H * sizeof *r->rows);
    if (!r->rgba || !r->rows)
        png_error(png, "out of memory");
    for (size_t y = 0; y < H; y++)
        r->rows[y] = r->rgba + 4 * W * y;
    png_read_image(png, r->rows);
    png_read_end(png, NULL);
    *width = W;
    *height = H;
}

/* png_read_pixels with libpng's way of failing turned into a return value. */
static int png_read_rgba(struct reading *r, FILE *fp, size_t *width,
                         size_t *height, size_t most)
{
    r->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r->e, png_on_error,
                                    png_on_warning);
    r->info = r->png ? png_create_info_struct(r->png) : NULL;
    if (!r->info)
        return error_set(&r->e, EX_OSERR, "png: out of memory");
    if (setjmp(png_jmpbuf(r->png)))
        return -1;
    png_read_pixels(r, fp, width, height, most);
    return 0;
}

int png_read_next(FILE *fp, uint8_t **rgb, uint8_t **alpha, size_t *width,
                  size_t *height, size_t most, struct error *err)
{
    struct reading r = {0};
    bool transparent = false;
    int rc = -1;

    *rgb = *alpha = NULL;
    if (png_read_rgba(&r, fp, width, height, most) != 0) {
        error_set(err, r.e.code, "%s", r.e.text);
        goto out;
    }
    *rgb = malloc(3 * *width * *height);
    *alpha = malloc(*width * *height);
    if (!*rgb || !*alpha) {
        error_set(err, EX_OSERR, "png: out of memory");
        goto out;
    }
    for (size_t i = 0; i < *width * *height; i++) {
        memcpy(*rgb + 3 * i, r.rgba + 4 * i, 3);
        transparent |= ((*alpha)[i] = r.rgba[4 * i + 3]) != 255;
    }
    rc = 0;
out:
    if (rc != 0 || !transparent) {
        free(*alpha);
        *alpha = NULL;
    }
    if (rc != 0) {
        free(*rgb);
        *rgb = NULL;
    }
    png_destroy_read_struct(&r.png, &r.info, NULL);
    free(r.rgba);
    free(r.rows);
    return rc;
}

int image_write_png(const char *path, const uint8_t *pixel, size_t width,
                    size_t height, int channels, struct error *err)
{
    struct outfile o;

    if (outfile_open(&o, path, err) != 0)
        return -1;
    if (png_write_marked(o.file, pixel, width, height, channels, err) != 0) {
        outfile_abandon(&o);
        return error_prefix(err, "%s", path);
    }
    return outfile_close(&o, err);
}
