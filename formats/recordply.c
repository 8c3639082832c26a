/* PLY scenes as GAUS records. */
#include "formats/recordply.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sysexits.h>

#include "formats/ply.h"

int recordply_parse_eye(const char *value, void *dest, struct error *err)
{
    struct recordply_options *o = dest;
    char end;

    if (sscanf(value, "%f,%f,%f%c", &o->eye[0], &o->eye[1], &o->eye[2],
               &end) != 3 ||
        !isfinite(o->eye[0] + o->eye[1] + o->eye[2]))
        return error_set(err, EX_USAGE, "not a place (expected X,Y,Z)");
    o->has_eye = true;
    return 0;
}

/* One record of three channels to the sink. */
static int recordply_scene_send(const struct ply_scene *s, record_sink sink,
                                void *context, struct error *err)
{
    uint8_t *branch = calloc(s->n + 1, 1);
    struct record rec = {.type = RECORD_GAUS};

    if (!branch)
        return error_set(err, EX_OSERR, "out of memory for %zu Gaussians",
                         s->n);
    struct array *a = rec.array;
    a[rec.count++] = array_make("mean", DTYPE_F32, s->mean, 2, s->n, 3, 0, 0);
    a[rec.count++] = array_make("scale", DTYPE_F32, s->scale, 2, s->n, 3, 0,
                                0);
    a[rec.count++] = array_make("quat", DTYPE_F32, s->quat, 2, s->n, 4, 0, 0);
    a[rec.count++] = array_make("opacity", DTYPE_F32, s->opacity, 1, s->n, 0,
                                0, 0);
    a[rec.count++] = array_make("color", DTYPE_F32, s->color, 2, s->n, 3, 0,
                                0);
    a[rec.count++] = array_make("branch", DTYPE_U8, branch, 1, s->n, 0, 0, 0);
    int rc = sink(&rec, context, err);
    free(branch);
    return rc;
}

int recordply_read(const char *path, const struct recordply_options *opt,
                   record_sink sink, void *context, struct error *err)
{
    struct ply_scene s;
    int rc = -1;

    if (ply_read(&s, path, !opt->model_space, err))
        return -1;
    if (s.degree && !opt->has_eye && !opt->flat) {
        error_set(err, EX_DATAERR,
                  "%s: spherical harmonics of degree %d (give --eye X,Y,Z to "
                  "evaluate them for one place, or --flat to drop them)",
                  path, s.degree);
        goto out;
    }
    if (opt->has_eye)
        ply_shade(&s, opt->eye);
    rc = recordply_scene_send(&s, sink, context, err);
out:
    ply_release(&s);
    return rc;
}
