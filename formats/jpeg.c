/* JPEG in (jpeg.h): libjpeg's decoder, and what stands beside the pixels. */
#include "formats/jpeg.h"

#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include <jpeglib.h>

#include "formats/door.h"
#include "formats/exif.h"

#define JPEG_SCANS 500          /* of a progressive picture; more are a trap */
#define JPEG_MARKER 0xffff      /* bytes at most */

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
    struct door door;
    uint8_t *row, *icc;
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

/* ---- what it says of its pixels ------------------------------------------ */

/* Orientation and colours by Exif, an ICC profile over those, and pixels that
 * are not square by JFIF.  *icc is for the caller to free. */
static struct door_tag jpeg_tag(struct jpeg_decompress_struct *in,
                                uint8_t **icc)
{
    static const char exif[6] = "Exif\0";
    const bool grey = in->num_components == 1, cmyk = in->num_components == 4;
    struct door_tag t = {.pixels = {
        .channels = grey ? 1 : cmyk ? 4 : 3, .bits = 8,
        .inverted = in->saw_Adobe_marker
    }};
    unsigned bytes = 0;

    for (jpeg_saved_marker_ptr m = in->marker_list; m; m = m->next)
        if (m->marker == JPEG_APP0 + 1 && m->data_length > sizeof exif &&
            !memcmp(m->data, exif, sizeof exif))
            exif_read(&t, m->data, m->data_length);
    if (jpeg_read_icc_profile(in, icc, &bytes))
        t.colour = (struct colour_tag){.icc = *icc, .icc_bytes = bytes};
    in->err->num_warnings = 0;          /* a profile is no pixels */
    if (in->saw_JFIF_marker && in->density_unit == 0 && in->Y_density)
        t.aspect = (double)in->X_density / in->Y_density;
    return t;
}

/* ---- pixels -------------------------------------------------------------- */

/* The picture through the door, a row at a time. */
static int jpeg_fill(struct image *im, struct jpeg *j, struct error *err)
{
    const struct door_tag tag = jpeg_tag(&j->in, &j->icc);
    const size_t W = j->in.image_width, H = j->in.image_height;

    if (door_open(&j->door, im, W, H, &tag, j->name, err))
        return -1;
    j->in.out_color_space = tag.pixels.channels == 1 ? JCS_GRAYSCALE
                          : tag.pixels.channels == 4 ? JCS_CMYK : JCS_RGB;
    j->row = malloc((size_t)tag.pixels.channels * W);
    if (!j->row)
        return error_set(err, EX_OSERR, "%s: out of memory", j->name);
    jpeg_start_decompress(&j->in);
    for (size_t y = 0; y < H; y++) {
        JSAMPROW row = j->row;

        jpeg_read_scanlines(&j->in, &row, 1);
        door_row(&j->door, row, y);
    }
    im->damaged = j->in.err->num_warnings > 0;
    return door_close(&j->door, err);
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
        jpeg_save_markers(&j->in, JPEG_APP0 + 1, JPEG_MARKER);
        jpeg_save_markers(&j->in, JPEG_APP0 + 2, JPEG_MARKER);
        jpeg_stdio_src(&j->in, fp);
        jpeg_read_header(&j->in, TRUE);
        begun = true;
        rc = jpeg_fill(im, j, err);
    }
    jpeg_destroy_decompress(&j->in);
    door_release(&j->door);
    free(j->row);
    free(j->icc);
    free(j);
    if (rc)
        image_release(im);
    return rc ? -1 : 0;
}
