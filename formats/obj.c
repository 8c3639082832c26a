/* Wavefront OBJ, text. */
#include "formats/obj.h"

#include <stdio.h>

#include "formats/outfile.h"

/* Corners count from 1. */
static void obj_write_face(FILE *f, const int32_t *v, const float *normals,
                           const float *uv)
{
    fputs("f", f);
    for (int k = 0; k < 3; k++) {
        int i = v[k] + 1;

        if (uv && normals)
            fprintf(f, " %d/%d/%d", i, i, i);
        else if (uv)
            fprintf(f, " %d/%d", i, i);
        else if (normals)
            fprintf(f, " %d//%d", i, i);
        else
            fprintf(f, " %d", i);
    }
    fputc('\n', f);
}

int obj_write(const char *path, const float *verts, const float *normals,
              const float *uv, size_t V, const int32_t *faces, size_t F,
              struct error *err)
{
    struct outfile out;

    if (outfile_open(&out, path, err))
        return -1;
    fputs("# SpiD toolkit\n", out.file);
    for (size_t i = 0; i < V; i++)
        fprintf(out.file, "v %.9g %.9g %.9g\n", verts[3 * i],
                verts[3 * i + 1], verts[3 * i + 2]);
    for (size_t i = 0; uv && i < V; i++)
        fprintf(out.file, "vt %.9g %.9g\n", uv[2 * i], 1 - uv[2 * i + 1]);
    for (size_t i = 0; normals && i < V; i++)
        fprintf(out.file, "vn %.9g %.9g %.9g\n", normals[3 * i],
                normals[3 * i + 1], normals[3 * i + 2]);
    for (size_t i = 0; i < F; i++)
        obj_write_face(out.file, faces + 3 * i, normals, uv);
    return outfile_close(&out, err);
}
