/* FEAT by the table of records, and what of it goes together. */
#include "lib/stream/feat.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

#define F(member) #member, offsetof(struct feat, member), DTYPE_F32
static const struct schema_field fields[] = {
    {"feat", offsetof(struct feat, f32), DTYPE_F32},
    {"feat", offsetof(struct feat, f16), DTYPE_F16},
    {F(alpha)}, {F(depth)}, {F(photo)}, {F(place)}, {F(map)}, {F(gain)},
    {F(tint)}, {F(turn)}
};
enum { FIELDS = sizeof fields / sizeof *fields };

/* What goes with what: names of arrays, the second of which the first needs. */
static const char *const needs[][2] = {
    {"photo", "alpha"}, {"tint", "gain"}, {"place", "map"}, {"map", "place"}, {"place", "alpha"}
};

/* Packed features are taken as the whole picture they stand for, which must
 * not be larger than a record may be. */
static int feat_check_size(const struct array *feat, const struct array *alpha,
                           struct error *err)
{
    const size_t n = array_count(alpha);
    const size_t bytes = feat->dim[1] * dtype_size(feat->dtype);

    if (n > SIZE_MAX / (bytes + 1) || n * bytes > stream_limit())
        return error_set(err, EX_DATAERR, "FEAT feat of %zu x %zu pixels is "
                         "larger than --max-bytes", alpha->dim[1],
                         alpha->dim[0]);
    return 0;
}

/* The gains are of every FEAT_GAIN pixels. */
static int feat_check_gain(const struct feat *f, struct error *err)
{
    const size_t h = (f->height + FEAT_GAIN - 1) / FEAT_GAIN;
    const size_t w = (f->width + FEAT_GAIN - 1) / FEAT_GAIN;

    if (f->gain && (f->gain_height != h || f->gain_width != w))
        return error_set(err, EX_DATAERR, "FEAT gain is %zu x %zu (expected "
                         "%zu x %zu)", f->gain_height, f->gain_width, h, w);
    return 0;
}

int feat_read(struct feat *f, const struct record *rec, struct error *err)
{
    const struct array *a = record_find(rec, "feat");
    const struct array *alpha = record_find(rec, "alpha");
    const struct array *photo = record_find(rec, "photo");

    memset(f, 0, sizeof *f);
    if (schema_read(f, rec, fields, FIELDS, err))
        return -1;
    for (size_t i = 0; i < sizeof needs / sizeof *needs; i++)
        if (record_find(rec, needs[i][0]) && !record_find(rec, needs[i][1]))
            return error_set(err, EX_DATAERR, "FEAT has %s without %s",
                             needs[i][0], needs[i][1]);
    f->packed = a->ndim == 2;
    if (f->packed && !alpha)
        return error_set(err, EX_DATAERR, "FEAT has packed feat without alpha");
    if (photo && photo->ndim != a->ndim)
        return error_set(err, EX_DATAERR, "FEAT has one of feat and photo "
                         "packed (expected both or none)");
    if (f->packed && feat_check_size(a, alpha, err))
        return -1;
    f->height = f->packed ? alpha->dim[0] : a->dim[0];
    f->width = f->packed ? alpha->dim[1] : a->dim[1];
    f->channels = a->dim[a->ndim - 1];
    f->pixels = f->packed ? a->dim[0] : 0;
    f->gain_height = schema_rows(rec, "gain");
    f->gain_width = f->gain ? record_find(rec, "gain")->dim[1] : 0;
    return feat_check_gain(f, err);
}

int feat_write(struct stream_writer *w, uint64_t frame, double time,
               const struct feat *f, const struct iovec *part, size_t parts,
               struct error *err)
{
    const size_t size[] = {['H'] = f->height, ['W'] = f->width,
                           ['C'] = f->channels,
                           ['G'] = f->gain_height, ['K'] = f->gain_width,
                           ['P'] = f->packed ? f->pixels : SCHEMA_NOT};
    struct array a[FIELDS];

    return stream_write_parts(w, RECORD_FEAT, frame, time, a,
                              schema_arrays(a, RECORD_FEAT, f, fields, FIELDS,
                                            size), part, parts, err);
}
