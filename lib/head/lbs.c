/* A frame's small numbers (joints, correctives) here, the vertices in
 * kernels by blocks (lbs_tmpl.c), and the same backward. */
#include "lib/head/lbs.h"

#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "lib/base/cpu.h"
#include "lib/base/parallel.h"
#include "lib/base/rotation.h"
#include "lib/head/lbs_kernel.h"

#define ROW (3 * HEAD_BLOCK)

/* ---- the joint chain --------------------------------------------------- */

void lbs_chain_forward(struct lbs_chain *c, const int parents[HEAD_JOINTS])
{
    for (int j = 0; j < HEAD_JOINTS; j++) {
        int p = parents[j];

        if (p < 0) {
            memcpy(c->Rg[j], c->R[j], sizeof c->Rg[j]);
            memcpy(c->tg[j], c->J[j], sizeof c->tg[j]);
        } else {
            mat3_mul_d(c->Rg[j], c->Rg[p], c->R[j]);
            for (int i = 0; i < 3; i++) {
                c->tg[j][i] = c->tg[p][i];
                for (int k = 0; k < 3; k++)
                    c->tg[j][i] += c->Rg[p][3 * i + k] *
                                   (c->J[j][k] - c->J[p][k]);
            }
        }
        for (int i = 0; i < 3; i++) {
            c->A[j][4 * i + 3] = c->tg[j][i];
            for (int k = 0; k < 3; k++) {
                c->A[j][4 * i + k] = c->Rg[j][3 * i + k];
                c->A[j][4 * i + 3] -= c->Rg[j][3 * i + k] * c->J[j][k];
            }
        }
    }
}

void lbs_chain_backward(double dR[HEAD_JOINTS][9], double dJ[HEAD_JOINTS][3],
                        double dA[HEAD_JOINTS][12],
                        const double dtg_in[HEAD_JOINTS][3],
                        const struct lbs_chain *c,
                        const int parents[HEAD_JOINTS])
{
    double dRg[HEAD_JOINTS][9], dtg[HEAD_JOINTS][3], local[9];

    memcpy(dtg, dtg_in, sizeof dtg);
    /* A = [Rg | tg - Rg J] */
    for (int j = 0; j < HEAD_JOINTS; j++)
        for (int i = 0; i < 3; i++) {
            double g = dA[j][4 * i + 3];

            dtg[j][i] += g;
            for (int k = 0; k < 3; k++) {
                dRg[j][3 * i + k] = dA[j][4 * i + k] - g * c->J[j][k];
                dJ[j][k] -= c->Rg[j][3 * i + k] * g;
            }
        }
    for (int j = HEAD_JOINTS - 1; j >= 0; j--) {
        int p = parents[j];

        if (p < 0) {
            for (int i = 0; i < 9; i++)
                dR[j][i] += dRg[j][i];
            for (int i = 0; i < 3; i++)
                dJ[j][i] += dtg[j][i];
            continue;
        }
        /* Rg_j = Rg_p R_j;  tg_j = tg_p + Rg_p (J_j - J_p) */
        mat3_mul_tn_d(local, c->Rg[p], dRg[j]);
        for (int i = 0; i < 9; i++)
            dR[j][i] += local[i];
        mat3_mul_nt_d(local, dRg[j], c->R[j]);
        for (int i = 0; i < 3; i++) {
            dtg[p][i] += dtg[j][i];
            for (int k = 0; k < 3; k++) {
                double back = c->Rg[p][3 * i + k] * dtg[j][i];

                dRg[p][3 * i + k] += local[3 * i + k] +
                                     dtg[j][i] * (c->J[j][k] - c->J[p][k]);
                dJ[j][k] += back;
                dJ[p][k] -= back;
            }
        }
    }
}

/* ---- identity ---------------------------------------------------------- */

/* The lids that beta closes: the head's own unless it says how they depend on
 * the shape. */
static int lbs_fold_lids(struct identity *id, const struct head *h,
                         const float *beta, size_t nbeta)
{
    size_t n = h->nlid_shape < nbeta ? h->nlid_shape : nbeta;
    size_t bytes = h->blocks * 2 * ROW * sizeof(float);

    id->lids = h->lids;
    if (h->nlid == 0)
        return 0;
    id->own_lids = aligned_alloc(64, bytes);
    if (!id->own_lids)
        return -1;
    memcpy(id->own_lids, h->lids, bytes);
    id->lids = id->own_lids;
    for (size_t i = 0; i < h->nlid; i++) {
        size_t v = (size_t)h->lid_vertices[i], side = (size_t)h->lid_sides[i];

        for (size_t c = 0; c < 3; c++) {
            const float *d = h->lid_shapedirs + (3 * i + c) * h->nlid_shape;
            double sum = 0;

            for (size_t k = 0; k < n; k++)
                sum += (double)beta[k] * d[k];
            id->own_lids[(v / HEAD_BLOCK * 2 + side) * ROW + c * HEAD_BLOCK +
                         v % HEAD_BLOCK] += (float)sum;
        }
    }
    return 0;
}

/* beta (nlid_shape) += gradient of dverts through lids closed by lid. */
static void lbs_fold_lids_backward(float *beta, const float *dverts,
                                   const struct head *h, const float lid[2])
{
    for (size_t i = 0; i < 3 * h->nlid; i++) {
        float g = lid[h->lid_sides[i / 3]] *
                  dverts[3 * (size_t)h->lid_vertices[i / 3] + i % 3];
        const float *d = h->lid_shapedirs + i * h->nlid_shape;

        for (size_t k = 0; g != 0 && k < h->nlid_shape; k++)
            beta[k] += g * d[k];
    }
}

/* The shape's block b. */
PARALLEL(lbs_fold_block, b, float *, shaped, const struct head *, h,
         const float *, beta, size_t, nbeta)
{
    const float *t = h->template_blocks + b * ROW;
    double sum[ROW];

    for (int i = 0; i < ROW; i++)
        sum[i] = t[i];
    for (size_t k = 0; k < nbeta; k++) {
        const float *d = h->shape_dirs + (b * h->nshape + k) * ROW;

        if (beta[k] != 0 && head_shape_moves(h, b, k))
            for (int i = 0; i < ROW; i++)
                sum[i] += (double)beta[k] * d[i];
    }
    for (int i = 0; i < ROW; i++)
        shaped[b * ROW + i] = (float)sum[i];
}

int head_fold(struct identity *id, const struct head *h, const float *beta,
              size_t nbeta, struct error *err)
{
    size_t bytes = h->blocks * ROW * sizeof(float);

    memset(id, 0, sizeof *id);
    if (nbeta > h->nshape)
        return error_set(err, EX_DATAERR, "identity has %zu shape "
                         "coefficients (expected at most %zu, the head's)",
                         nbeta, h->nshape);
    id->shaped = aligned_alloc(64, bytes);
    if (!id->shaped || lbs_fold_lids(id, h, beta, nbeta)) {
        identity_release(id);
        return error_set(err, EX_OSERR, "no memory for an identity");
    }
    id->head = h;
    for (int i = 0; i < 3 * HEAD_JOINTS; i++)
        id->joints[i] = h->joint_template[i];
    for (size_t k = 0; k < nbeta; k++)
        for (int i = 0; i < 3 * HEAD_JOINTS; i++)
            id->joints[i] += (double)beta[k] * h->joint_shape[15 * k + i];
    parallel_each(lbs_fold_block, h->blocks, 8, id->shaped, h, beta, nbeta);
    return 0;
}

void identity_move(struct identity *id, const float *offset)
{
    for (size_t v = 0; v < id->head->V; v++)
        for (size_t c = 0; c < 3; c++)
            id->shaped[v / HEAD_BLOCK * ROW + c * HEAD_BLOCK +
                       v % HEAD_BLOCK] += offset[3 * v + c];
}

void identity_release(struct identity *id)
{
    free(id->shaped);
    free(id->own_lids);
    memset(id, 0, sizeof *id);
}

/* ---- a frame ----------------------------------------------------------- */

/* Axis-angle of joint j in a frame's parameters. */
static const float *lbs_joint_angle(const struct head_motion *m, int j)
{
    const float *at[HEAD_JOINTS] = {m->global, m->neck, m->jaw, m->eye,
                                    m->eye + 3};

    return at[j];
}

/* The joints' rotations and places of a motion, and their chain. */
static void lbs_chain_of(struct lbs_chain *c, const struct identity *id,
                         const struct head_motion *m)
{
    const struct head *h = id->head;

    for (int j = 0; j < HEAD_JOINTS; j++) {
        const float *r = lbs_joint_angle(m, j);
        double rd[3] = {r[0], r[1], r[2]};

        if (h->public_rodrigues)
            rotation_rodrigues_eps_d(c->R[j], rd);
        else
            rotation_exp_d(c->R[j], rd);
        for (int i = 0; i < 3; i++)
            c->J[j][i] = id->joints[3 * j + i];
    }
    for (size_t k = 0; m->exp && k < h->nexp; k++)
        if (m->exp[k] != 0)
            for (int i = 0; i < 3 * HEAD_JOINTS; i++)
                c->J[i / 3][i % 3] += (double)m->exp[k] *
                                      h->joint_exp[15 * k + i];
    lbs_chain_forward(c, h->parents);
}

/* The active directions and matrices; index and value hold
 * HEAD_MAX_EXP. */
static void lbs_frame_of(struct lbs_frame *fr, int *index, float *value,
                         const struct lbs_chain *c, const struct identity *id,
                         const struct head_motion *m)
{
    const struct head *h = id->head;

    fr->id = id;
    fr->exp_index = index;
    fr->exp_value = value;
    fr->nexp = fr->npose = 0;
    for (size_t k = 0; m->exp && k < h->nexp; k++)
        if (m->exp[k] != 0) {
            index[fr->nexp] = (int)k;
            value[fr->nexp++] = m->exp[k];
        }
    for (int j = 1; j < HEAD_JOINTS; j++) {
        const float *r = lbs_joint_angle(m, j);

        if (r[0] == 0 && r[1] == 0 && r[2] == 0)
            continue;           /* R - I = 0: its nine correctives rest */
        for (int i = 0; i < 9; i++) {
            fr->pose_index[fr->npose] = 9 * (j - 1) + i;
            fr->pose_value[fr->npose++] =
                (float)(c->R[j][i] - (i % 4 == 0));
        }
    }
    for (int j = 0; j < HEAD_JOINTS; j++)
        for (int i = 0; i < 12; i++)
            fr->A[j][i] = (float)c->A[j][i];
    fr->lid[0] = m->lid[0];
    fr->lid[1] = m->lid[1];
}

void head_pose(float *verts, const struct identity *id,
               const struct head_motion *m)
{
    struct lbs_chain c;
    struct lbs_frame fr;
    int index[HEAD_MAX_EXP];
    float value[HEAD_MAX_EXP];

    lbs_chain_of(&c, id, m);
    lbs_frame_of(&fr, index, value, &c, id, m);
    CPU_PICK(lbs_kernels)->pose(verts, &fr);
}

void identity_rest(float *verts, const struct identity *id)
{
    head_pose(verts, id, &(struct head_motion){0});
}

void head_pose_joints(float *joints, const struct identity *id,
                      const struct head_motion *m)
{
    struct lbs_chain c;

    lbs_chain_of(&c, id, m);
    for (int i = 0; i < 3 * HEAD_JOINTS; i++)
        joints[i] = (float)c.tg[i / 3][i % 3];
}

/* From the joints' places to what they depend on: J = J(beta) + joint_exp
 * psi. */
static void lbs_joints_backward(struct head_motion_grad *g,
                                double dJ[HEAD_JOINTS][3],
                                const struct head *h)
{
    for (int i = 0; i < 3 * HEAD_JOINTS; i++) {
        double d = dJ[i / 3][i % 3];

        for (size_t k = 0; g->exp && k < h->nexp; k++)
            g->exp[k] += (float)(d * h->joint_exp[15 * k + i]);
        for (size_t k = 0; g->beta && k < h->nshape; k++)
            g->beta[k] += (float)(d * h->joint_shape[15 * k + i]);
    }
}

/* From the joints' rotations to their angles. */
static void lbs_angles_backward(struct head_motion_grad *g,
                                double dR[HEAD_JOINTS][9],
                                const struct head *h,
                                const struct head_motion *m)
{
    float *dr[HEAD_JOINTS] = {g->global, g->neck, g->jaw, g->eye, g->eye + 3};

    for (int j = 0; j < HEAD_JOINTS; j++) {
        const float *r = lbs_joint_angle(m, j);
        double rd[3] = {r[0], r[1], r[2]}, back[3] = {0};

        if (h->public_rodrigues)
            rotation_rodrigues_eps_backward_d(back, dR[j], rd);
        else
            rotation_exp_backward_d(back, dR[j], rd);
        for (int i = 0; i < 3; i++)
            dr[j][i] += (float)back[i];
    }
}

void head_pose_backward(struct head_motion_grad *g, const float *dverts,
                        const float *djoints, const struct identity *id,
                        const struct head_motion *m)
{
    const struct head *h = id->head;
    double dA[HEAD_JOINTS][12], dR[HEAD_JOINTS][9] = {{0}};
    double dJ[HEAD_JOINTS][3] = {{0}}, dtg[HEAD_JOINTS][3] = {{0}};
    struct lbs_chain c;
    struct lbs_frame fr;
    struct lbs_sums s = {.exp = g->exp, .beta = g->beta};
    int index[HEAD_MAX_EXP];
    float value[HEAD_MAX_EXP];

    lbs_chain_of(&c, id, m);
    lbs_frame_of(&fr, index, value, &c, id, m);
    CPU_PICK(lbs_kernels)->back(&s, dverts, &fr);
    for (int j = 0; j < HEAD_JOINTS; j++) {
        for (int i = 0; i < 12; i++)
            dA[j][i] = s.A[j][i];
        for (int i = 0; djoints && i < 3; i++)
            dtg[j][i] = djoints[3 * j + i];
        /* the correctives' coefficients are R - I */
        for (int i = 0; j > 0 && i < 9; i++)
            dR[j][i] = s.pose[9 * (j - 1) + i];
    }
    lbs_chain_backward(dR, dJ, dA, dtg, &c, h->parents);
    lbs_angles_backward(g, dR, h, m);
    lbs_joints_backward(g, dJ, h);
    if (g->beta)
        lbs_fold_lids_backward(g->beta, dverts, h, m->lid);
    g->lid[0] += s.lid[0];
    g->lid[1] += s.lid[1];
}
