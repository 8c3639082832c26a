/* The toolkit's own head: a sculpted mean head with FLAME's arrays, made from
 * authored tables, the same bytes on every run.
 *
 * Frame: x to the subject's left, y up, face to +z, metres; pupils at
 * y = 0.025, crown at 0.140, chin at -0.092, neck cut at -0.165. */
#ifndef SPID_LAB_HEAD_SCULPT_H
#define SPID_LAB_HEAD_SCULPT_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/head/head.h"

enum {
    SCULPT_SHAPES = 300,
    SCULPT_EXPRESSIONS = 100,
    SCULPT_JOINTS = 5,      /* root, neck, jaw, left eye, right eye */
    SCULPT_POSES = 36,      /* (R - I) of joints 1 to 4, row major */
    SCULPT_LANDMARKS = 68,
    SCULPT_LID_SHAPES = 100
};

/* All arrays are owned by the struct; sizes V vertices, F triangles. */
struct sculpt {
    size_t nv, nf;
    float *v_template;      /* (V,3) metres */
    int32_t *f;             /* (F,3) counter-clockwise from outside */
    float *shapedirs;       /* (V,3,400) 300 shapes, then 100 expressions */
    float *posedirs;        /* (V,3,36) */
    float *j_regressor;     /* (5,V) rows sum to 1 */
    float *weights;         /* (V,5) rows sum to 1 */
    int32_t parents[SCULPT_JOINTS];          /* -1 for the root */
    float *l_eyelid;        /* (V,3) added at full closure, x > 0 */
    float *r_eyelid;        /* (V,3) x < 0 */
    int32_t *lip_inner;     /* closed loop of the mouth opening */
    size_t n_lip_inner;
    int32_t *lip_upper_outer; /* upper vermilion border, left to right */
    size_t n_lip_upper_outer;
    int32_t landmark_face[SCULPT_LANDMARKS];
    float landmark_bary[SCULPT_LANDMARKS * 3];
    int32_t *region;        /* (V) enum head_region */
    int32_t *mirror;        /* (V) the vertex at (-x, y, z) */
    float *hair;            /* (V) scalp hair density, 0 to 1 */
    float *uv;              /* (V,2) 0 to 1, mirrored about u = 0.5 */
    int32_t *lid_vertices, *lid_sides;  /* (n_lid); a head of scans only */
    size_t n_lid;
    float *lid_shapedirs;   /* (n_lid,3,SCULPT_LID_SHAPES) */
};

/* Sculpt the head.  0, or -1 when memory runs out.  Release in any case. */
int sculpt_make(struct sculpt *s, struct error *err);
/* Free what it holds; zeroed then. */
void sculpt_release(struct sculpt *s);

/* The same as head_init takes it; points into s. */
void sculpt_arrays(struct head_arrays *a, const struct sculpt *s);

/* Write it as a safetensors file under FLAME's names. */
int sculpt_save(const struct sculpt *s, const char *path, struct error *err);

/* A head made of the scans: directions packed (lib/head/runs.h) as half
 * floats, the scans' notice and the ARKit names in the metadata. */
int sculpt_save_scans(const struct sculpt *s, const char *path,
                      struct error *err);

#endif
