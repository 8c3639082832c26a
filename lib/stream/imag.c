/* IMAG by the table of records. */
#include "lib/stream/imag.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

#define F(member) #member, offsetof(struct imag, member), DTYPE_U8
static const struct schema_field fields[] = {
    {F(rgb)}, {F(alpha)}, {F(mask)}, {F(label)}, {F(alone)}
};
enum { FIELDS = sizeof fields / sizeof *fields };

int imag_read(struct imag *im, const struct record *rec, struct error *err)
{
    memset(im, 0, sizeof *im);
    if (schema_read(im, rec, fields, FIELDS, err))
        return -1;
    im->height = record_find(rec, "rgb")->dim[0];
    im->width = record_find(rec, "rgb")->dim[1];
    if (im->width != im->height || !im->mask)
        return error_set(err, EX_DATAERR, "IMAG of %zu x %zu pixels, %s mask "
                         "(expected a square with one)", im->width, im->height,
                         im->mask ? "with a" : "without");
    return 0;
}

size_t imag_size(const struct record *rec)
{
    const struct array *rgb = record_find(rec, "rgb");

    return rgb && rgb->ndim == 3 ? rgb->dim[0] : 0;
}

int imag_write(struct stream_writer *w, uint64_t frame, double time,
               const struct imag *im, struct error *err)
{
    const size_t size[] = {['H'] = im->height, ['W'] = im->width};
    struct array a[FIELDS];

    return stream_write(w, RECORD_IMAG, frame, time, a,
                        schema_arrays(a, RECORD_IMAG, im, fields, FIELDS, size),
                        err);
}
