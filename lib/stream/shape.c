/* SHAP by the table of records. */
#include "lib/stream/shape.h"

#include <string.h>

#include "lib/stream/schema.h"

static const struct schema_field fields[] = {
    {"shape", offsetof(struct shape, beta), DTYPE_F32},
    {"person", offsetof(struct shape, person), DTYPE_I32}
};

int shape_read(struct shape *s, const struct record *rec, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->n = schema_rows(rec, "shape");
    return schema_read(s, rec, fields, 2, err);
}

int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err)
{
    const size_t size[] = {['*'] = s->n};
    struct array a[2];

    return stream_write(w, RECORD_SHAP, frame, time, a,
                        schema_arrays(a, RECORD_SHAP, s, fields, 2, size), err);
}
