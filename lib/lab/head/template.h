/* The built-in head as arrays that the scans' shapes are written into: read
 * from its file, written to another.
 *
 * Frame: x to the subject's left, y up, face to +z, metres; crown near
 * y = 0.140, chin near -0.092, neck cut at -0.165. */
#ifndef SPID_LAB_HEAD_TEMPLATE_H
#define SPID_LAB_HEAD_TEMPLATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "formats/safetensors.h"
#include "lib/base/arena.h"
#include "lib/head/head.h"

enum {
    TEMPLATE_VERTICES = 5140,
    TEMPLATE_SHAPES = 300,
    TEMPLATE_EXPRESSIONS = 100,
    TEMPLATE_DIRECTIONS = TEMPLATE_SHAPES + TEMPLATE_EXPRESSIONS,
    TEMPLATE_JOINTS = 5,        /* root, neck, jaw, left eye, right eye */
    TEMPLATE_POSES = 36,        /* (R - I) of joints 1 to 4, row major */
    TEMPLATE_LANDMARKS = 68,
    TEMPLATE_LID_SHAPES = 100
};

/* lib/head/head.h's arrays, owned; sizes V vertices, F triangles. */
struct template {
    struct arena memory;
    size_t nv, nf, nlip_inner, nlip_upper_outer, nlid;
    float *v_template, *shapedirs, *posedirs, *j_regressor, *weights;
    float *l_eyelid, *r_eyelid, *landmark_bary, *hair, *uv, *lid_shapedirs;
    int32_t *f, *parents, *lip_inner, *lip_upper_outer, *landmark_face;
    int32_t *region, *lid_vertices, *lid_sides;
};

/* Read a head file whose mesh is the built-in one's.  -1 and *err naming the
 * file when it is not; *t is then released. */
int template_load(struct template *t, const char *path, struct error *err);
/* Free what it holds; zeroed then. */
void template_release(struct template *t);

/* Directions `name` (V,3,K) of a head's file, packed or plain; the caller
 * frees.  NULL and *err. */
float *template_directions(const struct safetensors *st, const char *name,
                           size_t V, size_t K, struct error *err);

/* Write it as a safetensors file under FLAME's names, with the scans' notice
 * and the ARKit names in the metadata; directions packed (lib/head/runs.h) as
 * half floats, or plain: arrays of floats as FLAME has them. */
int template_save(const struct template *t, const char *path, bool plain,
                  struct error *err);

#endif
