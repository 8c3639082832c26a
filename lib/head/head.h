/* The head model: FLAME's arrays under FLAME's names, from a safetensors file
 * or from memory, checked and laid out for posing.
 *
 * In the file, in metres (FLAME's own values drop in):
 *   v_template     f32 [V,3]           x to the subject's left, y up, z front
 *   f              i32 [F,3]
 *   shapedirs      f32 [V,3,nshape+nexp]   identity first, then expression
 *   posedirs       f32 [V,3,36]        of (R_j - I) row-major, j = 1..4
 *   J_regressor    f32 [5,V]           root, neck, jaw, left eye, right eye
 *   weights        f32 [V,5]           each row sums to 1 within 1e-4
 *   parents        i32 [5]             -1 0 1 1 1
 *   l_eyelid, r_eyelid  f32 [V,3]      displacement of the closed lid
 *   lip_inner      i32 [n]             inner lip ring, in ring order
 *   lip_upper_outer  i32 [n]           outer edge of the upper lip
 *   landmark_faces i32 [68], landmark_bary f32 [68,3]
 * optional (NULL when absent):
 *   region i32 [V], hair f32 [V], uv f32 [V,2]
 *   lid_vertices, lid_sides i32 [n], lid_shapedirs f32 [n,3,m]: what the
 *     first m shape coefficients add to the closed lids (side 0 left, 1 right)
 *     so that every identity's close
 *   avatar.*: the template avatar (lib/head/head_avatar.h)
 * Directions may be packed instead: shapedirs_runs and shapedirs_values,
 * posedirs_runs and posedirs_values (lib/head/runs.h), the number of them in
 * the metadata "nshape" and "nexp".
 * Metadata: "scale" (default 5), "nshape" (default 300, or all when there are
 * no more than 300 directions).
 *
 * Everything in struct head is in head units: metres times scale. */
#ifndef SPID_HEAD_HEAD_H
#define SPID_HEAD_HEAD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "lib/base/arena.h"
#include "lib/base/error.h"
#include "lib/head/head_avatar.h"

#define HEAD_JOINTS 5
#define HEAD_POSE_DIRS 36
#define HEAD_LANDMARKS 68
#define HEAD_LIP_UPPER 62       /* landmarks: the middles of the lips' inner edges */
#define HEAD_LIP_LOWER 66
#define HEAD_MAX_EXP 512   /* expression directions at most */
#define HEAD_BLOCK 32      /* vertices of one block of the posing layout */
#define HEAD_CHIN 32       /* vertices of the chin at most */

enum head_joint {
    JOINT_ROOT, JOINT_NECK, JOINT_JAW, JOINT_EYE_LEFT, JOINT_EYE_RIGHT
};
/* Values of `region`. */
enum head_region {
    REGION_SKIN, REGION_FACE, REGION_LIPS, REGION_EYELID, REGION_EYEBALL,
    REGION_EAR, REGION_NECK, REGION_NOSE, REGION_BROW, REGION_INNER_MOUTH,
    REGION_COUNT
};

/* The model as arrays in memory: what a file holds, or what a generator or a
 * test makes.  Lengths in metres; nothing is kept after head_init. */
struct head_arrays {
    size_t V, F, nshape, nexp;
    float scale;                /* 0 means 5 */
    const float *v_template;    /* (V,3) */
    const int32_t *f;           /* (F,3) */
    const float *shapedirs;     /* (V,3,nshape+nexp) */
    const float *posedirs;      /* (V,3,36) */
    const float *J_regressor;   /* (5,V) */
    const float *weights;       /* (V,5) */
    const int32_t *parents;     /* (5) */
    const float *l_eyelid, *r_eyelid;   /* (V,3) */
    const int32_t *lip_inner, *lip_upper_outer;
    size_t nlip_inner, nlip_upper_outer;
    const int32_t *landmark_faces;      /* (68), or NULL: no landmarks */
    const float *landmark_bary;         /* (68,3) */
    const int32_t *region;      /* (V) or NULL */
    const float *hair;          /* (V) density, 0 to 1, or NULL */
    const float *uv;            /* (V,2) or NULL */
    size_t nlid, nlid_shape;    /* 0: lids close alike for everyone */
    const int32_t *lid_vertices, *lid_sides;    /* (nlid) */
    const float *lid_shapedirs; /* (nlid,3,nlid_shape) */
};

struct head {
    size_t V, F, nshape, nexp;
    size_t blocks;              /* ceil(V / HEAD_BLOCK) */
    float scale;                /* head units per metre */
    int public_rodrigues;       /* rotate by the public FLAME code's formula
                                 * (rotation.h) instead of the exact map; off
                                 * unless set after loading */
    int jaw_shape;              /* no vertex hangs on the jaw: pose corrections
                                 * alone open it */
    char hash[17];              /* hex, of the numbers above: same head, same
                                 * hash, whatever file it came from */
    float *v_template;          /* (V,3) */
    int32_t *f;                 /* (F,3) */
    float *weights;             /* (V,5) */
    int32_t parents[HEAD_JOINTS];
    float *l_eyelid, *r_eyelid; /* (V,3) */
    int32_t *lip_inner, *lip_upper_outer;
    size_t nlip_inner, nlip_upper_outer;
    int32_t chin[HEAD_CHIN];    /* vertices that go with the jaw most */
    size_t nchin;               /* 0: nothing tells how the jaw turns */
    int32_t landmark_faces[HEAD_LANDMARKS];
    float landmark_bary[HEAD_LANDMARKS * 3];
    int has_landmarks;
    int32_t *region;            /* (V) or NULL */
    float *hair;                /* (V) or NULL */
    float *uv;                  /* (V,2) or NULL */
    size_t nlid, nlid_shape;
    int32_t *lid_vertices, *lid_sides;  /* (nlid) or NULL */
    float *lid_shapedirs;       /* (nlid,3,nlid_shape) or NULL */
    struct head_avatar avatar;  /* all 0: the head has none */

    /* Posing layout: block b holds x[32], y[32], z[32] of vertices 32b..,
     * zero beyond V; directions lie inside the block, so that one pass over
     * memory poses the head. */
    struct arena memory;        /* what the arrays lie in, but zeroed floats: */
    float *floats;
    float *shape_dirs;          /* (blocks, nshape, 96) */
    float *exp_dirs;            /* (blocks, nexp, 96) */
    float *pose_dirs;           /* (blocks, 36, 96) */
    uint64_t *shape_live;       /* (blocks, (nshape + 63) / 64) bit k:
                                 * direction k moves something in the block;
                                 * or NULL */
    uint64_t *exp_live;         /* (blocks, HEAD_MAX_EXP / 64) the same of
                                 * exp_dirs, or NULL */
    uint64_t *pose_live;        /* (blocks) the same of pose_dirs, or NULL */
    float *skin;                /* (blocks, 5, 32) weights */
    float *lids;                /* (blocks, 2, 96) left, right; the mean
                                 * identity's */
    float *template_blocks;     /* (blocks, 96) */
    float joint_template[HEAD_JOINTS * 3];
    float *joint_shape;         /* (nshape, 15) joints per shape direction */
    float *joint_exp;           /* (nexp, 15) */
};

/* Fill h from arrays, checking everything: parents, sums of weights, indices,
 * finite numbers.  -1 and *err naming array and index; h is then released. */
int head_init(struct head *h, const struct head_arrays *a, struct error *err);
/* The same from a file; errors start with the path. */
int head_load(struct head *h, const char *path, struct error *err);
void head_release(struct head *h);      /* a zeroed head is allowed */

/* out (V,3) = direction k of n in the posing layout (h->shape_dirs with
 * h->nshape, h->exp_dirs with h->nexp, and so on), head units. */
void head_direction(float *out, const struct head *h, const float *dirs,
                    size_t n, size_t k);

/* Whether the expression components are ARKit's shapes in lib/head/arkit.h's
 * order: places 0 to 52 are there and exactly those of joints and lids are
 * zero shapes. */
bool head_has_arkit(const struct head *h);

/* How much of the jaw's turn vertex v makes, 0 to 1: its skinning weight or,
 * where no vertex has one (head->jaw_shape), by its pose corrections. */
float head_jaw_share(const struct head *h, size_t v);

/* Positions (68,3) of the landmarks on verts (V,3). */
void head_landmarks(float *lmk, const struct head *h, const float *verts);
/* dverts (V,3) += gradient of dlmk (68,3). */
void head_landmarks_backward(float *dverts, const float *dlmk,
                             const struct head *h);

/* Centroid of n listed vertices of verts (V,3), 0 of none: of the inner lip
 * ring l_s or l_d. */
void head_centroid(float c[3], const int32_t *list, size_t n,
                   const float *verts);
/* dverts (V,3) += gradient of dc (3). */
void head_centroid_backward(float *dverts, const float dc[3],
                            const int32_t *list, size_t n);

/* What the mouth branch needs of the source mesh, head units. */
struct head_mouth {
    float centre[3];    /* l_s, inner-lip centroid */
    float radius;       /* r_lip: largest |x| or |y| of the ring about it */
    float bowl;         /* d_bowl: depth range of the inner ring */
    float lip;          /* d_lip: depth range of the upper lip's outer edge */
    float gap;          /* mean vertical opening of the inner ring */
    float chin[3];      /* the chin's centroid */
};
/* Of posed vertices verts (V,3); a head without mouth lists gives zeros. */
void head_mouth(struct head_mouth *m, const struct head *h,
                const float *verts);

/* Fill h->chin, once the rest of h is there: what lies below the lips in the
 * middle and makes nearly all of the jaw's turn. */
void head_find_chin(struct head *h);

/* Unit vertex normals (V,3) of verts (V,3), area weighted; 0 where a vertex
 * has no face. */
void head_normals(float *normals, const struct head *h, const float *verts);

/* Whether shape direction k moves anything in block b.  Where it does not, its
 * pages of zeros have never been touched, and reading them is not free. */
static inline bool head_shape_moves(const struct head *h, size_t b, size_t k)
{
    const size_t words = (h->nshape + 63) / 64;

    return !h->shape_live || h->shape_live[b * words + k / 64] >> k % 64 & 1;
}

#endif
