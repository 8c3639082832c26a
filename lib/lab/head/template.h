/* What of the built-in head's file the scans' shapes are written into.
 *
 * Frame: x to the subject's left, y up, face to +z, metres; crown near
 * y = 0.140, chin near -0.092, neck cut at -0.165. */
#ifndef SPID_LAB_HEAD_TEMPLATE_H
#define SPID_LAB_HEAD_TEMPLATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/lab/head/headfile.h"

enum {
    TEMPLATE_VERTICES = 5140,
    TEMPLATE_SHAPES = 300,
    TEMPLATE_EXPRESSIONS = 100,
    TEMPLATE_DIRECTIONS = TEMPLATE_SHAPES + TEMPLATE_EXPRESSIONS,
    TEMPLATE_POSES = 36,        /* (R - I) of joints 1 to 4, row major */
    TEMPLATE_LID_SHAPES = 100
};

/* lib/head/head.h's arrays; sizes V vertices, F triangles. */
struct template {
    struct headfile file;       /* whose memory they are in */
    size_t nv, nf, nlid;
    float *v_template, *shapedirs, *posedirs;
    float *l_eyelid, *r_eyelid, *lid_shapedirs;
    int32_t *f, *region, *lid_vertices, *lid_sides;
};

/* Read a head file whose mesh is the built-in one's.  -1 and *err naming the
 * file when it is not; *t is then released. */
int template_load(struct template *t, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void template_release(struct template *t);

/* Write the file with these arrays in place of its own, without a template
 * avatar; directions packed (lib/head/runs.h) as half floats, or plain: arrays
 * of floats as FLAME has them. */
int template_save(struct template *t, const char *path, bool plain,
                  struct error *err);

#endif
