/* JPEG in (jpeg.h): libjpeg's decoder, and the one tag of Exif that says how
 * the camera was held. */
#include "formats/jpeg.h"

#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <jpeglib.h>

#include "formats/orient.h"

#define JPEG_SCANS 500          /* of a progressive picture; more are a trap */
#define JPEG_EXIF 0xffff        /* bytes of a marker */

/* libjpeg wants its own struct to be the first. */
struct jpeg_faults {
    struct jpeg_error_mgr base;
    jmp_buf back;
    char text[JMSG_LENGTH_MAX];
};

struct jpeg {
    struct jpeg_decompress_struct in;
    struct jpeg_faults faults;
    struct jpeg_progress_mgr progress;
    uint8_t *row;
    const char *name;
};

static void jpeg_on_error(j_common_ptr in)
{
    struct jpeg_faults *f = (struct jpeg_faults *)in->err;

    in->err->format_message(in, f->text);
    longjmp(f->back, 1);
}

/* Warnings are counted by num_warnings, and not printed. */
static void jpeg_on_message(j_common_ptr in)
{
    (void)in;
}

/* A picture of very many scans is decoded for minutes. */
static void jpeg_progress(j_common_ptr in)
{
    struct jpeg_faults *f = (struct jpeg_faults *)in->err;

    if (((j_decompress_ptr)in)->input_scan_number <= JPEG_SCANS)
        return;
    snprintf(f->text, sizeof f->text, "more than %d scans", JPEG_SCANS);
    longjmp(f->back, 1);
}

/* ---- how it was held ----------------------------------------------------- */

/* Number of n bytes, the high one first or last. */
static unsigned jpeg_number(const uint8_t *p, int n, bool high_first)
{
    unsigned v = 0;

    for (int i = 0; i < n; i++)
        v |= (unsigned)p[i] << 8 * (high_first ? n - 1 - i : i);
    return v;
}

/* Tag 0x112 of the first directory of Exif data. */
static enum orientation jpeg_exif_orientation(const uint8_t *p, size_t n)
{
    size_t at, entries;
    bool high;

    if (n < 14 || memcmp(p, "Exif\0\0", 6))
        return ORIENT_UPRIGHT;
    p += 6;
    n -= 6;
    high = p[0] == 'M';
    at = jpeg_number(p + 4, 4, high);
    if (at > n - 2)
        return ORIENT_UPRIGHT;
    entries = jpeg_number(p + at, 2, high);
    for (at += 2; entries > 0 && at + 12 <= n; entries--, at += 12)
        if (jpeg_number(p + at, 2, high) == 0x112)
            return orient_read(jpeg_number(p + at + 8, 2, high));
    return ORIENT_UPRIGHT;
}

static enum orientation
jpeg_orientation(const struct jpeg_decompress_struct *in)
{
    for (jpeg_saved_marker_ptr m = in->marker_list; m; m = m->next) {
        const enum orientation o = jpeg_exif_orientation(m->data,
                                                         m->data_length);

        if (o != ORIENT_UPRIGHT)
            return o;
    }
    return ORIENT_UPRIGHT;
}

/* ---- pixels -------------------------------------------------------------- */

/* Size and colours, before anything is allocated. */
static int jpeg_check(const struct jpeg *j, struct error *err)
{
    const size_t w = j->in.image_width, h = j->in.image_height;

    if (w < 1 || h < 1)
        return error_set(err, EX_DATAERR, "%s: picture of %zu x %zu pixels has "
                         "no content", j->name, w, h);
    if (w > IMAGE_MAX_SIDE || h > IMAGE_MAX_SIDE || w * h > IMAGE_MAX_PIXELS)
        return error_set(err, EX_DATAERR, "%s: picture of %zu x %zu pixels is "
                         "too large (at most %d a side and %zu in all)",
                         j->name, w, h, IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS);
    if (j->in.num_components == 4)
        return error_set(err, EX_DATAERR, "%s: CMYK picture (expected grey "
                         "or RGB; convert it with its colour profile first)",
                         j->name);
    return 0;
}

/* The picture, upright, a row at a time. */
static int jpeg_fill(struct image *im, struct jpeg *j, struct error *err)
{
    const size_t W = j->in.image_width, H = j->in.image_height;
    const enum orientation o = jpeg_orientation(&j->in);
    const bool upright = o == ORIENT_UPRIGHT;

    im->width = orient_swaps(o) ? H : W;
    im->height = orient_swaps(o) ? W : H;
    im->rgb = malloc(3 * W * H);
    j->row = malloc(3 * W);
    if (!im->rgb || !j->row)
        return error_set(err, EX_OSERR, "%s: out of memory", j->name);
    j->in.out_color_space = JCS_RGB;
    jpeg_start_decompress(&j->in);
    for (size_t y = 0; y < H; y++) {
        JSAMPROW row = upright ? im->rgb + 3 * W * y : j->row;

        jpeg_read_scanlines(&j->in, &row, 1);
        for (size_t x = 0; !upright && x < W; x++)
            memcpy(im->rgb + 3 * orient_pixel(x, y, W, H, o), row + 3 * x, 3);
    }
    im->damaged = j->in.err->num_warnings > 0;
    return 0;
}

int jpeg_read(struct image *im, FILE *fp, const char *name, struct error *err)
{
    struct jpeg *j = calloc(1, sizeof *j);
    volatile bool begun = false;
    int rc = -1;

    memset(im, 0, sizeof *im);
    if (!j)
        return error_set(err, EX_OSERR, "%s: out of memory", name);
    j->name = name;
    j->in.err = jpeg_std_error(&j->faults.base);
    j->faults.base.error_exit = jpeg_on_error;
    j->faults.base.output_message = jpeg_on_message;
    j->progress.progress_monitor = jpeg_progress;
    if (setjmp(j->faults.back)) {
        rc = begun ? error_set(err, EX_DATAERR, "%s: damaged picture: %s",
                               name, j->faults.text)
                   : error_set(err, EX_DATAERR, "%s: not a picture that can "
                               "be read", name);
    } else {
        jpeg_create_decompress(&j->in);
        j->in.progress = &j->progress;
        jpeg_save_markers(&j->in, JPEG_APP0 + 1, JPEG_EXIF);
        jpeg_stdio_src(&j->in, fp);
        jpeg_read_header(&j->in, TRUE);
        begun = true;
        rc = jpeg_check(j, err);
        if (rc == 0)
            rc = jpeg_fill(im, j, err);
    }
    jpeg_destroy_decompress(&j->in);
    free(j->row);
    free(j);
    if (rc)
        image_release(im);
    return rc ? -1 : 0;
}
