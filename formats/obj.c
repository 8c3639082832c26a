/* Wavefront OBJ, text. */
#include "formats/obj.h"

#include <stdio.h>

#include "formats/outfile.h"

int obj_write(const char *path, const float *verts, const float *normals,
              size_t V, const int32_t *faces, size_t F, struct error *err)
{
    struct outfile out;

    if (outfile_open(&out, path, err))
        return -1;
    fputs("# SpiD toolkit\n", out.file);
    for (size_t i = 0; i < V; i++)
        fprintf(out.file, "v %.9g %.9g %.9g\n", verts[3 * i],
                verts[3 * i + 1], verts[3 * i + 2]);
    for (size_t i = 0; i < V; i++)
        fprintf(out.file, "vn %.9g %.9g %.9g\n", normals[3 * i],
                normals[3 * i + 1], normals[3 * i + 2]);
    for (size_t i = 0; i < F; i++, faces += 3)      /* corners count from 1 */
        fprintf(out.file, "f %d//%d %d//%d %d//%d\n", faces[0] + 1,
                faces[0] + 1, faces[1] + 1, faces[1] + 1, faces[2] + 1,
                faces[2] + 1);
    return outfile_close(&out, err);
}
