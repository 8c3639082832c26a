/* Numbers in ascending order. */
#ifndef SPID_BASE_SORT_H
#define SPID_BASE_SORT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Sort the n numbers of x, none of which may be NaN. */
void sort_floats(float *x, size_t n);
void sort_doubles(double *x, size_t n);
void sort_keys(uint64_t *x, size_t n);

/* A key that sorts by x, which is not NaN, then by i, which is what is left of it
 * as uint32_t. */
static inline uint64_t sort_key(float x, uint32_t i)
{
    uint32_t bits;

    x += 0;                     /* -0 is 0 */
    memcpy(&bits, &x, sizeof bits);
    return (uint64_t)(bits ^ (bits >> 31 ? ~0u : 1u << 31)) << 32 | i;
}

#endif
