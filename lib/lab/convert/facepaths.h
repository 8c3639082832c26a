/* What a FLAME file does not say but its mesh and landmarks do: the rings of
 * the lips, and how the eyelids close. */
#ifndef SPID_LAB_CONVERT_FACEPATHS_H
#define SPID_LAB_CONVERT_FACEPATHS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/lab/head/surface.h"

#define FACE_LANDMARKS 68

/* The mesh, in metres, and the 68 usual landmarks on it; borrowed. */
struct face_mesh {
    size_t V, F;
    const float *verts;             /* (V,3) */
    const int32_t *f;               /* (F,3), checked */
    const int32_t *landmark_faces;  /* (68), checked */
    const float *landmark_bary;     /* (68,3) */
    float eye[2][3];                /* joints of the eyes: left, right */
};

struct face_paths {
    struct face_mesh mesh;
    struct arena *memory;       /* borrowed */
    struct surface near;    /* neighbours */
    double *cost;       /* (V) from the start; < 0: not seen */
    int32_t *from;      /* (V) */
    bool *done;         /* (V) */
    int32_t *open;      /* (V) seen, not done */
    bool *face;         /* (V) connected to the corner of an eye */
};

/* Everything comes from memory, which is borrowed.  -1 when it is short. */
int face_paths_init(struct face_paths *p, const struct face_mesh *m,
                    struct arena *memory, struct error *err);

/* Vertices from landmark to landmark along the shortest edges, a ring when
 * the last is the first again.  -1 and *err when two are not connected. */
int face_paths_trace(int32_t **out, size_t *count, struct face_paths *p,
                     const int *landmarks, size_t n, struct error *err);

/* out (V,3): the displacement that closes the left (side 0) or right lid: the
 * upper lid's edge comes to lie on the lower one's, the skin above follows
 * less and less, and all of it stays on a sphere about the eye's joint. */
int face_paths_eyelid(float *out, struct face_paths *p, int side,
                      struct error *err);

#endif
