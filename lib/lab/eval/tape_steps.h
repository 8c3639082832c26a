/* Steps that only the public networks have which others' pictures and poses are
 * judged by (lib/nn/tape.h). */
#ifndef SPID_LAB_EVAL_TAPE_STEPS_H
#define SPID_LAB_EVAL_TAPE_STEPS_H

#include "lib/nn/tape.h"

/* A batch norm by its running statistics, then act. */
int tape_norm(struct tape *t, int of, const char *name, float eps,
              enum nn_act act);
/* lib/lab/eval/max_pool.h */
int tape_pool(struct tape *t, int of, size_t before, bool cut);
/* Half as large: means of 2x2 pixels. */
int tape_halve(struct tape *t, int of);
/* Twice as large: each pixel four times. */
int tape_double(struct tape *t, int of);
/* x where that is positive, else x times its channel's slope, a tensor. */
int tape_prelu(struct tape *t, int of, const char *name);

#endif
