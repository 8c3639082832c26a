/* Numbers in ascending order. */
#ifndef SPID_BASE_SORT_H
#define SPID_BASE_SORT_H

#include <stddef.h>
#include <stdint.h>

/* Sort the n numbers of x, none of which may be NaN. */
void sort_floats(float *x, size_t n);
void sort_doubles(double *x, size_t n);
void sort_keys(uint64_t *x, size_t n);

#endif
