/* PLY scenes as GAUS records. */
#include "formats/gaus_ply.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sysexits.h>

#include "formats/ply.h"
#include "lib/stream/records.h"

int gaus_ply_parse_eye(const char *value, void *dest, struct error *err)
{
    struct gaus_ply_options *o = dest;
    char end;

    if (sscanf(value, "%f,%f,%f%c", &o->eye[0], &o->eye[1], &o->eye[2],
               &end) != 3 ||
        !isfinite(o->eye[0] + o->eye[1] + o->eye[2]))
        return error_set(err, EX_USAGE, "not a place (expected X,Y,Z)");
    o->has_eye = true;
    return 0;
}

/* One record of three channels to the sink. */
static int gaus_ply_send(const struct splats *s, record_sink sink,
                         void *context, struct error *err)
{
    uint8_t *branch = calloc(s->n + 1, 1);
    const struct gaus g = {
        .n = s->n, .channels = 3, .mean = s->mean, .scale = s->scale,
        .quat = s->quat, .opacity = s->opacity, .color = s->color,
        .branch = branch
    };
    struct record rec = {.type = RECORD_GAUS};

    if (!branch)
        return error_set(err, EX_OSERR, "out of memory for %zu Gaussians",
                         s->n);
    rec.count = gaus_arrays(rec.array, &g);
    int rc = sink(&rec, context, err);
    free(branch);
    return rc;
}

int gaus_ply_read(const char *path, const struct gaus_ply_options *opt,
                  record_sink sink, void *context, struct error *err)
{
    struct splats s;
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
    rc = gaus_ply_send(&s, sink, context, err);
out:
    splats_release(&s);
    return rc;
}
