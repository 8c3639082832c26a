/* Parts of the skin model's fit. */
#ifndef SPID_LAB_PEOPLE_SCAN_SKIN_FIT_H
#define SPID_LAB_PEOPLE_SCAN_SKIN_FIT_H

#include "lib/lab/people/label_rows.h"
#include "lib/lab/people/scan_register.h"
#include "lib/lab/people/scan_skin.h"

struct skin_chart {             /* the texture square on the mesh */
    int32_t *face;              /* (SKIN_SIZE,SKIN_SIZE) or -1 */
    float *b;                   /* (.., 2) weights of corners 1 and 2 */
};

struct skin_list {              /* photographs to fit to */
    struct label_rows all;
    size_t *row, n;             /* those that are taken */
};

struct skin_sample {            /* a photograph on the texture square */
    float *log;                 /* (.., 3) log linear colour */
    float *normal;              /* (.., 3) x right, y up, z to the camera */
    float *weight;              /* 0 hidden .. 1 */
    float mean[3];
};

struct skin_fit {
    struct skin_chart chart;
    size_t n;
    float *slow, *weight;       /* (n,SLOW,SLOW,3), (n,SLOW,SLOW) */
    float *normal;              /* (SLOW,SLOW,3) summed over people */
    int8_t *grain;              /* (n,SIZE,SIZE) */
    float (*mean)[3];           /* (n) */
    struct brow_fit brows;
};

/* The skin of the photograph at path, whose landmarks are point, laid on the
 * chart. */
int skin_sample_take(struct skin_sample *o, const struct skin_model *s,
                     const struct skin_chart *c, const struct scan_face *f,
                     const struct register_map *m, const char *path,
                     const float *point, struct error *err);

/* Memory for n samples, but for their grain. */
int skin_fit_init(struct skin_fit *t, size_t n, struct arena *memory,
                  struct error *err);
/* Photograph i; may be called from several threads. */
int skin_fit_add(struct skin_fit *t, size_t i, const struct skin_model *s,
                 const struct scan_face *f, const struct register_map *m,
                 const char *path, const float *point, struct error *err);
/* Principal components (parts,d) of the rows of x (n,d), which have their mean
 * taken off: per deviation, largest first.  One of `every` triples of columns
 * tells how alike rows are.  NULL and *err when memory is short. */
float *skin_find_parts(const float *x, size_t n, size_t d, size_t every,
                       int parts, struct arena *memory, struct error *err);
/* Mean, parts and grain into s, whose arrays come from memory. */
int skin_fit_finish(struct skin_model *s, struct skin_fit *t,
                    struct arena *memory, struct error *err);

#endif
