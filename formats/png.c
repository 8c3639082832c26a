/* PNG through libpng, whose way of failing (longjmp) ends here. */
#include "formats/png.h"

#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "formats/door.h"
#include "formats/exif.h"
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

/* APNG has a chunk of its own before the first pixels. */
bool png_is_animated(FILE *fp)
{
    uint8_t b[8];
    bool found = false;

    if (fseek(fp, 8, SEEK_SET) == 0)
        while (!found && fread(b, 1, sizeof b, fp) == sizeof b &&
               memcmp(b + 4, "IDAT", 4)) {
            const uint32_t n = (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 |
                               (uint32_t)b[2] << 8 | b[3];

            found = !memcmp(b + 4, "acTL", 4);
            if (fseek(fp, (long)n + 4, SEEK_CUR))
                break;
        }
    rewind(fp);
    return found;
}

/* What is being read; lives outside the frame that longjmp returns to. */
struct reading {
    png_structp png;
    png_infop info;
    uint8_t *pixels;
    png_bytepp rows;
    struct door_tag tag;
    struct door door;
    struct error e;
};

/* Colours by code points, which this libpng does not know of. */
static bool png_code_points(struct colour_tag *t, const struct reading *r)
{
    png_unknown_chunkp chunk;
    const int n = png_get_unknown_chunks(r->png, r->info, &chunk);

    for (int i = 0; i < n; i++)
        if (!memcmp(chunk[i].name, "cICP", 4) && chunk[i].size == 4) {
            t->primaries = chunk[i].data[0];
            t->transfer = chunk[i].data[1];
            return true;
        }
    return false;
}

/* What the file says of its colours: by the first of code points, a profile,
 * sRGB, and a curve, which is sRGB's where it is as good as that. */
static void png_colours(struct colour_tag *t, const struct reading *r)
{
    png_charp name;
    png_bytep profile;
    png_uint_32 bytes;
    int number;
    double g;

    if (png_code_points(t, r))
        return;
    if (png_get_iCCP(r->png, r->info, &name, &number, &profile, &bytes)) {
        t->icc = profile;
        t->icc_bytes = bytes;
    } else if (!png_get_sRGB(r->png, r->info, &number) &&
               png_get_gAMA(r->png, r->info, &g) && g > 0.01) {
        double *c = t->chroma;

        t->gamma = fabs(g - 1 / 2.2) < 0.01 ? 0 : 1 / g;
        if (t->gamma > 0)
            png_get_cHRM(r->png, r->info, c, c + 1, c + 2, c + 3, c + 4, c + 5,
                         c + 6, c + 7);
    }
}

/* All that stands beside the pixels. */
static struct door_tag png_tag(const struct reading *r)
{
    const int channels = png_get_channels(r->png, r->info);
    struct door_tag t = {
        .pixels = {.channels = channels < 3 ? 1 : 3,
                   .extra = channels % 2 == 0,
                   .bits = png_get_bit_depth(r->png, r->info)},
        .alpha = channels % 2 == 0
    };
    png_uint_32 n, x, y;
    png_bytep exif;
    int unit;

    png_colours(&t.colour, r);
    if (png_get_eXIf_1(r->png, r->info, &n, &exif))
        exif_read(&t, exif, n);
    /* as ffmpeg writes and reads it, for no one else does: not as densities */
    if (png_get_pHYs(r->png, r->info, &x, &y, &unit) &&
        unit == PNG_RESOLUTION_UNKNOWN && y)
        t.aspect = (double)x / y;
    return t;
}

/* The stored pixels, of 8 or 16 bits; fails by longjmp. */
static void png_read_pixels(struct reading *r, FILE *fp, size_t max)
{
    static const png_byte code_points[5] = "cICP";
    png_structp png = r->png;
    size_t W, H, bytes;

    png_init_io(png, fp);
    png_set_user_limits(png, IMAGE_MAX_SIDE, IMAGE_MAX_SIDE);
    png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_ALWAYS, code_points, 1);
    png_read_info(png, r->info);
    W = png_get_image_width(png, r->info);
    H = png_get_image_height(png, r->info);
    if (W * H > max) {
        char text[96];

        snprintf(text, sizeof text, "picture of %zu x %zu pixels (expected at "
                 "most %zu in all)", W, H, max);
        png_error(png, text);
    }
    png_set_expand(png);
    png_set_swap(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, r->info);
    bytes = png_get_rowbytes(png, r->info);
    r->pixels = malloc(bytes * H);
    r->rows = malloc(H * sizeof *r->rows);
    if (!r->pixels || !r->rows)
        png_error(png, "out of memory");
    for (size_t y = 0; y < H; y++)
        r->rows[y] = r->pixels + bytes * y;
    png_read_image(png, r->rows);
    png_read_end(png, r->info);
    r->tag = png_tag(r);
}

/* png_read_pixels with libpng's way of failing turned into a return value. */
static int png_read_stored(struct reading *r, FILE *fp, size_t max)
{
    r->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &r->e, png_on_error,
                                    png_on_warning);
    r->info = r->png ? png_create_info_struct(r->png) : NULL;
    if (!r->info)
        return error_set(&r->e, EX_OSERR, "png: out of memory");
    if (setjmp(png_jmpbuf(r->png)))
        return -1;
    png_read_pixels(r, fp, max);
    return 0;
}

int png_read_next(struct image *im, FILE *fp, size_t max, struct error *err)
{
    struct reading r = {0};
    int rc = png_read_stored(&r, fp, max);

    memset(im, 0, sizeof *im);
    if (rc) {
        error_set(err, r.e.code, "%s", r.e.text);
    } else {
        const size_t H = png_get_image_height(r.png, r.info);

        rc = door_open(&r.door, im, png_get_image_width(r.png, r.info), H,
                       &r.tag, "png", err);
        for (size_t y = 0; y < H && rc == 0; y++)
            door_row(&r.door, r.rows[y], y);
        if (rc == 0)
            rc = door_close(&r.door, err);
    }
    if (rc)
        image_release(im);
    door_release(&r.door);
    png_destroy_read_struct(&r.png, &r.info, NULL);
    free(r.pixels);
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
