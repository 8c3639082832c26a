/* Adam (Kingma and Ba) over a model's flat block, with clipping by the global
 * norm and an exponential average of the weights. */
#ifndef SPID_LAB_TRAIN_ADAM_H
#define SPID_LAB_TRAIN_ADAM_H

#include <stddef.h>
#include <stdint.h>

#include "lib/base/error.h"
#include "lib/nn/params.h"

struct adam {
    float beta1, beta2, eps; /* 0.9, 0.999, 1e-8 */
    float clip;              /* largest norm of the gradient; 0: no limit */
    float decay;             /* of the average; 0: none is kept */
    uint64_t step;           /* updates done */
    size_t total;            /* floats in each block */
    float *m, *v;            /* moments, laid out as params.w */
    float *average;          /* weights averaged; NULL when decay is 0 */
};

/* Zero moments for ps (allocated); the average starts as ps->w. */
int adam_init(struct adam *a, const struct params *ps, float clip,
              float decay, struct error *err);
/* Free what it holds; zeroed then. */
void adam_release(struct adam *a);

/* Euclidean norm of the gradients of the tensors that learn. */
double adam_norm(const struct params *ps);

/* Index of the first tensor whose gradient holds a NaN or infinity; (size_t)-1 when
 * all are finite. */
size_t adam_first_bad(const struct params *ps);

/* One update of every tensor that is not frozen from ps->g, whose norm is
 * `norm`; then the average moves: by 1 - min(decay, (1+t)/(10+t)).  Frozen
 * tensors are copied to it (running statistics are averages already).  The
 * same bits for every thread count. */
void adam_update(struct adam *a, struct params *ps, double rate, double norm);

#endif
