/* The processes that train together: one, unless built with MPI and started
 * by mpirun.  Collective calls must be made by every process in order. */
#ifndef SPID_LAB_TRAIN_GROUP_H
#define SPID_LAB_TRAIN_GROUP_H

#include <stdbool.h>
#include <stddef.h>

#include "lib/base/error.h"

struct group {
    int rank, size;
};

/* Join; outside mpirun (or without MPI) a group of one.  Errors inside later
 * calls end in a return of -1, so that the last checkpoint stays. */
int group_init(struct group *g, struct error *err);
/* Free what it holds. */
void group_release(struct group *g);

/* x[n] = sum over the group. */
int group_sum(const struct group *g, float *x, size_t n, struct error *err);
/* The same of doubles. */
int group_sum_double(const struct group *g, double *x, size_t n,
                     struct error *err);
/* Everybody's flag or-ed together: true when any process says stop. */
int group_any(const struct group *g, bool *flag, struct error *err);
/* End every process of the group with this exit code. */
void group_abort(const struct group *g, int code);

#endif
