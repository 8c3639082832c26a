/* What a camera makes of a person of the scans: background, exposure, tone,
 * optics, noise and compression; and the same picture of the person alone. */
#ifndef SPID_LAB_PEOPLE_SCAN_FILM_H
#define SPID_LAB_PEOPLE_SCAN_FILM_H

#include "lib/lab/people/scan_stage.h"

/* Where a finished frame goes; sizes (size,size[,3]). */
struct scan_print {
    uint8_t *rgb;               /* the picture */
    uint8_t *person;            /* the person alone over black, as the lens
                                 * drew them, before noise and compression */
    uint8_t *mask;              /* coverage by the person */
    uint8_t *label;             /* enum synth_label; LABEL_OCCLUDER wherever
                                 * something stands in front */
};

struct scan_film {
    struct arena memory;
    int size;
    float *layer;               /* (8,size,size) planes: person rgb, cover,
                                 * front rgb, cover */
    float *wall;                /* (3,size,size) */
    float *tmp;                 /* scratch (3,size,size) */
};

/* Memory for pictures of size x size. */
int scan_film_init(struct scan_film *f, int size, struct error *err);
/* Free what it holds; zeroed then. */
void scan_film_release(struct scan_film *f);

/* Linear background (3,size,size) behind a figure: a view of its panorama out
 * of focus, or a wall in its light. */
void scan_backdrop(float *wall, float *tmp, const struct figure *f, int size);

/* Expose what the stage holds over wall.  frame selects the noise; move is the
 * head's motion during the exposure, pixels. */
void scan_expose(const struct scan_print *out, struct scan_film *film,
                 const struct scan_stage *s, const float *wall,
                 uint64_t frame, double time, const float move[2]);

#endif
