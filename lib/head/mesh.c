/* MESH by the table of records. */
#include "lib/head/mesh.h"

#include <string.h>
#include <sysexits.h>

#include "lib/stream/schema.h"

const char *const mesh_arrays[] = {"verts", "cam", "lip", "gap", "chin",
                                   "faces", NULL};

#define F(member) #member, offsetof(struct mesh, member)
static const struct schema_field fields[] = {
    {F(verts), DTYPE_F32}, {F(cam), DTYPE_F32}, {F(lip), DTYPE_F32},
    {F(gap), DTYPE_F32}, {F(chin), DTYPE_F32}, {F(faces), DTYPE_I32}
};
enum { FIELDS = sizeof fields / sizeof *fields };

int mesh_read(struct mesh *m, const struct record *rec, struct error *err)
{
    memset(m, 0, sizeof *m);
    m->V = schema_rows(rec, "verts");
    m->F = schema_rows(rec, "faces");
    if (schema_read(m, rec, fields, FIELDS, err))
        return -1;
    for (size_t i = 0; i < 3 * m->F; i++)
        if (m->faces[i] < 0 || (size_t)m->faces[i] >= m->V)
            return error_set(err, EX_DATAERR, "MESH faces[%zu] is %d "
                             "(expected 0 to %zu)", i, m->faces[i], m->V - 1);
    return 0;
}

int mesh_write(struct stream_writer *w, uint64_t frame, double time,
               const struct head *h, const float *verts, const float cam[12],
               bool with_faces, const struct array *others, int nothers,
               struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];
    struct head_mouth mouth;

    head_mouth(&mouth, h, verts);
    const struct mesh m = {
        .V = h->V, .F = h->F, .verts = verts, .cam = cam, .lip = mouth.centre,
        .gap = &mouth.gap, .chin = h->nchin ? mouth.chin : NULL,
        .faces = with_faces ? h->f : NULL
    };
    const size_t size[] = {['V'] = m.V, ['F'] = m.F};
    int n = schema_arrays(a, RECORD_MESH, &m, fields, FIELDS, size);
    for (int i = 0; i < nothers && n < STREAM_MAX_ARRAYS; i++)
        a[n++] = others[i];
    return stream_write(w, RECORD_MESH, frame, time, a, n, err);
}
