/* Reading and writing GMOV. */
#include "lib/stream/gmov.h"

#include <string.h>

/* The array of that name, rows by columns (a plain list for one row), into
 * *out when the record has it. */
static int gmov_optional(const float **out, const struct record *rec,
                         const char *name, size_t rows, size_t columns,
                         struct error *err)
{
    const size_t dims[2] = {rows > 1 ? rows : columns, columns};

    if (!record_find(rec, name))
        return 0;
    *out = record_get(rec, name, DTYPE_F32, rows > 1 ? 2 : 1, dims, err);
    return *out ? 0 : -1;
}

/* The centres that come as they are. */
static int gmov_read_means(struct gmov *m, const struct record *rec,
                           struct error *err)
{
    static const size_t one[1] = {1}, any[2] = {0, 3};
    const struct array *a = record_find(rec, "mean");

    if (!a)
        return 0;
    const int32_t *first = record_get(rec, "first", DTYPE_I32, 1, one, err);
    m->mean = record_get(rec, "mean", DTYPE_F32, 2, any, err);
    if (!first || !m->mean)
        return -1;
    m->first = *first;
    m->count = a->dim[0];
    return 0;
}

int gmov_read(struct gmov *m, const struct record *rec, struct error *err)
{
    memset(m, 0, sizeof *m);
    return record_check_finite(rec, err) ||
                   gmov_optional(&m->cam, rec, "cam", 3, 4, err) ||
                   gmov_read_means(m, rec, err) ||
                   gmov_optional(&m->body, rec, "body", 3, 4, err) ||
                   gmov_optional(&m->shift, rec, "shift", 1, 3, err) ||
                   gmov_optional(&m->chin, rec, "chin", 1, 3, err)
               ? -1
               : 0;
}

int gmov_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gmov *m)
{
    const struct array all[] = {
        array_make("cam", DTYPE_F32, m->cam, 2, 3, 4, 0, 0),
        array_make("first", DTYPE_I32, m->mean ? &m->first : NULL, 1, 1, 0, 0,
                   0),
        array_make("mean", DTYPE_F32, m->mean, 2, m->count, 3, 0, 0),
        array_make("shift", DTYPE_F32, m->shift, 1, 3, 0, 0, 0),
        array_make("chin", DTYPE_F32, m->chin, 1, 3, 0, 0, 0),
        array_make("body", DTYPE_F32, m->body, 2, 3, 4, 0, 0)
    };

    return array_present(a, all, sizeof all / sizeof *all);
}
