/* GAUS by the table of records, and what of it goes together. */
#include "lib/stream/gaus.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

#define F(member) #member, offsetof(struct gaus, member)
static const struct schema_field fields[] = {
    {F(mean), DTYPE_F32}, {F(scale), DTYPE_F32}, {F(quat), DTYPE_F32},
    {F(opacity), DTYPE_F32}, {F(color), DTYPE_F32},
    {"color", offsetof(struct gaus, color_half), DTYPE_F16},
    {F(branch), DTYPE_U8}, {F(lip), DTYPE_F32}, {F(jaw), DTYPE_F32},
    {F(chin), DTYPE_F32}, {F(vertex), DTYPE_I32}, {F(bend), DTYPE_F32},
    {F(pivot), DTYPE_F32}, {F(source), DTYPE_F32}, {F(light), DTYPE_F32},
    {F(lamp), DTYPE_F32}, {F(uv), DTYPE_F32}, {F(seen), DTYPE_F32}, {F(view), DTYPE_F32},
    {F(reach), DTYPE_F32}, {F(normal), DTYPE_F32}, {F(tilt), DTYPE_F32},
    {F(cam), DTYPE_F32}
};
enum { FIELDS = sizeof fields / sizeof *fields };

int gaus_read(struct gaus *g, const struct record *rec, struct error *err)
{
    memset(g, 0, sizeof *g);
    if (schema_read(g, rec, fields, FIELDS, err))
        return -1;
    g->n = schema_rows(rec, "mean");
    g->channels = record_find(rec, "color")->dim[1];
    g->vertices = schema_rows(rec, "vertex");
    g->jaws = schema_rows(rec, "jaw");
    if (g->channels == 0)
        return error_set(err, EX_DATAERR, "GAUS color has no channels "
                         "(expected at least one)");
    if (!g->jaw != !g->chin)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->jaw ? "jaw" : "chin", g->jaw ? "chin" : "jaw");
    if (!g->uv != !g->seen || !g->uv != !g->view)
        return error_set(err, EX_DATAERR, "GAUS has %s without %s",
                         g->uv ? "uv" : g->seen ? "seen" : "view",
                         !g->uv ? "uv" : g->seen ? "view" : "seen");
    return 0;
}

int gaus_arrays(struct array a[STREAM_MAX_ARRAYS], const struct gaus *g)
{
    const size_t size[] = {['N'] = g->n, ['C'] = g->channels,
                           ['M'] = g->vertices, ['K'] = g->jaws};

    return schema_arrays(a, RECORD_GAUS, g, fields, FIELDS, size);
}

int gaus_write(struct stream_writer *w, uint64_t frame, double time,
               const struct gaus *g, struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];

    return stream_write(w, RECORD_GAUS, frame, time, a, gaus_arrays(a, g),
                        err);
}
