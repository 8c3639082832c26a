/* One worker's scratch space and the renderer of figures: a person in a pose
 * in front of the camera, as linear light with coverage and labels. */
#ifndef SPID_LAB_PEOPLE_SCAN_STAGE_H
#define SPID_LAB_PEOPLE_SCAN_STAGE_H

#include "lib/lab/people/scan_figure.h"
#include "lib/lab/people/sun.h"

#define SCAN_GRID 2             /* samples per pixel and axis */
#define SCAN_SHADOW 256         /* side of a lamp's depth map */

/* The head and the shoulders before the camera: x_cam = rot x + trans, pixel
 * = size / 2 + focal x / z with focal in pixels of a picture of side 1. */
struct scan_view {
    float rot[9], trans[3];
    float body[9];
    float focal;                /* over the picture's side */
};

struct scan_shadow {            /* blurred exp(SHARP height) seen from a lamp */
    float *map;
    struct sun sun;
};

struct scan_stage {
    struct arena memory;
    int size, grid;             /* pixels, samples of a side */
    const struct figure *figure;
    const struct act *act;
    const struct follow *follow;
    const float *verts;         /* (V,3) the head's, posed */
    float *bend;                /* (V,3) scratch */
    struct scan_view view;
    /* by corner */
    struct arena corners;       /* memory of so many, and */
    size_t room;
    float *face;                /* (FACE_VERTICES,3) posed, head frame */
    float *face_normal;         /* (FACE_VERTICES,3) head frame */
    float *head;                /* (nc,3) posed, head frame */
    float *place, *normal;      /* (nc,3) camera frame */
    float *bright;              /* (nc,3) share of the free sky's light */
    struct raster_vertex *spot; /* (nc) */
    /* by veil face */
    size_t veil_room;           /* of so many */
    uint64_t *order;
    /* by sample */
    float *q, *b1, *b2;
    uint32_t *id;
    float *color;               /* (samples,3) premultiplied */
    float *cover;               /* (samples) */
    uint8_t *label;             /* (samples) */
    float *flat;                /* scratch of the shadow maps */
    struct raster_vertex *sun;  /* (nc) */
    struct scan_shadow shadow[LIGHT_LAMPS];
    /* results, by pixel */
    float *light;               /* (size,size,3) linear, times coverage, of
                                 * the person */
    float *alpha;               /* (size,size) */
    float *front;               /* (size,size,3) the same of what stands in
                                 * front of the person */
    float *block;               /* (size,size) */
    uint8_t *tag;               /* (size,size) enum synth_label */
};

/* Memory for pictures of size x size. */
int scan_stage_init(struct scan_stage *s, int size, struct error *err);
/* Free what it holds; zeroed then. */
void scan_stage_release(struct scan_stage *s);

/* Draw a figure: fills light, alpha, front, block and tag.  s->follow, verts
 * and bend are the caller's. */
int scan_stage_render(struct scan_stage *s, const struct figure *f,
                      const struct act *act, const struct scan_view *v,
                      struct error *err);

/* ---- its parts ---------------------------------------------------------- */

/* Vertices and normals of all pieces in the frame's pose, and their places on
 * the screen. */
void scan_pose(struct scan_stage *s);
/* A shadow map for each lamp. */
void scan_shadows(struct scan_stage *s);
/* Opaque pieces into the samples. */
void scan_draw(struct scan_stage *s);
/* Hair, lashes and lenses over them, from behind forwards. */
void scan_veils(struct scan_stage *s);

/* ---- shading, for scan_draw and scan_veils ------------------------------ */

/* What the surface is like at a sample, camera frame. */
struct scan_point {
    float p[3], n[3], view[3];  /* unit normal; unit, to the camera */
    float bright[3];
    float u, v, extra;
    uint32_t face;
    float w[3];                 /* weights of the corners */
};

/* Share of lamp i's light that reaches p. */
float scan_shadow_at(const struct scan_stage *s, int i, const float p[3],
                     const float n[3]);
/* Radiance towards the camera. */
void scan_shade(float rgb[3], const struct scan_stage *s,
                struct scan_point *o);
/* The same for a veil, with its opacity; 0 is nothing to see. */
float scan_shade_veil(float rgb[3], const struct scan_stage *s,
                      struct scan_point *o);

#endif
