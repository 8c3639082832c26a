/* GMOV by the table of records. */
#include "lib/stream/gmov.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

#define F(member) #member, offsetof(struct gmov, member)
static const struct schema_field fields[] = {
    {F(cam), DTYPE_F32}, {F(first), DTYPE_I32}, {F(mean), DTYPE_F32},
    {F(shift), DTYPE_F32}, {F(chin), DTYPE_F32}, {F(body), DTYPE_F32}
};
enum { FIELDS = sizeof fields / sizeof *fields };

int gmov_read(struct gmov *m, const struct record *rec, struct error *err)
{
    memset(m, 0, sizeof *m);
    if (schema_read(m, rec, fields, FIELDS, err))
        return -1;
    m->count = schema_rows(rec, "mean");
    if (!m->mean != !m->first)
        return error_set(err, EX_DATAERR, "GMOV has %s without %s",
                         m->mean ? "mean" : "first", m->mean ? "first" : "mean");
    return 0;
}

int gmov_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gmov *m)
{
    const size_t size[] = {['M'] = m->count, ['Z'] = 0};

    return schema_arrays(a, RECORD_GMOV, m, fields, FIELDS, size);
}
