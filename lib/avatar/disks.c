/* Disks on the mesh (disks.h). */
#include "lib/avatar/disks.h"

#include <math.h>

#include "lib/avatar/material.h"
#include "lib/base/parallel.h"
#include "lib/base/vec3.h"

#define THIN 0.15f      /* skin's thickness beside its size, 4 pixels of 512 on a
                         * cheek: an outline is about 2 of them, 1 pixel and not 8,
                         * wider than the mesh.  Twice and half: 0.02 dB
                         * (tests/bench/README.md, "Skin is thin") */

/* How far the source shows Gaussian k (written by dynamic_branch_start) in the
 * light that it will be seen in, 0..1; 0 on lids, which the decoder tints. */
static float disks_visibility(const struct dynamic_branch *b, size_t k)
{
    return b->in[(k + 1) * b->inputs - DYNAMIC_BRANCH_EXTRA + 2] *
           (1 - b->seam[k]) * (1 - b->fold[k]);
}

/* quat (4): the rotation by which the third axis becomes the normal n's, which is of
 * any length. */
static void disks_turn(float quat[4], const float n[3])
{
    float to[4] = {length3(n) + n[2], -n[1], n[0], 0};
    float square = 2 * length3(n) * to[0];

    if (square < 1e-6f) {               /* half a turn, or no normal */
        to[1] = square = 1;
        to[2] = 0;
    }
    for (int c = 0; c < 4; c++)
        quat[c] = to[c] / sqrtf(square);
}

PARALLEL(disks_lay_part, k, const struct dynamic_branch *, b,
         const struct source_mesh *, mesh, struct branch_set *, out)
{
    const float w = disks_visibility(b, k);
    const float hair = b->chance[MATERIAL_HAIR * b->count + k];
    const float wide = fminf(BRANCH_OVERLAP * b->spacing[k], BRANCH_SCALE_MAX);
    float *color = out->color + k * out->channels, *scale = out->scale + 3 * k;

    for (size_t c = 0; c < 3; c++)
        color[c] = w * color[c] + (1 - w) / (1 + expf(-b->logit[3 * k + c]));
    for (size_t c = 3; c < out->channels; c++)
        color[c] *= w;
    scale[0] = scale[1] = wide;
    scale[2] = (THIN + (1 - THIN) * hair) * wide;
    disks_turn(out->quat + 4 * k, b->normals + 3 * k);
    out->opacity[k] = BRANCH_SOLID * (1 - mesh->weights->lining[k]);
}

void disks_lay(struct branch_set *out, const struct source_mesh *mesh,
               const struct dynamic_branch *b)
{
    parallel_each(disks_lay_part, out->n, 1, b, mesh, out);
}

PARALLEL(disks_lay_backward_part, k, const struct dynamic_branch *, b,
         struct branch_set *, dout)
{
    const float w = disks_visibility(b, k);

    for (size_t c = 0; c < dout->channels; c++)
        dout->color[k * dout->channels + c] *= w;
}

void disks_lay_backward(struct branch_set *dout, const struct dynamic_branch *b)
{
    parallel_each(disks_lay_backward_part, dout->n, 1, b, dout);
}
