/* Disks on the mesh (disks.h). */
#include "lib/avatar/disks.h"

#include <math.h>

#include "lib/avatar/material.h"
#include "lib/base/parallel.h"
#include "lib/base/vec3.h"

/* Standard deviation over the spacing, the least of any. */
#define SCALE_MIN 0.4f
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

/* The least standard deviation of Gaussian k: the decoder makes those that face
 * the camera so thin that gaps would open between their rows on a turned
 * head. */
static float disks_min_scale(const struct dynamic_branch *b, size_t k)
{
    return fminf(SCALE_MIN * b->spacing[k], BRANCH_SCALE_MAX);
}

/* How large axis c of Gaussian k is beside its spread over the mesh: hair and the
 * rims of lips, which turn inward, are as thick as wide, other skin is thin along its
 * normal, which is the third axis' or nearly. */
static float disks_thickness(const struct dynamic_branch *b, size_t k, size_t c)
{
    const float hair = b->chance[MATERIAL_HAIR * b->count + k];

    return c == 2 ? THIN + (1 - THIN) * fmaxf(hair, b->seam[k]) : 1;
}

/* quat (4) goes over, as w falls from 1 to 0, into the rotation by which the third
 * axis becomes the normal n's, which is of any length. */
static void disks_turn(float quat[4], const float n[3], float w)
{
    const float len = length3(n);
    float to[4] = {len + n[2], -n[1], n[0], 0}, dot = 0;
    float square = 2 * len * to[0];

    if (square < 1e-6f) {               /* half a turn, or no normal */
        to[1] = square = 1;
        to[2] = 0;
    }
    for (int c = 0; c < 4; c++)
        dot += quat[c] * to[c];
    for (int c = 0; c < 4; c++)         /* of to and -to the nearer one */
        quat[c] = w * quat[c] +
                  copysignf((1 - w) / sqrtf(square), dot) * to[c];
}

PARALLEL(disks_lay_part, k, const struct dynamic_branch *, b,
         struct branch_set *, out)
{
    float w = disks_visibility(b, k), *scale = out->scale + 3 * k;
    float min = disks_min_scale(b, k);
    float size = BRANCH_OVERLAP + b->seam[k] * (SCALE_MIN - BRANCH_OVERLAP);
    float wide = fminf(size * b->spacing[k], BRANCH_SCALE_MAX);
    float *color = out->color + k * out->channels;

    for (size_t c = 0; c < 3; c++) {
        float own = 1 / (1 + expf(-b->logit[3 * k + c]));
        float thick = disks_thickness(b, k, c);

        color[c] = w * color[c] + (1 - w) * own;
        scale[c] = w * fmaxf(scale[c], thick * min) + (1 - w) * thick * wide;
    }
    disks_turn(out->quat + 4 * k, b->normals + 3 * k, w);
    for (size_t c = 3; c < out->channels; c++)
        color[c] *= w;
    out->opacity[k] =
        w * out->opacity[k] + (1 - w) * BRANCH_SOLID * b->start.visible[k];
}

void disks_lay(struct branch_set *out, const struct dynamic_branch *b)
{
    parallel_each(disks_lay_part, out->n, 1, b, out);
}

/* The decoder's scale i, three a Gaussian, as branch_prior_forward has it. */
static float disks_net_scale(const struct dynamic_branch *b, size_t i)
{
    return BRANCH_SCALE_MAX *
           attribute_shift(b->start.scale[i] / BRANCH_SCALE_MAX,
                           b->start.scale_shift[i / 3]);
}

PARALLEL(disks_lay_backward_part, k, const struct dynamic_branch *, b,
         struct branch_set *, dout)
{
    float w = disks_visibility(b, k);
    float min = disks_min_scale(b, k);

    for (size_t c = 0; c < dout->channels; c++)
        dout->color[k * dout->channels + c] *= w;
    for (size_t c = 0; c < 3; c++)
        dout->scale[3 * k + c] *=
            disks_net_scale(b, 3 * k + c) >
            disks_thickness(b, k, c) * min ? w : 0;
    for (size_t c = 0; c < 4; c++)
        dout->quat[4 * k + c] *= w;
    dout->opacity[k] *= w;
}

void disks_lay_backward(struct branch_set *dout, const struct dynamic_branch *b)
{
    parallel_each(disks_lay_backward_part, dout->n, 1, b, dout);
}
