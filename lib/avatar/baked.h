/* An avatar as Phase B needs it: the baked Gaussians, which vertex each
 * dynamic one sits on, and where the source's lips were.  No networks: made
 * by avatar_bake or read from a GAUS record, and then only moved. */
#ifndef SPID_AVATAR_BAKED_H
#define SPID_AVATAR_BAKED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/avatar.h"
#include "lib/base/error.h"
#include "lib/base/densify.h"
#include "lib/base/drive.h"
#include "lib/base/relative_pose.h"
#include "lib/splat/types.h"
#include "lib/stream/stream.h"

/* Opening of the inner lips, head units, under which they hide the mouth:
 * 0.5 mm at five units a metre. */
#define BAKED_CLOSED 0.0025f

struct baked {
    size_t N, C;            /* Gaussians, channels */
    size_t dynamic;         /* the first Gaussians: branch 0 */
    size_t mouth;           /* the last ones: branch 2 */
    float *mean, *scale, *quat, *opacity, *color;
    uint8_t *branch;
    int32_t *vertex;        /* (dynamic) densified vertex of each */
    float lip[3];           /* l_s */
    bool has_jaw;           /* the mouth goes with the chin, by */
    float *jaw;             /* (N,3) (lib/base/drive.h), not with the lips; */
    float chin[3];          /* c_s */
    float *neck;            /* (N) neck blend weights (lib/base/neck_blend.h) */
    float pivot[3];         /* of the neck blend */
    float source[9];        /* R_s, where the static branch's shoulders were */
    float light[3];         /* l, on the source, head frame */
    float lamp[LAMP_SIZE];  /* that it is shown in (lib/base/relative_pose.h) */
    float *uv, *seen;       /* (N,2), (N) places in the source picture
                             * (lib/photo/place.h), seen by the */
    float view[12];         /* source's camera; all zero: no places */
    float *reach;           /* (N) gaussian_seen, from mean on */
    float *tilt;            /* (N,2) gaussian_visible */
    float *normal;          /* (N,3) of the surface, head frame */
    float *around;          /* (N,2) places in */
    uint8_t *grain;         /* (grain_size,grain_size) the grain
                             * (lib/avatar/grain.h), or NULL: none */
    size_t grain_size;
    size_t first, blended;  /* static Gaussians with a neck weight lie in
                             * this range: first index, count */
    float *block;           /* what the float arrays are part of */
};

/* A copy of what avatar_bake made; drawn: as baked_drop_clear leaves it. */
int baked_from_avatar(struct baked *b, const struct avatar *a, bool drawn,
                      struct error *err);
/* A copy of a set whose first `dynamic` Gaussians sit on as many vertices
 * while the others stay: no mouth, no neck blend, no places.  Of Gaussians i
 * where keep[i] is not 0, or of all (NULL). */
int baked_from_set(struct baked *b, const struct gaussians *g, size_t dynamic,
                   const uint8_t *keep, struct error *err);
/* From a GAUS record: checks order of branches, sizes, finite numbers, and
 * that vertex indices are under `vertices` (V + E; 0: unknown).  A record
 * without `vertex` has its dynamic Gaussians in order. */
int baked_read(struct baked *b, const struct record *rec, size_t vertices,
               struct error *err);
/* As a GAUS record; means: other centres (N,3) or NULL; cam NULL: none is
 * written, so that nothing is drawn. */
int baked_write(struct stream_writer *w, uint64_t frame, double time,
                const struct baked *b, const float *means, const float *cam,
                struct error *err);
/* Free what it holds; zeroed then. */
void baked_release(struct baked *b);

/* Whether it is known how light fell on the source. */
bool baked_is_lit(const struct baked *b);
/* The avatar is shown in the source's own light again. */
void baked_keep_light(struct baked *b);
/* Whether the Gaussians know their places in the source picture. */
bool baked_has_places(const struct baked *b);

/* The Gaussians as a renderer takes them. */
struct gaussians baked_set(const struct baked *b);

/* Keep Gaussian i where keep[i] is not 0; order stays. */
void baked_keep(struct baked *b, const uint8_t *keep);
/* Drop what the rules never draw, opacity under 1/255; returns how many. */
size_t baked_drop_clear(struct baked *b);

/* No neck blend from now on: shoulders turn with the head. */
void baked_drop_neck(struct baked *b);

/* What moves in a frame. */
struct baked_move {
    float *mean;            /* (dynamic,3) on the densified driven vertices */
    float *blended;         /* (blended,3) static centres and */
    float *mouth;           /* (mouth,3) the mouth's, by baked_move_scene */
    struct drive_frame frame;   /* plane: the static branch's shoulders; to:
                             * the mouth's shift l_d - l_s (0 with jaw), or a
                             * way behind the camera, from: 0 */
    float relative_pose[RELATIVE_POSE_SIZE];    /* of the head */
};
/* Memory for what moves of b in a frame.  EX_OSERR. */
int baked_move_init(struct baked_move *m, const struct baked *b,
                    struct error *err);
/* Free what it holds; zeroed then. */
void baked_move_release(struct baked_move *m);

/* One frame's mean, rigid motions and relative pose.  The mouth's Gaussians
 * hide when gap, the opening of the driven lips, is under BAKED_CLOSED.
 * verts (V,3) driven, lip (3) their centroid l_d, chin (3) their chin's (NULL:
 * unknown, the jaw stays), cam (3,4) the frame's. */
void baked_drive(struct baked_move *m, const struct baked *b,
                 const struct densify *mesh, const float *verts,
                 const float lip[3], const float *chin, float gap,
                 const float cam[12]);
/* Hand it to a renderer that has loaded baked_set. */
int baked_move_scene(struct splat *s, struct baked_move *m,
                     const struct baked *b, struct error *err);
/* All centres (N,3) of the frame. */
void baked_means(float *means, const struct baked *b,
                 const struct baked_move *m);

#endif
