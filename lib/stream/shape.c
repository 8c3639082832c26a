/* SHAP by the table of records. */
#include "lib/stream/shape.h"

#include <string.h>

#include "lib/stream/schema.h"

static const struct schema_field fields[] = {
    {"shape", offsetof(struct shape, beta), DTYPE_F32},
    {"offset", offsetof(struct shape, offset), DTYPE_F32},
    {"person", offsetof(struct shape, person), DTYPE_I32}
};
enum { FIELDS = sizeof fields / sizeof *fields };

int shape_read(struct shape *s, const struct record *rec, struct error *err)
{
    memset(s, 0, sizeof *s);
    s->n = schema_rows(rec, "shape");
    s->vertices = schema_rows(rec, "offset");
    return schema_read(s, rec, fields, FIELDS, err);
}

int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err)
{
    const size_t size[] = {['*'] = s->n, ['V'] = s->vertices};
    struct array a[FIELDS];

    return stream_write(w, RECORD_SHAP, frame, time, a,
                        schema_arrays(a, RECORD_SHAP, s, fields, FIELDS, size),
                        err);
}
