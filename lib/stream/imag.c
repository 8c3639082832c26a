/* Reading and writing IMAG. */
#include "lib/stream/imag.h"

#include <string.h>

/* An array of the square picture that may be missing. */
static int imag_optional(const uint8_t **out, const struct record *rec,
                         const char *name, int ndim, const size_t *dims,
                         struct error *err)
{
    if (!record_find(rec, name))
        return 0;
    *out = record_get(rec, name, DTYPE_U8, ndim, dims, err);
    return *out ? 0 : -1;
}

int imag_read(struct imag *im, const struct record *rec, struct error *err)
{
    size_t dims[3] = {0, 0, 3};

    memset(im, 0, sizeof *im);
    if (!record_get(rec, "rgb", DTYPE_U8, 3, dims, err))
        return -1;
    im->height = im->width = record_find(rec, "rgb")->dim[0];
    dims[0] = dims[1] = im->height;
    im->mask = record_get(rec, "mask", DTYPE_U8, 2, dims, err);
    if (!im->mask)
        return -1;
    im->rgb = record_get(rec, "rgb", DTYPE_U8, 3, dims, err);
    return !im->rgb || imag_optional(&im->label, rec, "label", 2, dims, err) ||
                   imag_optional(&im->alone, rec, "alone", 3, dims, err)
               ? -1
               : 0;
}

size_t imag_size(const struct record *rec)
{
    const struct array *rgb = record_find(rec, "rgb");

    return rgb && rgb->ndim == 3 ? rgb->dim[0] : 0;
}

int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err)
{
    const size_t h = im->height, width = im->width;
    const struct array all[] = {
        array_make("rgb", DTYPE_U8, im->rgb, 3, h, width, 3, 0),
        array_make("alpha", DTYPE_U8, im->alpha, 2, h, width, 0, 0),
        array_make("mask", DTYPE_U8, im->mask, 2, h, width, 0, 0),
        array_make("label", DTYPE_U8, im->label, 2, h, width, 0, 0),
        array_make("alone", DTYPE_U8, im->alone, 3, h, width, 3, 0)
    };
    struct array a[sizeof all / sizeof *all];

    return stream_write(w, RECORD_IMAG, frame, time, a,
                        array_present(a, all, sizeof all / sizeof *all), err);
}
