/* Reading and writing SHAP. */
#include "lib/stream/shape.h"

#include <string.h>

int shape_read(struct shape *s, const struct record *rec, struct error *err)
{
    static const size_t any[1] = {0};
    const struct array *person = record_find(rec, "person");

    memset(s, 0, sizeof *s);
    s->beta = record_get(rec, "shape", DTYPE_F32, 1, any, err);
    if (!s->beta || record_check_finite(rec, err))
        return -1;
    s->n = record_find(rec, "shape")->dim[0];
    if (person && person->dtype == DTYPE_I32 && array_count(person) == 1)
        s->person = person->data;
    return 0;
}

int shape_write(struct stream_writer *w, uint64_t frame, double time,
                const struct shape *s, struct error *err)
{
    struct array a[2] = {
        array_make("shape", DTYPE_F32, s->beta, 1, s->n, 0, 0, 0),
        array_make("person", DTYPE_I32, s->person, 1, 1, 0, 0, 0)
    };

    return stream_write(w, RECORD_SHAP, frame, time, a, s->person ? 2 : 1, err);
}
