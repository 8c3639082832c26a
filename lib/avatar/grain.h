/* Grain: what is finer than the mesh's colours, of which there is one each 2.8 mm:
 * pores, stubble, strands of hair.  The photograph has it; where it does not show
 * the head, the head's materials have there what they have elsewhere in it
 * (lib/photo/quilt.h).
 *
 * It lies on a picture that goes around the head: the photograph's own, as if
 * the head were unrolled before its camera.  So a place of a Gaussian in it moves
 * with the screen as one in the photograph does, and neither has a seam where a
 * turn shows it. */
#ifndef SPID_AVATAR_GRAIN_H
#define SPID_AVATAR_GRAIN_H

#include <stddef.h>
#include <stdint.h>

#include "lib/avatar/dynamic_branch.h"
#include "lib/avatar/source_mesh.h"
#include "lib/avatar/source_picture.h"
#include "lib/base/error.h"
#include "lib/nn/plan.h"

/* How far a place of the mesh shows its material's grain, and the chances of hair and
 * cloth there. */
enum { GRAIN_CONFIDENCE, GRAIN_HAIR, GRAIN_CLOTH, GRAIN_VALUES };

/* Maps (S,S) of the photograph, then of the picture around, and what is drawn
 * into them. */
struct grain_work {
    float *depth, *drawn;       /* as the mesh has it: (S,S,GRAIN_VALUES) */
    float *from, *out, *tmp;
    float *known;               /* 1 where a pixel's material is known, or 0 */
    float *scratch;             /* (MATERIALS) of quilts */
    uint8_t *is, *want;         /* 0 or a material plus 1 */
    float *vertex;              /* (V,3) unrolled, as a camera at 0 sees it */
    float *value;               /* (V,GRAIN_VALUES) */
    int32_t *face;              /* (F,3) those that the map does not cut */
};

struct grain {
    size_t size;                /* S: side, pixels, the photograph's */
    uint8_t *picture;           /* (S,S) what colours are multiplied by there,
                                 * times 128 */
    float *around;              /* (N,2) places in it, 0..1 across and down;
                                 * GRAIN_NOWHERE of what has none */
    struct nn_plan maps;        /* the work's, networks' memory at other times */
    struct grain_work work;
    float *block;               /* what the other arrays are part of */
};

#define GRAIN_NOWHERE (-9.0f)

/* Memory for N Gaussians of head h and photographs of size x size; opt as for the
 * networks of the same avatar.  EX_OSERR. */
int grain_init(struct grain *g, const struct head *h, size_t N, size_t size,
               struct nn_options opt, struct error *err);
/* Free what it holds; zeroed then. */
void grain_release(struct grain *g);

/* The picture, and around of N Gaussians, of which the first n lie on the mesh: b's
 * after a forward. */
void grain_find(struct grain *g, size_t n, size_t N,
                const struct dynamic_branch *b,
                const struct source_mesh *mesh,
                const struct source_picture *picture);

#endif
