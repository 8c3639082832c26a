/* How far two sets of features lie apart, whatever network made them. */
#ifndef SPID_LAB_EVAL_DISTRIBUTION_H
#define SPID_LAB_EVAL_DISTRIBUTION_H

#include <stddef.h>

#include "lib/base/error.h"
#include "lib/lab/eval/table.h"

/* Columns of the row, from two .npy files of (N,dim) numbers, two rows or more,
 * in whatever order:
 *   fid   Frechet's distance of two normal distributions (Heusel et al. 2017),
 *         |ma - mb|^2 + tr Sa + tr Sb - 2 tr (Sa Sb)^1/2, with covariances over
 *         n - 1
 *   kid   squared maximum mean discrepancy, unbiased, of the kernel
 *         (x.y / dim + 1)^3 (Binkowski et al. 2018), over all rows at once
 * EX_DATAERR naming the file where it is no such array, has a number that is not
 * finite, or another dim than the other. */
int distribution_compare(struct table *t, size_t row, const char *truth,
                         const char *result, struct error *err);

#endif
