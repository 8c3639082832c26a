/* The scans' face fitted to a photograph's landmarks: pose, identity and
 * expression. */
#ifndef SPID_LAB_PEOPLE_SCAN_REGISTER_H
#define SPID_LAB_PEOPLE_SCAN_REGISTER_H


#include "lib/head/arkit.h"
#include "lib/lab/people/landmark_map.h"
#include "lib/lab/people/scan_face.h"

#define REGISTER_TERMS (SCAN_IDENTITIES + ARKIT_COUNT)

/* Landmarks and the vertices they mean. */
struct register_map {
    int32_t vertex[LANDMARK_FACE];
    float weight[LANDMARK_FACE];
    float *basis;               /* (REGISTER_TERMS, LANDMARK_FACE, 3) */
};

/* The fitted face, as a nearly parallel camera sees it: x = at[0] + scale
 * p_x / (1 - p_z / REGISTER_DEPTH) with p = rot vertex. */
#define REGISTER_DEPTH 9.0f
struct registration {
    float rot[9], at[2], scale;
    float term[REGISTER_TERMS]; /* identity, then expression */
};

/* From DIR/labels/mediapipe_to_ict.json, into memory. */
int register_map_load(struct register_map *m, const struct scan_face *f,
                      const char *dir, struct arena *memory,
                      struct error *err);

/* Fit to points (LANDMARK_FACE,3: x, y, unused) of a picture of a face that
 * hardly differs from rest.  0, or -1 when memory is short. */
int register_fit(struct registration *r, const struct register_map *m,
                 const struct scan_face *f, const float *point);

/* Pixel of a vertex position, and the depth towards the camera. */
void register_project(float o[3], const struct registration *r,
                      const float p[3]);

/* out (FACE_VERTICES,3): the fitted face. */
void register_shape(float *out, const struct scan_face *f,
                    const struct registration *r);

#endif
