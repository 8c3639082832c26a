/* Gaussian scenes of PLY files as GAUS records, for spid-pack. */
#ifndef SPID_FORMATS_GAUS_PLY_H
#define SPID_FORMATS_GAUS_PLY_H

#include <stdbool.h>

#include "formats/recordjson.h"

/* What to do with a scene whose colours depend on the view. */
struct gaus_ply_options {
    bool has_eye;
    float eye[3];       /* evaluate the higher bands for an eye there */
    bool flat;          /* drop them */
    bool model_space;   /* the file has y up: do not turn it */
};

/* --eye X,Y,Z for the option tables' CLI_CALL; dest is the options. */
int gaus_ply_parse_eye(const char *value, void *dest, struct error *err);

/* Hand the scene of path to sink as one GAUS record of three channels, all of
 * branch 0, without a camera.  EX_DATAERR when it has spherical harmonics
 * above degree 0 and neither an eye nor flat was given. */
int gaus_ply_read(const char *path, const struct gaus_ply_options *opt,
                  record_sink sink, void *context, struct error *err);

#endif
