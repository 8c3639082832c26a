/* Inside lib/head: the small algebra of the joint chain, and the block
 * kernels compiled per instruction set. */
#ifndef SPID_HEAD_LBS_KERNEL_H
#define SPID_HEAD_LBS_KERNEL_H

#include <stddef.h>

#include "lib/base/isa.h"
#include "lib/head/lbs.h"

/* Joint chain in double.  R (5,9) local rotations, J (5,3) rest joints;
 * Rg, tg: rotation and position of each joint in the posed head; A (5,12):
 * the skinning matrices [Rg | tg - Rg J]. */
struct lbs_chain {
    double R[HEAD_JOINTS][9], J[HEAD_JOINTS][3];
    double Rg[HEAD_JOINTS][9], tg[HEAD_JOINTS][3];
    double A[HEAD_JOINTS][12];
};

/* From c->R and c->J to the rest. */
void lbs_chain_forward(struct lbs_chain *c, const int parents[HEAD_JOINTS]);
/* dR, dJ += gradient of dA (5,12) and dtg (5,3, the posed joints). */
void lbs_chain_backward(double dR[HEAD_JOINTS][9], double dJ[HEAD_JOINTS][3],
                        double dA[HEAD_JOINTS][12],
                        const double dtg[HEAD_JOINTS][3],
                        const struct lbs_chain *c,
                        const int parents[HEAD_JOINTS]);

/* One frame for the kernels: the directions to add and the matrices. */
struct lbs_frame {
    const struct identity *id;
    size_t nexp, npose;                 /* how many directions are active */
    const int *exp_index;               /* (nexp) which */
    const float *exp_value;             /* (nexp) coefficients */
    int pose_index[HEAD_POSE_DIRS];
    float pose_value[HEAD_POSE_DIRS];
    float A[HEAD_JOINTS][12];
    float lid[2];
};

/* Gradients the kernel collects over the blocks. */
struct lbs_sums {
    float *exp, *beta;                  /* as in head_motion_grad */
    float pose[HEAD_POSE_DIRS];
    float lid[2];
    float A[HEAD_JOINTS][12];
};

struct lbs_kernels {
    /* verts (V,3) out, all blocks in order */
    void (*pose)(float *verts, const struct lbs_frame *fr);
    /* s += gradients of dverts (V,3) */
    void (*back)(struct lbs_sums *s, const float *dverts,
                 const struct lbs_frame *fr);
};

ISA_VERSIONS(const struct lbs_kernels, lbs_kernels);

#endif
