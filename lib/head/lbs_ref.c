/* The plain double-precision posing the tests compare with: vertex by vertex,
 * one sum after the other, nothing skipped. */
#include "lib/head/lbs.h"

#include <string.h>

#include "lib/base/rotation.h"
#include "lib/head/lbs_kernel.h"

#define ROW (3 * HEAD_BLOCK)

/* Component c of vertex v in direction k of a block layout of n directions. */
static double lbs_dirs_at(const float *dirs, size_t n, size_t k, size_t v,
                          int c)
{
    return dirs[(v / HEAD_BLOCK * n + k) * ROW + (size_t)c * HEAD_BLOCK +
                v % HEAD_BLOCK];
}

/* As lbs.c's, in double and from the arrays themselves. */
static void lbs_chain_d(struct lbs_chain *c, const struct head *h,
                        const struct head_motion_d *m)
{
    for (int j = 0; j < HEAD_JOINTS; j++) {
        if (h->public_rodrigues)
            rotation_rodrigues_eps_d(c->R[j], m->pose + 3 * j);
        else
            rotation_exp_d(c->R[j], m->pose + 3 * j);
        for (int i = 0; i < 3; i++) {
            double x = h->joint_template[3 * j + i];

            for (size_t k = 0; k < h->nshape; k++)
                x += m->beta[k] * h->joint_shape[15 * k + 3 * j + i];
            for (size_t k = 0; k < h->nexp; k++)
                x += m->exp[k] * h->joint_exp[15 * k + 3 * j + i];
            c->J[j][i] = x;
        }
    }
    lbs_chain_forward(c, h->parents);
}

/* Vertex v before skinning: T + B_S + B_E + B_P. */
static void lbs_rest_d(double p[3], const struct head *h,
                       const struct lbs_chain *c, const struct head_motion_d *m,
                       size_t v)
{
    for (int i = 0; i < 3; i++) {
        p[i] = h->v_template[3 * v + i];
        for (size_t k = 0; k < h->nshape; k++)
            p[i] += m->beta[k] * lbs_dirs_at(h->shape_dirs, h->nshape, k, v, i);
        for (size_t k = 0; k < h->nexp; k++)
            p[i] += m->exp[k] * lbs_dirs_at(h->exp_dirs, h->nexp, k, v, i);
        for (int k = 0; k < HEAD_POSE_DIRS; k++)
            p[i] += (c->R[1 + k / 9][k % 9] - (k % 9 % 4 == 0)) *
                    lbs_dirs_at(h->pose_dirs, HEAD_POSE_DIRS, (size_t)k, v, i);
    }
}

/* A vertex' mean of the joints' transforms. */
static void lbs_blend_d(double M[12], const struct head *h,
                        const struct lbs_chain *c, size_t v)
{
    for (int i = 0; i < 12; i++) {
        M[i] = 0;
        for (int j = 0; j < HEAD_JOINTS; j++)
            M[i] += h->weights[HEAD_JOINTS * v + j] * c->A[j][i];
    }
}

/* d = the left and the right lid of beta at vertex v. */
static void lbs_lids_d(double d[2][3], const struct head *h, const double *beta,
                       size_t v)
{
    for (int i = 0; i < 3; i++) {
        d[0][i] = h->l_eyelid[3 * v + (size_t)i];
        d[1][i] = h->r_eyelid[3 * v + (size_t)i];
    }
    for (size_t i = 0; i < 3 * h->nlid; i++)
        for (size_t k = 0; (size_t)h->lid_vertices[i / 3] == v &&
                           k < h->nlid_shape; k++)
            d[h->lid_sides[i / 3]][i % 3] +=
                beta[k] * h->lid_shapedirs[i * h->nlid_shape + k];
}

struct head_motion_d head_motion_widen(double *exp, const struct head_motion *m,
                                       size_t nexp)
{
    struct head_motion_d d = {.exp = exp, .lid = {m->lid[0], m->lid[1]}};
    const float *const part[HEAD_JOINTS] = {m->global, m->neck, m->jaw, m->eye,
                                            m->eye + 3};

    for (int i = 0; i < 3 * HEAD_JOINTS; i++)
        d.pose[i] = part[i / 3][i % 3];
    for (size_t k = 0; k < nexp; k++)
        exp[k] = m->exp[k];
    return d;
}

void head_pose_d(double *verts, double *joints, const struct head *h,
                 const struct head_motion_d *m)
{
    struct lbs_chain c;

    lbs_chain_d(&c, h, m);
    for (size_t v = 0; v < h->V; v++) {
        double p[3], M[12], lid[2][3];

        lbs_lids_d(lid, h, m->beta, v);

        lbs_rest_d(p, h, &c, m, v);
        lbs_blend_d(M, h, &c, v);
        for (int i = 0; i < 3; i++)
            verts[3 * v + i] = M[4 * i] * p[0] + M[4 * i + 1] * p[1] +
                               M[4 * i + 2] * p[2] + M[4 * i + 3] +
                               m->lid[0] * lid[0][i] + m->lid[1] * lid[1][i];
    }
    for (int i = 0; joints && i < 3 * HEAD_JOINTS; i++)
        joints[i] = c.tg[i / 3][i % 3];
}
