/* Reading and writing MESH. */
#include "lib/head/mesh.h"

#include <string.h>
#include <sysexits.h>

const char *const mesh_arrays[] = {"verts", "cam", "lip", "gap", "chin",
                                   "faces", NULL};

int mesh_read(struct mesh *m, const struct record *rec, struct error *err)
{
    static const size_t any[2] = {0, 3}, d34[2] = {3, 4}, d3[1] = {3},
                        d1[1] = {1};

    memset(m, 0, sizeof *m);
    if (!(m->verts = record_get(rec, "verts", DTYPE_F32, 2, any, err)) ||
        !(m->cam = record_get(rec, "cam", DTYPE_F32, 2, d34, err)) ||
        !(m->lip = record_get(rec, "lip", DTYPE_F32, 1, d3, err)) ||
        record_check_finite(rec, err))
        return -1;
    if (record_find(rec, "gap") &&
        !(m->gap = record_get(rec, "gap", DTYPE_F32, 1, d1, err)))
        return -1;
    if (record_find(rec, "chin") &&
        !(m->chin = record_get(rec, "chin", DTYPE_F32, 1, d3, err)))
        return -1;
    m->V = record_find(rec, "verts")->dim[0];
    return 0;
}

int mesh_read_faces(const int32_t **faces, size_t *F,
                    const struct record *rec, struct error *err)
{
    static const size_t any[2] = {0, 3};
    const struct array *verts = record_find(rec, "verts");
    const int32_t *f = record_get(rec, "faces", DTYPE_I32, 2, any, err);
    const size_t V = verts ? verts->dim[0] : 0;

    if (!f)
        return -1;
    *faces = f;
    *F = record_find(rec, "faces")->dim[0];
    for (size_t i = 0; i < 3 * *F; i++)
        if (f[i] < 0 || (size_t)f[i] >= V)
            return error_set(err, EX_DATAERR, "MESH faces[%zu] is %d "
                             "(expected 0 to %zu)", i, f[i], V - 1);
    return 0;
}

int mesh_write(struct stream_writer *w, uint64_t frame, double time,
               const struct head *h, const float *verts, const float cam[12],
               bool with_faces, const struct array *others, int nothers,
               struct error *err)
{
    struct array a[STREAM_MAX_ARRAYS];
    struct head_mouth mouth;
    int n = 0;

    head_mouth(&mouth, h, verts);
    a[n++] = array_make("verts", DTYPE_F32, verts, 2, h->V, 3, 0, 0);
    a[n++] = array_make("cam", DTYPE_F32, cam, 2, 3, 4, 0, 0);
    a[n++] = array_make("lip", DTYPE_F32, mouth.centre, 1, 3, 0, 0, 0);
    a[n++] = array_make("gap", DTYPE_F32, &mouth.gap, 1, 1, 0, 0, 0);
    if (h->nchin)
        a[n++] = array_make("chin", DTYPE_F32, mouth.chin, 1, 3, 0, 0, 0);
    if (with_faces)
        a[n++] = array_make("faces", DTYPE_I32, h->f, 2, h->F, 3, 0, 0);
    for (int i = 0; i < nothers && n < STREAM_MAX_ARRAYS; i++)
        a[n++] = others[i];
    return stream_write(w, RECORD_MESH, frame, time, a, n, err);
}
